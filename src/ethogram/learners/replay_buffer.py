"""A replay buffer: transitions in rows of 32-bit words, of one array.

A minibatch is one gather, and adding is one copy in place.  Of a transition the buffer keeps the
world's state, the action and the key of the world's chance, and computes again what was observed,
earned and reached when the transition is drawn; or it keeps all of that, where that is smaller.
"""

from functools import cached_property
from math import prod
from typing import Any, Generic, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Int, Key, UInt32

from ethogram.core.errors import EthogramError
from ethogram.core.spaces import Discrete, MultiDiscrete, Space
from ethogram.core.specs import array_spec, key_spec, role_specs, state_spec
from ethogram.core.world import PerRole, Transition, World

T = TypeVar("T")


class ReplayBuffer(eqx.Module):
    """The transitions kept; when full, each new one takes the place of the oldest."""

    rows: UInt32[Array, "capacity word"]
    added: Int[Array, ""]  # ever, also those that are gone

    @classmethod
    def empty(cls, row_width: int, capacity: int) -> "ReplayBuffer":
        """Room for `capacity` transitions of so many words each."""
        return cls(jnp.zeros((capacity, row_width), jnp.uint32), jnp.int32(0))

    def add(self, rows: UInt32[Array, "new word"]) -> "ReplayBuffer":
        """Keep some transitions; at most as many as there is room for."""
        capacity = len(self.rows)
        first, full = self.added % capacity, self.added >= capacity
        at = (first + jnp.arange(len(rows))) % capacity
        # once full, the count goes around with the places, so that it never overflows
        added = first + len(rows)
        added = jnp.where(full, capacity + added % capacity, added)
        return ReplayBuffer(self.rows.at[at].set(rows, unique_indices=True), added)

    def draw(self, key: Key[Array, ""], count: int) -> UInt32[Array, "count word"]:
        """Pick transitions uniformly, with replacement."""
        filled = jnp.minimum(self.added, len(self.rows))
        return self.rows[jax.random.randint(key, (count,), 0, filled)]


class Experience(NamedTuple):
    """What learners need of transitions: per role, arrays whose last axes are the role's own."""

    observation: PerRole
    action: PerRole
    reward: PerRole  # Float[..., agent]
    terminated: PerRole  # Bool[..., agent]
    acting: PerRole  # Bool[..., agent]
    next_observation: PerRole

    @classmethod
    def of(cls, transitions: Transition) -> "Experience":
        """That of transitions as `rollout` returns them."""
        outcome = transitions.outcome
        return cls(
            transitions.observation,
            transitions.action,
            outcome.reward,
            outcome.terminated,
            outcome.acting,
            outcome.observation,
        )


class TransitionLayout:
    """How a world's transitions stand in rows."""

    def __init__(self, world: World) -> None:
        """Take the smaller of the two: states, from which the rest follows, or the rest."""
        roles = role_specs(world)
        observation = {name: _spec(role.observation, role.agents) for name, role in roles.items()}
        action = {name: _spec(role.action, role.agents) for name, role in roles.items()}
        reward, flag = (
            {name: array_spec((role.agents,), kind) for name, role in roles.items()}
            for kind in (jnp.float32, jnp.bool_)
        )
        self._world = world
        self._states = Layout((state_spec(world), action, key_spec()))
        self._whole = Layout(Experience(observation, action, reward, flag, flag, observation))

    @property
    def keeps_states(self) -> bool:
        """Whether states are kept, and the rest is computed again."""
        return self._states.row_width <= self._whole.row_width

    @property
    def row_width(self) -> int:
        """Words of 4 bytes per row."""
        return min(self._states.row_width, self._whole.row_width)

    def pack(self, transitions: Transition) -> UInt32[Array, "*batch word"]:
        """Rows of transitions."""
        if self.keeps_states:
            return self._states.pack((transitions.state, transitions.action, transitions.key))
        return self._whole.pack(Experience.of(transitions))

    def unpack(self, rows: UInt32[Array, "batch word"]) -> Experience:
        """What was packed, or what follows from it."""
        if not self.keeps_states:
            return self._whole.unpack(rows)
        state, action, key = self._states.unpack(rows)
        _, outcome = jax.vmap(self._world.step)(key, state, action)
        return Experience(
            jax.vmap(self._world.observe)(state),
            action,
            outcome.reward,
            outcome.terminated,
            outcome.acting,
            outcome.observation,
        )


class Layout(Generic[T]):
    """How a tree of arrays stands in a row of 32-bit words.  Booleans take a word each."""

    def __init__(self, like: T) -> None:
        """Take the shapes and types from `like`, arrays or `jax.eval_shape`'s answers."""
        leaves, self._structure = jax.tree.flatten(like)
        self._shapes = [leaf.shape for leaf in leaves]
        self._types = [leaf.dtype for leaf in leaves]
        for path, leaf in jax.tree_util.tree_leaves_with_path(like):
            if not (_is_key(leaf.dtype) or _is_bool(leaf.dtype) or leaf.dtype.itemsize == 4):
                name = jax.tree_util.keystr(path, simple=True, separator=".")
                raise EthogramError(
                    f"A replay buffer cannot keep {name} of type {leaf.dtype}; allowed: numbers of "
                    "32 bits, truth values and random keys."
                )

    @cached_property
    def row_width(self) -> int:
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


def _spec(space: Space, agents: int) -> Any:
    kind = jnp.int32 if isinstance(space, Discrete | MultiDiscrete) else jnp.float32
    return array_spec((agents, *space.shape), kind)


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
