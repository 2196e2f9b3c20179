"""The thesis' two controllers (sections 5.3.2 and 5.3.3), as pure functions of flat parameters.

A controller turns parameters into a drive: a function of the sensors to the scale of every voxel,
its commanded edge relative to the edge at rest.  Parameters may have trailing batch axes, one set
for each robot of a batch.

Deviations.  The thesis gives sizes in cubic metres; they are read as edges: s^0 = L = 10 mm, and
a = delta s = 1 mm, a tenth of L.  Sizes are normalised to [-1, 1], phases are in radians.  The
networks have no biases, as the thesis' count of parameters says; printed there is 3 (n + 1) h + h n
where 3 n + 1 inputs give (3 n + 1) h + h n.
"""

from abc import abstractmethod
from collections.abc import Callable
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Float, Key

from ethogram.core.batching import with_vmap_rule
from ethogram.core.module import Module
from ethogram.core.rollout import Policy
from ethogram.core.search_space import SearchSpace
from ethogram.core.settings import Number
from ethogram.core.world import PerRole
from ethogram.worlds.softbody.sensors import PER_VOXEL, Sensors, unflatten

Actuation = Literal["shrink_limited", "plain"]
Output = Literal["tanh", "unbounded"]
Drive = Callable[[Sensors], Float[Array, "voxel *batch"]]

AMPLITUDE = 0.1  # a / s^0 and delta s / s^0
HIDDEN_PER_VOXEL = 0.65
MIN_SCALE, MAX_SCALE = 0.25, 1.1  # limits of unbounded outputs


class Controller(Module):
    """A law of control with its parameters left open."""

    voxels: eqx.AbstractVar[int]

    @property
    @abstractmethod
    def search_space(self) -> SearchSpace:
        """Where parameters are drawn from, and their limits."""

    @abstractmethod
    def drive(self, parameters: Float[Array, "gene *batch"]) -> Drive:
        """The law with these parameters."""


class NonSensing(Controller):
    """Sine waves: every voxel swings about a size of its own with a phase of its own (eq. 5.1).

    Parameters: s_1, phi_1, ..., s_n, phi_n.  With v the size gene, g = 1 + 0.1 v, and
    sine = sin(2 pi f k dt + phi), the scale is

    - "shrink_limited": g + 0.1 sine min(1, 1 + (g - 1) / 0.1), as in the original program: voxels
      smaller than at rest swing less;
    - "plain": g + 0.1 sine, eq. 5.1 as printed.
    """

    voxels: int = eqx.field(static=True)
    actuation: Actuation = eqx.field(static=True, default="shrink_limited")
    amplitude: Number = eqx.field(default=AMPLITUDE, converter=jnp.asarray)

    @property
    def search_space(self) -> SearchSpace:
        """Sizes in [-1, 1], always; phases in [-pi, pi] at first."""
        bounds = np.tile([1.0, np.pi], self.voxels)
        limits = np.tile([1.0, np.inf], self.voxels)
        return SearchSpace(*map(jnp.asarray, (-bounds, bounds, -limits, limits)))

    def drive(self, parameters: Float[Array, "gene *batch"]) -> Drive:
        """Sine waves about each voxel's size."""
        genes = parameters.reshape(self.voxels, 2, *parameters.shape[1:])
        size, phase = genes[:, 0], genes[:, 1]
        amplitude = self.amplitude * jnp.ones_like(size)
        if self.actuation == "shrink_limited":
            amplitude = amplitude * jnp.minimum(1.0, 1 + size)
        # sin(t + phi) = sin t cos phi + cos t sin phi: what does not change is computed once
        resting, sine, cosine = (
            1 + self.amplitude * size,
            amplitude * jnp.cos(phase),
            amplitude * jnp.sin(phase),
        )

        def scales(sensors: Sensors) -> Float[Array, "voxel *batch"]:
            return resting + sensors.clock[0] * sine + sensors.clock[1] * cosine

        return scales


class Sensing(Controller):
    """Network from all voxels' sensors and a sine wave to all voxels' scales (eqs. 5.2, 5.3).

    Inputs s_1, |v_1|, |v'_1|, ..., s_n, |v_n|, |v'_n|, sin(2 pi f k dt); h = round(0.65 n) hidden
    units, ReLU; no biases.  Parameters: the (3 n + 1) h weights of the hidden units, input by
    input, then the h n weights of the outputs, hidden unit by hidden unit.  With o an output, the
    scale is

    - "tanh": 1 + 0.1 tanh(o), as eq. 5.2 asks of an output in [-1, 1];
    - "unbounded": 1 + 0.1 o, limited only to [0.25, 1.1].
    """

    voxels: int = eqx.field(static=True)
    output: Output = eqx.field(static=True, default="tanh")
    amplitude: Number = eqx.field(default=AMPLITUDE, converter=jnp.asarray)

    @property
    def inputs(self) -> int:
        """Sensors of all voxels, and the sine wave."""
        return PER_VOXEL * self.voxels + 1

    @property
    def hidden(self) -> int:
        """Hidden units."""
        return round(HIDDEN_PER_VOXEL * self.voxels)

    @property
    def search_space(self) -> SearchSpace:
        """Weights in [-1, 1] at first, without limits later."""
        bounds = np.ones((self.inputs + self.voxels) * self.hidden)
        limits = np.inf * bounds
        return SearchSpace(*map(jnp.asarray, (-bounds, bounds, -limits, limits)))

    def drive(self, parameters: Float[Array, "gene *batch"]) -> Drive:
        """The network with these weights."""
        batch = parameters.shape[1:]
        split = self.inputs * self.hidden
        inward = parameters[:split].reshape(self.inputs, self.hidden, *batch)
        outward = parameters[split:].reshape(self.hidden, self.voxels, *batch)

        def scales(sensors: Sensors) -> Float[Array, "voxel *batch"]:
            voxels = jnp.stack([sensors.scale, sensors.speed, sensors.acceleration], 1)
            readings = voxels.reshape(-1, *batch)
            hidden = jax.nn.relu(
                weighted_sum(inward[:-1], readings) + inward[-1] * sensors.clock[0]
            )
            output = weighted_sum(outward, hidden)
            if self.output == "tanh":
                return 1 + self.amplitude * jnp.tanh(output)
            return jnp.clip(1 + self.amplitude * output, MIN_SCALE, MAX_SCALE)

        return scales


def weighted_sum(
    weights: Float[Array, "input output *batch"], inputs: Float[Array, "input *batch"]
) -> Float[Array, "output *batch"]:
    """Sums over inputs, one after the other: with robots as last axis four times as fast as `sum`.

    XLA on a CPU does not vectorise a reduction over a leading axis of a product.  `jax.vmap` lays
    robots side by side, as the last axis, too.
    """
    found: Array = _weighted_sum(weights, inputs)
    return found


def _one_after_the_other(weights: Array, inputs: Array) -> Array:
    batch = jnp.broadcast_shapes(weights.shape[2:], inputs.shape[1:])
    start = jnp.zeros((weights.shape[1], *batch), jnp.result_type(weights, inputs))
    return lax.fori_loop(0, len(weights), lambda i, so_far: so_far + weights[i] * inputs[i], start)


def _in_batch(
    size: int, is_batched: list[bool], weights: Array, inputs: Array
) -> tuple[Array, bool]:
    """A batch as the axis after those of inputs and outputs."""
    del size

    def moved(values: Array, batched: bool, own: int) -> Array:
        return jnp.moveaxis(values, 0, own) if batched else jnp.expand_dims(values, own)

    # without a barrier, XLA would turn the weights round in each step of a loop, not before it
    turned: Array = lax.optimization_barrier(  # type: ignore[no-untyped-call]
        moved(weights, is_batched[0], 2)
    )
    return jnp.moveaxis(_weighted_sum(turned, moved(inputs, is_batched[1], 1)), 1, 0), True


_weighted_sum = with_vmap_rule(_one_after_the_other, _in_batch)


def policy(
    controller: Controller, parameters: Float[Array, "gene"], edge: Number, role: str = "robot"
) -> Policy:
    """A controller as a policy of the world, from observations to edges in metres.

    Args:
        controller: the law.
        parameters: of one robot.
        edge: at rest, in metres.
        role: whom it plays.

    """
    drive = controller.drive(parameters)

    def act(key: Key[Array, ""], observation: PerRole) -> PerRole:
        del key
        return {
            role: jax.vmap(lambda readings: edge * drive(unflatten(readings)))(observation[role])
        }

    return act
