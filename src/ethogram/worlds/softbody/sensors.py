"""Sensors of a soft robot: of every voxel its scale, speed and acceleration, and of time a clock.

Thesis, section 5.3.3: what is sensed at step k is what step k - 1 brought.  The thesis' network has
sin(2 pi f k dt) beside the sensors; the clock here shows the cosine as well, so that any phase can
be made of what is sensed.
"""

from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float

PER_VOXEL = 3  # scale, speed, acceleration
CLOCK = 2  # sine, cosine
Scale = Literal["strain", "commanded"]


class Sensors(eqx.Module):
    """Readings at a step; trailing axes, if any, are a batch of robots."""

    scale: Float[Array, "voxel *batch"]  # of edges; 1 at rest
    speed: Float[Array, "voxel *batch"]  # m/s
    acceleration: Float[Array, "voxel *batch"]  # in units of the world's choice
    clock: Float[Array, "2 ..."]  # sine and cosine of 2 pi f k dt


def clock(angle: Float[Array, "*batch"]) -> Float[Array, "2 *batch"]:
    """Sine and cosine of a phase (radians)."""
    return jnp.stack([jnp.sin(angle), jnp.cos(angle)])


def length(vectors: Float[Array, "axis voxel *batch"]) -> Float[Array, "voxel *batch"]:
    """Lengths of vectors in the plane or in space, with a gradient of zero at zero."""
    square = (vectors * vectors).sum(0)
    return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)


def only_used(sensors: Sensors, used: Bool[Array, "voxel"]) -> Sensors:
    """The readings of a padded body: those of its padding are 0."""
    there = used.reshape(used.shape + (1,) * (sensors.scale.ndim - 1))

    def masked(reading: Float[Array, "voxel *batch"]) -> Float[Array, "voxel *batch"]:
        return jnp.where(there, reading, 0.0)

    return Sensors(
        masked(sensors.scale), masked(sensors.speed), masked(sensors.acceleration), sensors.clock
    )


def flatten(sensors: Sensors) -> Float[Array, "reading *batch"]:
    """In the order of the thesis: s_1, |v_1|, |v'_1|, ..., s_n, |v_n|, |v'_n|, sine, cosine."""
    voxels = jnp.stack([sensors.scale, sensors.speed, sensors.acceleration], 1)
    batch = sensors.scale.shape[1:]
    shared = sensors.clock.ndim == 1
    time = sensors.clock.reshape((CLOCK,) + (1,) * len(batch)) if shared else sensors.clock
    return jnp.concatenate([voxels.reshape(-1, *batch), jnp.broadcast_to(time, (CLOCK, *batch))])


def flatten_used(used: Bool[Array, "voxel"]) -> Bool[Array, "reading"]:
    """Which entries of `flatten` are no padding."""
    return jnp.concatenate([jnp.repeat(used, PER_VOXEL), jnp.ones(CLOCK, bool)])


def unflatten(observation: Float[Array, "reading"]) -> Sensors:
    """The readings that `flatten` made one array of, for one robot."""
    scale, speed, acceleration = observation[:-CLOCK].reshape(-1, PER_VOXEL).T
    return Sensors(scale, speed, acceleration, observation[-CLOCK:])
