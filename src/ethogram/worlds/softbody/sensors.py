"""What a robot senses: of every voxel its scale, speed and acceleration, and of time a clock.

Thesis, section 5.3.3: what is sensed at step k is what step k - 1 brought.  The thesis' network has
sin(2 pi f k dt) beside the sensors; the clock here shows the cosine as well, so that any phase can
be made of what is sensed.
"""

from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from ethogram.core.clock import phase
from ethogram.core.settings import Number
from ethogram.physics.beams3d import Lattice, Material, State, sensed_scale

PER_VOXEL = 3  # scale, speed, acceleration
CLOCK = 2  # sine, cosine
Scale = Literal["strain", "commanded"]


class Sensors(eqx.Module):
    """What is sensed at a step; trailing axes, if any, are a batch of robots."""

    scale: Float[Array, "voxel *batch"]  # of edges; 1 at rest
    speed: Float[Array, "voxel *batch"]  # m/s
    acceleration: Float[Array, "voxel *batch"]  # in units of the world's choice
    clock: Float[Array, "2"]  # sine and cosine of 2 pi f k dt


def sense(
    lattice: Lattice,
    material: Material,
    state: State,
    *,
    scale: Scale,
    acceleration_scale: Number,
    frequency: Number,
) -> Sensors:
    """Read the sensors.

    Args:
        lattice: the body.
        material: of its voxels.
        state: after the last step.
        scale: "strain", the mean of 1 + strain over a voxel's bonds, or "commanded", the edge that
            was commanded, relative to the edge at rest.
        acceleration_scale: what |dv/dt| (m/s^2) is multiplied by.
        frequency: of the clock (Hz).

    """
    angle = phase(state.steps, frequency, material.time_step)
    scales = sensed_scale(lattice, state) if scale == "strain" else state.edge / material.edge
    return Sensors(
        scale=scales,
        speed=_norm(state.momentum) / material.mass,
        acceleration=_norm(state.force) / material.mass * acceleration_scale,
        clock=jnp.stack([jnp.sin(angle), jnp.cos(angle)]).astype(scales.dtype),
    )


def flatten(sensors: Sensors) -> Float[Array, "seen *batch"]:
    """In the order of the thesis: s_1, |v_1|, |v'_1|, ..., s_n, |v_n|, |v'_n|, sine, cosine."""
    voxels = jnp.stack([sensors.scale, sensors.speed, sensors.acceleration], 1)
    batch = sensors.scale.shape[1:]
    clock = sensors.clock.reshape((CLOCK,) + (1,) * len(batch))
    return jnp.concatenate([voxels.reshape(-1, *batch), jnp.broadcast_to(clock, (CLOCK, *batch))])


def unflatten(observation: Float[Array, "seen"]) -> Sensors:
    """What `flatten` made one array of, for one robot."""
    scale, speed, acceleration = observation[:-CLOCK].reshape(-1, PER_VOXEL).T
    return Sensors(scale, speed, acceleration, observation[-CLOCK:])


def _norm(vectors: Float[Array, "3 voxel *batch"]) -> Float[Array, "voxel *batch"]:
    """Lengths, with a gradient of zero at zero."""
    square = (vectors * vectors).sum(0)
    return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)
