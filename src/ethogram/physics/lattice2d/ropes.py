"""Ropes: two squares on one side of a voxel never come closer than a side of a square.

A rope that is too short has an impulse along the unit vector n between the two centres, which
pushes and never pulls, until they approach no more.  Voxels of even and odd columns and rows make
four groups; those of a group share no rigid body, and are done at once.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float

from ethogram.physics.lattice2d.contacts import CORRECTED, FARTHEST, SLOP, inertia, times, turned
from ethogram.physics.lattice2d.lattice import COLOURS, Lattice
from ethogram.physics.lattice2d.material import Material
from ethogram.physics.lattice2d.springs import SHORTEST, SIDES
from ethogram.physics.lattice2d.squares import (
    Squares,
    cross,
    of_squares,
    over_batch,
    squares,
    total,
)

GROUPS = 4


class Ropes(NamedTuple):
    """The ropes of all voxels; [..., side, voxel, *batch]."""

    row: Float[Array, "6 side voxel *batch"]  # Jacobian: of the first square, then of the second
    taut: Bool[Array, "side voxel *batch"]  # whether the squares are too close


def ropes(lattice: Lattice, material: Material, at: Squares) -> Ropes:
    """Ropes of voxels whose squares are in given places."""
    rows, taut = [], []
    for side, (first, second) in enumerate(SIDES):
        distance, n = _apart(at, side)
        turn_1, turn_2 = (cross(at.lever[:, each], n) for each in (first, second))
        rows.append(jnp.stack([-n[0], -n[1], -turn_1, n[0], n[1], turn_2]))
        taut.append(distance <= material.square)
    is_short = jnp.stack(taut)
    return Ropes(jnp.stack(rows, 1), is_short & over_batch(lattice.used, is_short.ndim - 2))


def _apart(at: Squares, side: int) -> tuple[Array, tuple[Array, Array]]:
    """Distance between the two squares of a side, and the unit vector between their centres."""
    x, y = at.between(*SIDES[side])
    distance = jnp.maximum(jnp.sqrt(x**2 + y**2), SHORTEST)
    return distance, (x / distance, y / distance)


def _groups(lattice: Lattice, batch: int) -> Bool[Array, "group voxel ..."]:
    """Which voxels are in each group; padding is in none."""
    number = lattice.cell[:, 0] % 2 + 2 * (lattice.cell[:, 1] % 2)
    return over_batch((number == jnp.arange(GROUPS)[:, None]) & lattice.used, batch)


def tightened(
    lattice: Lattice,
    ropes: Ropes,
    inverse: Float[Array, "6 colour body *batch"],
    velocity: Float[Array, "3 colour body *batch"],
    impulse: Float[Array, "side voxel *batch"],
) -> tuple[Array, Array]:
    """One sweep over the ropes: velocities of rigid bodies and impulses after it.

    Args:
        lattice: the body.
        ropes: of its voxels.
        inverse: of the mass of rigid bodies, springs included.
        velocity: of rigid bodies.
        impulse: of ropes so far (N s).

    """
    in_group = _groups(lattice, velocity.ndim - 3)

    def group(number: Array, both: tuple[Array, Array]) -> tuple[Array, Array]:
        velocity, impulse = both
        for side, pair in enumerate(SIDES):
            rows = ropes.row[:3, side], ropes.row[3:, side]
            response = [
                times(of_squares(lattice, inverse)[:, colour], row)
                for colour, row in zip(pair, rows, strict=True)
            ]
            speeds = [
                (of_squares(lattice, velocity)[:, colour] * row).sum(0)
                for colour, row in zip(pair, rows, strict=True)
            ]
            softness = sum((a * b).sum(0) for a, b in zip(rows, response, strict=True))
            wanted = jnp.maximum(impulse[side] - sum(speeds) / softness, 0.0)
            done = in_group[number] & ropes.taut[side]
            change = jnp.where(done, wanted - impulse[side], 0.0)
            impulse = impulse.at[side].add(change)
            for colour, each in zip(pair, response, strict=True):
                velocity = velocity.at[:, colour].add(total(lattice, colour, each * change))
        return velocity, impulse

    return lax.fori_loop(0, GROUPS, group, (velocity, impulse))


def impulse_of(
    lattice: Lattice, ropes: Ropes, impulse: Float[Array, "side voxel *batch"]
) -> Float[Array, "3 colour body *batch"]:
    """The impulses of all ropes on each rigid body: N s, N s, N m s."""
    on: list[Any] = [0.0] * COLOURS
    for side, (first, second) in enumerate(SIDES):
        on[first] += ropes.row[:3, side] * impulse[side]
        on[second] += ropes.row[3:, side] * impulse[side]
    return jnp.stack([total(lattice, colour, on[colour]) for colour in range(COLOURS)], 1)


def are_short(
    lattice: Lattice, material: Material, place: tuple[Array, Array]
) -> Bool[Array, "side voxel *batch"]:
    """Which ropes are too short by more than is let be."""
    at = squares(lattice, material, *place)
    distance = jnp.stack([_apart(at, side)[0] for side in range(len(SIDES))])
    return (distance < material.square - SLOP) & over_batch(lattice.used, distance.ndim - 2)


def lengthened(
    lattice: Lattice, material: Material, place: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Displacement and heading of rigid bodies with short ropes corrected, one after the other."""
    batch = place[0].ndim - 3
    in_group = _groups(lattice, batch)
    mass, moment = (
        of_squares(lattice, each[None])[0] for each in inertia(lattice, material, batch)
    )

    def group(number: Array, place: tuple[Array, Array]) -> tuple[Array, Array]:
        for side, pair in enumerate(SIDES):
            at = squares(lattice, material, *place)
            distance, n = _apart(at, side)
            lacking = jnp.clip(material.square - SLOP - distance, 0.0, FARTHEST)
            turns = [cross(tuple(at.lever[:, colour]), n) for colour in pair]
            softness = sum(
                1 / mass[colour] + turn**2 / moment[colour]
                for colour, turn in zip(pair, turns, strict=True)
            )
            push = jnp.where(in_group[number], lacking / softness, 0.0)
            moved, heading = place
            for sign, colour, turn in zip((-1, 1), pair, turns, strict=True):
                step = sign * push * jnp.stack(n) / mass[colour]
                angle = sign * push * turn / moment[colour]
                moved = moved.at[:, colour].add(total(lattice, colour, step))
                by = total(lattice, colour, angle[None])[0]
                heading = heading.at[:, colour].set(turned(heading[:, colour], by))
            place = moved, heading
        return place

    return lax.fori_loop(0, GROUPS, group, place)
