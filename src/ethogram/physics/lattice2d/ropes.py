"""Ropes: two squares on one side of a voxel never come closer than a side of a square.

A rope that is too short has an impulse along the unit vector n between the two centres, which
pushes and never pulls, until they approach no more.  Voxels of even and odd columns and rows make
four groups; those of a group share no rigid body, and are done at once.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float

from ethogram.physics.lattice2d.contacts import FARTHEST, SLOP, Motion, inertia, times, turned
from ethogram.physics.lattice2d.lattice import COLOURS, Lattice
from ethogram.physics.lattice2d.material import Material
from ethogram.physics.lattice2d.springs import SHORTEST, SIDES
from ethogram.physics.lattice2d.squares import (
    Squares,
    cross,
    of_bodies,
    of_squares,
    over_batch,
    squares,
)

GROUPS = 4


class Ropes(NamedTuple):
    """The ropes of all voxels; [..., side, voxel, *batch]."""

    row: Float[Array, "6 side voxel *batch"]  # Jacobian: of the first square, then of the second
    taut: Bool[Array, "side voxel *batch"]  # whether the squares are too close


def ropes(lattice: Lattice, material: Material, at: Squares) -> Ropes:
    """Ropes of voxels whose squares are in given places."""
    first, second = zip(*SIDES, strict=True)
    distance, n = _apart(at.between(first, second))
    turn_1, turn_2 = (cross(at.levers(ends), n)[None] for ends in (first, second))
    taut = (distance <= material.square) & over_batch(lattice.used, distance.ndim - 2)
    return Ropes(jnp.concatenate([-n, -turn_1, n, turn_2]), taut)


def _apart(between: Float[Array, "2 *at"]) -> tuple[Array, Array]:
    """Length of a vector, and the unit vector along it."""
    distance = jnp.maximum(jnp.sqrt((between**2).sum(0)), SHORTEST)
    return distance, between / distance


def _groups(lattice: Lattice, batch: int) -> Bool[Array, "group voxel ..."]:
    """Which voxels are in each group; padding is in none."""
    number = lattice.cell[:, 0] % 2 + 2 * (lattice.cell[:, 1] % 2)
    return over_batch((number == jnp.arange(GROUPS)[:, None]) & lattice.used, batch)


def tightened(
    lattice: Lattice,
    ropes: Ropes,
    inverse: Float[Array, "6 colour body *batch"],
    motion: Motion,
    impulse: Float[Array, "side voxel *batch"],
) -> tuple[Motion, Float[Array, "side voxel *batch"]]:
    """One sweep over the ropes: motion of rigid bodies and impulses after it.

    Args:
        lattice: the body.
        ropes: of its voxels.
        inverse: of the mass of rigid bodies, springs included.
        motion: of rigid bodies.
        impulse: of ropes so far (N s).

    """
    in_group = _groups(lattice, motion.velocity.ndim - 3)
    of_voxels = of_squares(lattice, inverse)

    def one(number: Array, at: tuple[Motion, Array]) -> tuple[Motion, Array]:
        (velocity, on_body), impulse = at
        group, side = jnp.divmod(number, len(SIDES))
        pair = jnp.asarray(SIDES)[side]
        rows = ropes.row[:3, side], ropes.row[3:, side]
        response = [times(of_voxels[:, pair[end]], rows[end]) for end in range(2)]
        velocities = of_squares(lattice, velocity)
        speed = sum((velocities[:, pair[end]] * rows[end]).sum(0) for end in range(2))
        softness = sum((rows[end] * response[end]).sum(0) for end in range(2))
        wanted = jnp.maximum(impulse[side] - speed / softness, 0.0)
        done = in_group[group] & ropes.taut[side]
        change = jnp.where(done, wanted - impulse[side], 0.0)
        both = jnp.zeros_like(velocity, shape=(6, COLOURS, *change.shape))
        for end in range(2):
            by = jnp.concatenate([response[end], rows[end]]) * change
            both = both.at[:, pair[end]].set(by)
        both = of_bodies(lattice, both)
        return Motion(velocity + both[:3], on_body + both[3:]), impulse.at[side].add(change)

    return lax.fori_loop(0, GROUPS * len(SIDES), one, (motion, impulse))


def impulse_of(
    lattice: Lattice, ropes: Ropes, impulse: Float[Array, "side voxel *batch"]
) -> Float[Array, "3 colour body *batch"]:
    """The impulses of all ropes on each rigid body: N s, N s, N m s."""
    on: list[Any] = [0.0] * COLOURS
    for side, (first, second) in enumerate(SIDES):
        on[first] += ropes.row[:3, side] * impulse[side]
        on[second] += ropes.row[3:, side] * impulse[side]
    return of_bodies(lattice, jnp.stack(on, 1))


def are_short(
    lattice: Lattice, material: Material, place: tuple[Array, Array]
) -> Bool[Array, "side voxel *batch"]:
    """Which ropes are too short by more than is let be."""
    at = squares(lattice, material, *place)
    distance, _ = _apart(at.between(*zip(*SIDES, strict=True)))
    return (distance < material.square - SLOP) & over_batch(lattice.used, distance.ndim - 2)


def lengthened(
    lattice: Lattice,
    material: Material,
    concerned: Bool[Array, "*batch"],
    place: tuple[Array, Array],
) -> tuple[Array, Array]:
    """Displacement and heading of rigid bodies with short ropes corrected, one after the other.

    Args:
        lattice: the body.
        material: of its voxels.
        concerned: robots whose ropes are corrected.
        place: displacement and heading before.

    """
    batch = place[0].ndim - 3
    in_group = _groups(lattice, batch)
    mass, moment = (
        of_squares(lattice, each[None])[0] for each in inertia(lattice, material, batch)
    )

    def one(number: Array, place: tuple[Array, Array]) -> tuple[Array, Array]:
        group, side = jnp.divmod(number, len(SIDES))
        pair = jnp.asarray(SIDES)[side]
        at = squares(lattice, material, *place)
        distance, n = _apart(at.between(pair[:1], pair[1:])[:, 0])
        turns = [cross(at.lever[:, pair[end]], n) for end in range(2)]
        softness = sum(
            1 / mass[pair[end]] + turns[end] ** 2 / moment[pair[end]] for end in range(2)
        )
        lacking = jnp.clip(material.square - SLOP - distance, 0.0, FARTHEST)
        push = jnp.where(in_group[group] & concerned, lacking / softness, 0.0)
        by = jnp.zeros_like(push, shape=(3, COLOURS, *push.shape))
        for end, sign in enumerate((-1, 1)):
            step = jnp.stack([*n, turns[end]]) * sign * push
            weight = jnp.stack([mass[pair[end]], mass[pair[end]], moment[pair[end]]])
            by = by.at[:, pair[end]].set(step / weight)
        change = of_bodies(lattice, by)
        moved, heading = place
        return moved + change[:2], turned(heading, change[2])

    return lax.fori_loop(0, GROUPS * len(SIDES), one, place)
