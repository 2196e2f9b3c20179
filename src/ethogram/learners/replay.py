"""A replay memory that keeps what cannot be computed again, and nothing else.

Of a transition it keeps the world's state, the action and the key of the world's chance; what
was observed, earned and reached follows from these, and is computed again when a transition is
drawn.  At four robots with 64 symbols that is less than a quarter of the memory.

All of it stands in one array of 32-bit words, a row per transition, so that a minibatch is one
gather and adding is one copy in place.
"""

from functools import cached_property
from math import prod
from typing import Any, Generic, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Int, Key, UInt32

T = TypeVar("T")


class Replay(eqx.Module):
    """The transitions kept; when full, each new one takes the place of the oldest."""

    rows: UInt32[Array, "capacity word"]
    added: Int[Array, ""]  # ever, also those that are gone

    @classmethod
    def empty(cls, layout: "Layout[Any]", capacity: int) -> "Replay":
        """Room for `capacity` transitions of a layout."""
        return cls(jnp.zeros((capacity, layout.words), jnp.uint32), jnp.int32(0))

    def add(self, rows: UInt32[Array, "new word"]) -> "Replay":
        """Keep some transitions; at most as many as there is room for."""
        capacity = len(self.rows)
        first, full = self.added % capacity, self.added >= capacity
        at = (first + jnp.arange(len(rows))) % capacity
        # once full, the count goes around with the places, so that it never overflows
        added = first + len(rows)
        added = jnp.where(full, capacity + added % capacity, added)
        return Replay(self.rows.at[at].set(rows, unique_indices=True), added)

    def draw(self, key: Key[Array, ""], count: int) -> UInt32[Array, "count word"]:
        """Pick transitions uniformly, with replacement."""
        filled = jnp.minimum(self.added, len(self.rows))
        return self.rows[jax.random.randint(key, (count,), 0, filled)]


class Layout(Generic[T]):
    """How a tree of arrays stands in a row of 32-bit words.  Booleans take a word each."""

    def __init__(self, like: T) -> None:
        """Take the shapes and types from `like`, arrays or `jax.eval_shape`'s answers."""
        leaves, self._structure = jax.tree.flatten(like)
        self._shapes = [leaf.shape for leaf in leaves]
        self._types = [leaf.dtype for leaf in leaves]

    @cached_property
    def words(self) -> int:
        """Words per row."""
        return sum(self._sizes)

    @cached_property
    def _sizes(self) -> list[int]:
        return [
            prod(shape) * (2 if _is_key(kind) else 1)
            for shape, kind in zip(self._shapes, self._types, strict=True)
        ]

    def pack(self, tree: T) -> UInt32[Array, "*batch word"]:
        """Rows of trees; the axes in front of the layout's shapes become the rows'.

        Numbers of another type than the layout's are turned into it.
        """
        leaves = jax.tree.leaves(tree)
        batch = leaves[0].shape[: leaves[0].ndim - len(self._shapes[0])]
        words = [_to_words(*each) for each in zip(leaves, self._types, strict=True)]
        return jnp.concatenate([each.reshape(*batch, -1) for each in words], -1)

    def unpack(self, rows: UInt32[Array, "*batch word"]) -> T:
        """The trees that `pack` was given."""
        leaves, start = [], 0
        for shape, kind, size in zip(self._shapes, self._types, self._sizes, strict=True):
            words = rows[..., start : start + size]
            leaves.append(_from_words(words, rows.shape[:-1] + shape, kind))
            start += size
        return jax.tree.unflatten(self._structure, leaves)


def _is_key(kind: Any) -> bool:
    return jnp.issubdtype(kind, jax.dtypes.prng_key)


def _is_bool(kind: Any) -> bool:
    return jnp.issubdtype(kind, jnp.bool_)


def _to_words(leaf: Array, kind: Any) -> UInt32[Array, "..."]:
    if _is_key(kind):
        return jax.random.key_data(leaf)
    if _is_bool(kind):
        return leaf.astype(jnp.uint32)
    return lax.bitcast_convert_type(leaf.astype(kind), jnp.uint32)


def _from_words(words: UInt32[Array, "..."], shape: tuple[int, ...], kind: Any) -> Array:
    if _is_key(kind):
        return jax.random.wrap_key_data(words.reshape(*shape, 2))
    words = words.reshape(shape)
    return words.astype(bool) if _is_bool(kind) else lax.bitcast_convert_type(words, kind)
