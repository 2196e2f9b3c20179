"""Sensors of a body in the plane: of every voxel touch, velocity and area, and of time a clock.

Thesis, section 6.4.2, as its simulator has it: whether a square of the voxel touches something that
is not of the body; the velocity of its centre along its own two axes, as (v + 5) / 10 m/s; its area
ratio, as r - 0.5; all of them limited to [0, 1].
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float

from ethogram.physics.lattice2d import Lattice, Material, State
from ethogram.physics.lattice2d.contacts import POINTS_OF_SQUARE
from ethogram.physics.lattice2d.lattice import COLOURS
from ethogram.physics.lattice2d.squares import (
    Squares,
    area_ratio,
    of_squares,
    over_batch,
    squares,
)

PER_VOXEL = 4  # touch, velocity along x and y, area
FASTEST = 5.0  # m/s, that can be sensed


class Voxels(NamedTuple):
    """Where voxels are and how they move; trailing axes, if any, are a batch of robots."""

    centre: Float[Array, "2 voxel *batch"]  # m
    velocity: Float[Array, "2 voxel *batch"]  # m/s, along their own axes
    area: Float[Array, "voxel *batch"]  # ratio to that at rest
    touch: Bool[Array, "voxel *batch"]


def voxels(lattice: Lattice, material: Material, state: State) -> Voxels:
    """The voxels of a body."""
    at = squares(lattice, material, state.moved, state.heading)
    place = at.moved + at.lever + at.rest
    x, y, spin = of_squares(lattice, state.velocity)
    velocity = jnp.stack([x - spin * at.lever[1], y + spin * at.lever[0]]).mean(1)
    own = _own_axis(at, place)
    along = (own * velocity).sum(0)
    across = own[0] * velocity[1] - own[1] * velocity[0]
    return Voxels(
        place.mean(1),
        jnp.stack([along, across]),
        area_ratio(material, at),
        touching(lattice, state),
    )


def _own_axis(
    at: Squares, place: Float[Array, "2 colour voxel *batch"]
) -> Float[Array, "2 voxel *batch"]:
    """The x axis of each voxel: from its left squares to its right ones."""
    towards = at.mirror[0] * (place[:, 1] + place[:, 3] - place[:, 0] - place[:, 2])
    return towards / jnp.maximum(jnp.sqrt((towards**2).sum(0)), 1e-9)


def touching(lattice: Lattice, state: State) -> Bool[Array, "voxel *batch"]:
    """Which voxels something pushes that is not of the body, in the last step."""
    pushing = state.contact[:, 0]
    by_square = pushing.reshape(POINTS_OF_SQUARE, COLOURS, *pushing.shape[1:]).max(0) > 0
    # [square, colour, body] -> [square, colour, voxel]
    found = of_squares(lattice, by_square)
    listed = of_squares(lattice, jnp.moveaxis(lattice.voxel, -1, 0))
    is_mine = listed == jnp.arange(lattice.voxels)
    return (found & over_batch(is_mine, found.ndim - 3)).any((0, 1))


def readings(found: Voxels, used: Bool[Array, "voxel"]) -> Float[Array, "reading *batch"]:
    """What voxels sense, one after the other: touch, velocity along x and y, area."""
    speed = jnp.clip((found.velocity + FASTEST) / (2 * FASTEST), 0, 1)
    area = jnp.clip(found.area - 0.5, 0, 1)
    each = jnp.stack([found.touch.astype(area.dtype), *speed, area], 1)
    there = over_batch(used[:, None], each.ndim - 2)
    return jnp.where(there, each, 0.0).reshape(-1, *area.shape[1:])
