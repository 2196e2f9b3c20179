"""Simulation: states and commands in, states out, for a block of robots and many steps.

All that moves a body in the plane goes through `simulate`, or, one voxel driven at a time, through
`avalanche.avalanches`.  `jax.vmap` over robots of one body lays them side by side as the last axis,
however deep it is nested; over bodies, materials or terrains JAX does what it always does.
"""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float

from ethogram.core.batching import plain_vmap, with_vmap_rule
from ethogram.core.errors import InvalidSettings
from ethogram.core.settings import Number
from ethogram.physics.lattice2d.contacts import POINTS, Terrain
from ethogram.physics.lattice2d.lattice import COLOURS, Lattice
from ethogram.physics.lattice2d.material import Material
from ethogram.physics.lattice2d.motion import State, step
from ethogram.physics.lattice2d.springs import SIDES


def simulate(
    lattice: Lattice,
    material: Material,
    state: State,
    control: Float[Array, "step voxel *batch"],
    *,
    gravity: Number,
    terrain: Terrain | None = None,
) -> State:
    """The state after as many steps of `material.time_step` as there are commands.

    Args:
        lattice: the body.
        material: of its voxels.
        state: at the start; made for a terrain, or for none, as there is one.
        control: of each voxel at each step: 1 contracts, -1 expands, 0 is at rest.
        gravity: acceleration downwards (m/s^2).
        terrain: what there is to touch; None is nothing.

    Raises:
        InvalidSettings: an array is not of the shape or the type that it should be.

    """
    control = _checked(lattice, state, control, terrain)
    if len(control) == 0:
        return state
    gravity = jnp.asarray(gravity, control.dtype)
    found: State = _simulated(lattice, material, gravity, terrain, state, control)
    return found


def _checked(lattice: Lattice, state: State, control: Any, terrain: Terrain | None) -> Array:
    """Commands as an array of the state's type."""
    dtype, control = state.moved.dtype, jnp.asarray(control)
    batch = state.moved.shape[3:]
    bodies = (COLOURS, lattice.bodies, *batch)
    for name, array, shape in (
        ("state.moved", state.moved, (2, *bodies)),
        ("state.heading", state.heading, (2, *bodies)),
        ("state.velocity", state.velocity, (3, *bodies)),
        ("state.change", state.change, (3, *bodies)),
        ("state.rope", state.rope, (len(SIDES), lattice.voxels, *batch)),
        ("state.contact", state.contact, (POINTS if terrain else 0, 2, *bodies)),
        ("control", control, (*control.shape[:1], lattice.voxels, *batch)),
    ):
        if array.shape != shape or not jnp.issubdtype(array.dtype, jnp.floating):
            raise InvalidSettings(
                f"simulate: {name} has the shape {array.shape} and the type {array.dtype}; "
                f"allowed: {shape} and {dtype}."
            )
    return control.astype(dtype)


def _steps(
    lattice: Lattice,
    material: Material,
    gravity: Array,
    terrain: Terrain | None,
    state: State,
    control: Array,
) -> State:
    advance = partial(step, lattice, material, gravity=gravity, terrain=terrain)
    if len(control) == 1:
        return advance(state, control[0])
    return lax.scan(lambda at, now: (advance(at, now), None), state, control)[0]


def _batched(size: int, is_batched: list[Any], *arguments: Any) -> tuple[Any, Any]:
    """Robots of one body side by side."""
    *surroundings, state, control = arguments
    if any(jax.tree.leaves(is_batched[:-2])):
        return plain_vmap(_steps, is_batched, arguments)

    def last(leaf: Array, there: bool) -> Array:
        leaf = leaf if there else jnp.broadcast_to(leaf, (size, *leaf.shape))
        return jnp.moveaxis(leaf, 0, -1)

    moved = jax.tree.map(last, (state, control), tuple(is_batched[-2:]))
    after = _simulated(*surroundings, *moved)
    first = jax.tree.map(lambda leaf: jnp.moveaxis(leaf, -1, 0), after)
    return first, jax.tree.map(lambda _: True, first)


_simulated = with_vmap_rule(_steps, _batched)
