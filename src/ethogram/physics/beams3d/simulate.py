"""Simulation: states and commands in, states out, for a block of robots and many steps.

All that moves a body goes through `simulate`.  A kernel written by hand for a processor would stand
behind it: all that it needs are arrays, with the robots side by side as trailing axes.  `jax.vmap`
over robots of one body and one material makes more of these axes, however deep it is nested; over
bodies or materials it does what it always does.  Derivatives are those of the steps in JAX.
"""

from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float

from ethogram.core.batching import plain_vmap, with_vmap_rule
from ethogram.physics.beams3d.lattice import Lattice
from ethogram.physics.beams3d.material import Material
from ethogram.physics.beams3d.motion import State, step


def simulate(
    lattice: Lattice,
    material: Material,
    state: State,
    edge: Float[Array, "step voxel *batch"],
    gravity: Float[Array, "step 3 ..."],
    *,
    floor: bool = True,
) -> State:
    """The state after as many steps of `material.time_step` as there are commands.

    Args:
        lattice: the body.
        material: of voxels and floor.
        state: at the start.
        edge: commanded at each step (m).
        gravity: acceleration at each step (m/s^2), the same for all robots or one each.
        floor: whether there is one, at z = 0.

    """
    found: State = _simulation(floor)(lattice, material, state, edge, gravity)
    return found


@cache
def _simulation(floor: bool) -> Any:
    def steps(
        lattice: Lattice,
        material: Material,
        state: State,
        edge: Float[Array, "step voxel *batch"],
        gravity: Float[Array, "step 3 ..."],
    ) -> State:
        advance = partial(step, lattice, material, floor=floor)
        if len(edge) == 1:
            return advance(state, edge[0], gravity[0])
        return lax.scan(lambda at, now: (advance(at, *now), None), state, (edge, gravity))[0]

    def side_by_side(
        size: int,
        batched: list[Any],
        lattice: Lattice,
        material: Material,
        state: Any,
        edge: Array,
        gravity: Array,
    ) -> tuple[Any, Any]:
        if any(jax.tree.leaves(batched[:2])):
            return plain_vmap(steps, batched, (lattice, material, state, edge, gravity))
        batch = edge.shape[2 + batched[3] :]  # of batches that are lanes already
        lanes = partial(_as_lanes, size, batch)

        def part(leaf: Array, is_batched: bool) -> Array:
            return lanes(leaf, is_batched, own=0 if leaf is state.steps else None)

        after = simulation(
            lattice,
            material,
            jax.tree.map(part, state, batched[2]),
            lanes(edge, batched[3]),
            lanes(gravity, batched[4], own=2),
        )
        in_lanes = jax.tree.map(lambda leaf: leaf is not after.steps or leaf.ndim > 0, after)
        return jax.tree.map(
            lambda leaf, is_in: jnp.moveaxis(leaf, -1, 0) if is_in else leaf, after, in_lanes
        ), in_lanes

    simulation = with_vmap_rule(steps, side_by_side)
    return simulation


def _as_lanes(
    size: int, batch: tuple[int, ...], leaf: Array, is_batched: bool, own: int | None = None
) -> Array:
    """An array with a batch, of which the leading axis is one if any, as its last axis.

    Args:
        size: of the batch.
        batch: the axes of batches that are trailing ones already.
        leaf: the array.
        is_batched: whether it has the leading axis.
        own: how many axes the array has of its own, if it may be shared by all robots: it then
            stays as it is.  None is an array that is there for every robot.

    """
    if own is not None and leaf.ndim == own and not is_batched:
        return leaf
    if own is not None and leaf.ndim == own + is_batched:
        leaf = leaf.reshape(leaf.shape + (1,) * len(batch))
    each = leaf.shape[is_batched : leaf.ndim - len(batch)]
    if not is_batched:
        leaf = leaf[None]
    return jnp.moveaxis(jnp.broadcast_to(leaf, (size, *each, *batch)), 0, -1)
