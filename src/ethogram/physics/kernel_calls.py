"""What calls of native kernels have in common: where they go, and axes of bodies."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array, lax
from jax.extend.backend import backends


def on_cpus(by_kernel: Callable[..., Any], in_jax: Callable[..., Any], *arguments: Any) -> Any:
    """What a kernel makes of its arguments on a CPU, and the same by JAX on anything else."""
    if set(backends()) == {"cpu"}:  # nothing need be traced for other platforms
        return by_kernel(*arguments)
    return lax.platform_dependent(*arguments, cpu=by_kernel, default=in_jax)


def with_bodies(function: Callable[..., Any], bodies: bool) -> Callable[..., Any]:
    """A function of one body, or, if there is an axis of bodies, of each."""
    return jax.vmap(function) if bodies else function


def more_bodies(
    each: Callable[..., Any],
    size: int,
    is_batched: list[Any],
    arguments: tuple[Any, ...],
    *,
    bodies: bool,
) -> tuple[Any, Any]:
    """What a rule of `with_vmap_rule` returns for a batch of bodies: all in one axis.

    Args:
        each: takes the arguments with bodies as first axis of all arrays.
        size: of the batch.
        is_batched: trees of truth values: which arrays have the batch as leading axis.
        arguments: of the function that is batched.
        bodies: whether, but for that of the batch, their first axis is one of bodies already.

    """

    def part(leaf: Array, leaf_is_batched: bool) -> Array:
        if not leaf_is_batched:
            leaf = jnp.broadcast_to(leaf, (size, *leaf.shape))
        return leaf.reshape(-1, *leaf.shape[2:]) if bodies else leaf

    after = each(*jax.tree.map(part, arguments, tuple(is_batched)))
    if bodies:
        after = jax.tree.map(lambda leaf: leaf.reshape(size, -1, *leaf.shape[1:]), after)
    return after, jax.tree.map(lambda _: True, after)
