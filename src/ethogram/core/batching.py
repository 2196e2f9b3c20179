"""What keeps a batch of worlds, made by `jax.vmap`, as fast as its worlds one by one.

Reading and writing entries of a vector becomes, in a batch, that of a matrix, which XLA on a CPU
does some twenty times as slowly.  `take`, `put`, `add` and `least` read and write a batch as the
one long vector that it is in memory; `take` reads rows of a matrix, too.  Indices are never
negative; what is written beyond the end is dropped.

A condition or a loop becomes, in a batch, all branches and a choice between all that they return.
With `in_any_copy` it is asked once for the whole batch.

A function whose batches are faster otherwise than as `vmap` makes them, gets a rule of its own by
`with_vmap_rule`.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array
from jax.custom_batching import custom_vmap
from jaxtyping import Bool, Int, Shaped


@custom_vmap
def take(values: Shaped[Array, "entry *row"], index: Int[Array, "*at"]) -> Shaped[Array, "..."]:
    """The entries, or rows, at these places, all of which there must be."""
    return values.at[index].get(mode="promise_in_bounds", wrap_negative_indices=False)


@custom_vmap
def put(
    values: Shaped[Array, "entry"], index: Int[Array, "*at"], new: Shaped[Array, "*at"]
) -> Shaped[Array, "entry"]:
    """The vector with these entries replaced; of several for one place any may stay."""
    return values.at[index].set(new, mode="drop", wrap_negative_indices=False)


@custom_vmap
def add(
    values: Shaped[Array, "entry"], index: Int[Array, "*at"], amount: Shaped[Array, "*at"]
) -> Shaped[Array, "entry"]:
    """The vector with amounts added to these entries, of one place all of them."""
    return values.at[index].add(amount, mode="drop", wrap_negative_indices=False)


@custom_vmap
def least(
    values: Shaped[Array, "entry"], index: Int[Array, "*at"], bound: Shaped[Array, "*at"]
) -> Shaped[Array, "entry"]:
    """The vector with these entries lowered to a bound, of one place to the least of all."""
    return values.at[index].min(bound, mode="drop", wrap_negative_indices=False)


@take.def_vmap
def _take_in_batch(
    size: int, batched: list[bool], values: Array, index: Array
) -> tuple[Array, bool]:
    if not batched[0]:
        return take(values, index), True
    index = index if batched[1] else jnp.broadcast_to(index, (size, *index.shape))
    return take(values.reshape(-1, *values.shape[2:]), index + _first(index, values)), True


def _first(index: Array, values: Array) -> Array:
    """Where each vector of a batch begins, in the shape of an index."""
    size, length = values.shape[:2]
    return (jnp.arange(size) * length).reshape(size, *[1] * (index.ndim - 1))


def _in_batch(write: Any) -> Any:
    def rule(
        size: int, batched: list[bool], values: Array, index: Array, new: Array
    ) -> tuple[Array, bool]:
        values, index, new = (
            each if there else jnp.broadcast_to(each, (size, *each.shape))
            for each, there in zip((values, index, new), batched, strict=True)
        )
        inside = index < values.shape[1]
        index = jnp.where(inside, index + _first(index, values), values.size)
        return write(values.reshape(-1), index, new).reshape(values.shape), True

    return rule


put.def_vmap(_in_batch(put))
add.def_vmap(_in_batch(add))
least.def_vmap(_in_batch(least))


@custom_vmap
def in_any_copy(flag: Bool[Array, ""]) -> Bool[Array, ""]:
    """Whether a flag is up in any copy of a batch: one answer for all, however deep the `vmap`.

    What is done because of it is done in all copies, and must do nothing where it need not.
    """
    return flag


@in_any_copy.def_vmap
def _in_a_batch(
    size: int, batched: list[bool], flag: Bool[Array, "copy"]
) -> tuple[Bool[Array, ""], bool]:
    del size, batched
    return in_any_copy(flag.any()), False


def with_vmap_rule(
    function: Callable[..., Any],
    rule: Callable[..., Any],
    *,
    differentiated: Callable[..., Any] | None = None,
) -> Callable[..., Any]:
    """A function that `vmap` batches by a rule, and that is differentiated as it is written.

    Args:
        function: of trees of arrays.
        rule: as that of `jax.custom_batching.custom_vmap`: takes the size of the batch, for each
            argument a tree of truth values (whether an array is batched), and the arguments, with
            the batch as leading axis; returns the value and a tree of truth values.
        differentiated: the same function, written so that it can be differentiated, if `function`
            is not.

    """
    smooth = differentiated or function

    def call(*arguments: Any) -> Any:
        return function(*arguments)

    batched = custom_vmap(call)
    batched.def_vmap(rule)
    both = jax.custom_jvp(batched)
    both.defjvp(lambda primals, tangents: jax.jvp(smooth, primals, tangents))
    return both


def plain_vmap(
    function: Callable[..., Any], batched: list[Any], arguments: tuple[Any, ...]
) -> tuple[Any, Any]:
    """What a rule returns that leaves a batch to `jax.vmap`."""
    leaves, structure = jax.tree.flatten(arguments)
    axes = [0 if is_batched else None for is_batched in jax.tree.leaves(batched)]
    value = jax.vmap(lambda *each: function(*jax.tree.unflatten(structure, each)), axes)(*leaves)
    return value, jax.tree.map(lambda _: True, value)
