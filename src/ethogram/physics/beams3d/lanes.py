"""Robots side by side: what makes the batches of `jax.vmap` trailing axes of a simulation."""

from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

from ethogram.physics.beams3d.lattice import Lattice
from ethogram.physics.beams3d.material import Material
from ethogram.physics.beams3d.motion import State

Arguments = tuple[Lattice, Material, State, Array, Array]  # of a simulation; edge, gravity last


def more_lanes(
    simulated: Any, size: int, is_batched: list[Any], arguments: Arguments, *, bodies: int = 0
) -> tuple[Any, Any]:
    """What a rule of `with_vmap_rule` returns for a batch of robots of one body and one material.

    Args:
        simulated: the simulation.
        size: of the batch.
        is_batched: trees of truth values: which arrays have the batch as leading axis.
        arguments: of the simulation.
        bodies: how many axes of bodies come before all others (and after that of the batch).

    """
    lattice, material, state, edge, gravity = arguments
    batch = edge.shape[bodies + 2 + is_batched[3] :]  # of batches that are lanes already

    def last(leaf: Array, leaf_is_batched: bool, own: int | None = None) -> Array:
        return _as_lanes(size, batch, leaf, leaf_is_batched, own)

    def part(leaf: Array, leaf_is_batched: bool) -> Array:
        return last(leaf, leaf_is_batched, bodies if leaf is state.steps else None)

    after = simulated(
        lattice,
        material,
        jax.tree.map(part, state, is_batched[2]),
        last(edge, is_batched[3]),
        last(gravity, is_batched[4], bodies + 2),
    )
    in_lanes = jax.tree.map(lambda leaf: leaf is not after.steps or leaf.ndim > bodies, after)
    return jax.tree.map(
        lambda leaf, is_in: jnp.moveaxis(leaf, -1, 0) if is_in else leaf, after, in_lanes
    ), in_lanes


def _as_lanes(
    size: int, batch: tuple[int, ...], leaf: Array, is_batched: bool, own: int | None
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
