"""State of voxel-based bodies in the plane, and one step of time.

Gravity and drag; springs, ropes and contacts as impulses; places by the new velocities
(semi-implicit Euler); then what overlaps is moved apart.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float

from ethogram.core.batching import in_any_copy
from ethogram.physics.lattice2d.contacts import (
    PASSES,
    POINTS,
    Contacts,
    Terrain,
    lifted,
    terrain_contacts,
    turned,
)
from ethogram.physics.lattice2d.lattice import COLOURS, Lattice
from ethogram.physics.lattice2d.material import Material
from ethogram.physics.lattice2d.ropes import are_short, lengthened, ropes
from ethogram.physics.lattice2d.solver import Constraints, Impulses, solve
from ethogram.physics.lattice2d.springs import SIDES, blocks
from ethogram.physics.lattice2d.squares import squares


class State(eqx.Module):
    """State of a body: its rigid bodies, by colour, and what they last did to each other."""

    moved: Float[Array, "2 colour body *batch"]  # of its centre, from where it is at rest, m
    heading: Float[Array, "2 colour body *batch"]  # cosine and sine of its angle
    velocity: Float[Array, "3 colour body *batch"]  # m/s, m/s, rad/s
    change: Float[Array, "3 colour body *batch"]  # of velocities by constraints, in the last step
    rope: Float[Array, "side voxel *batch"]  # impulses of the last step, N s
    contact: Float[Array, "point 2 colour body *batch"]  # along normals and tangents of a terrain


def at_rest(
    lattice: Lattice,
    batch: tuple[int, ...] = (),
    *,
    place: tuple[Any, Any] = (0.0, 0.0),
    terrain: bool = True,
) -> State:
    """A body that nothing has moved yet.

    Args:
        lattice: the body.
        batch: the axes of a batch of robots, all alike.
        place: of the lower left corner of cell (0, 0), m.
        terrain: whether there will be one to touch.

    """
    shape = COLOURS, lattice.bodies, *batch
    x, y = (jnp.broadcast_to(jnp.asarray(each, float), shape) for each in place)
    return State(
        moved=jnp.stack([x, y]),
        heading=jnp.stack([jnp.ones(shape), jnp.zeros(shape)]),
        velocity=jnp.zeros((3, *shape)),
        change=jnp.zeros((3, *shape)),
        rope=jnp.zeros((len(SIDES), lattice.voxels, *batch)),
        contact=jnp.zeros((POINTS if terrain else 0, 2, *shape)),
    )


def step(
    lattice: Lattice,
    material: Material,
    state: State,
    control: Float[Array, "voxel *batch"],
    *,
    gravity: Float[Array, ""],
    terrain: Terrain | None = None,
) -> State:
    """The state after `material.time_step`.

    Args:
        lattice: the body.
        material: of its voxels.
        state: where it is.
        control: of each voxel: 1 contracts, -1 expands.
        gravity: acceleration downwards, m/s^2.
        terrain: what there is to stand on; None is nothing.

    """
    time = material.time_step
    fallen = state.velocity.at[1].add(-gravity * time)
    free = fallen * (1 - time * material.drag)
    at = squares(lattice, material, state.moved, state.heading)
    tied = ropes(lattice, material, at)
    place = state.moved, state.heading
    contacts = (
        None if terrain is None else terrain_contacts(lattice, material, terrain, place, free)
    )
    constraints = Constraints(
        blocks(material, at, control), tied, contacts, in_any_copy(tied.taut.any())
    )
    velocity, impulses = solve(
        lattice, material, constraints, free, free + state.change, _carried_over(state, constraints)
    )
    moved = state.moved + time * velocity[:2]
    heading = turned(state.heading, time * velocity[2])
    moved, heading = corrected(lattice, material, contacts, (moved, heading))
    return State(moved, heading, velocity, velocity - free, impulses.rope, impulses.contact)


def _carried_over(state: State, constraints: Constraints) -> Impulses:
    """Impulses of the last step, of what still pushes."""
    rope = jnp.where(constraints.ropes.taut, state.rope, 0.0)
    if constraints.contacts is None:
        return Impulses(rope, state.contact)
    return Impulses(rope, jnp.where(constraints.contacts.touching[:, None], state.contact, 0.0))


def corrected(
    lattice: Lattice,
    material: Material,
    contacts: Contacts | None,
    place: tuple[Array, Array],
) -> tuple[Array, Array]:
    """Displacement and heading of rigid bodies, moved out of what they overlap.

    Args:
        lattice: the body.
        material: of its voxels.
        contacts: of this step; None is no terrain.
        place: displacement and heading before.

    """
    is_short = are_short(lattice, material, place).any((0, 1))  # each robot, whatever the others
    short = in_any_copy(is_short.any())
    longer = partial(lengthened, lattice, material, is_short)
    if contacts is None:
        return lax.cond(short, lambda: _passes(longer, place), lambda: place)

    def once(place: tuple[Array, Array]) -> tuple[Array, Array]:
        place = lax.cond(short, longer, lambda at: at, place)
        return lifted(lattice, material, contacts, place)

    touching = in_any_copy(contacts.touching.any())
    return lax.cond(short | touching, lambda: _passes(once, place), lambda: place)


def _passes(once: Callable[[Any], Any], place: tuple[Array, Array]) -> tuple[Array, Array]:
    return lax.fori_loop(0, PASSES, lambda _, at: once(at), place)
