"""The sizes of a world, without computing any of it: what its roles see and do, what a state holds.

They are those of every world of the same type with the same static settings and the same shapes of
its numbers, and remembered for all of them.
"""

import dataclasses
from collections.abc import Callable
from functools import cache, lru_cache
from typing import Any

import equinox as eqx
import jax
import numpy as np

from ethogram.core.spaces import Box, Simplex, Space
from ethogram.core.world import Role, World

REMEMBERED = 1000  # worlds


def role_specs(world: World) -> dict[str, Role]:
    """A world's roles; their spaces tell neither the bounds of boxes nor what is padding."""
    return dict(_remembered(_roles, world))


def state_spec(world: World) -> Any:
    """A world's state, with a `jax.ShapeDtypeStruct` in the place of every array."""
    return _remembered(_state, world)


def array_spec(shape: tuple[int, ...], kind: Any) -> Any:
    """An array of a shape and a kind of number."""
    return jax.ShapeDtypeStruct(shape, kind)  # type: ignore[no-untyped-call]


@cache
def key_spec() -> Any:
    """A random key."""
    return jax.eval_shape(jax.random.key, 0)


def _roles(world: World) -> list[tuple[str, Role]]:
    """Pairs, since dicts lose their order in JAX, and keys are dealt out in that of the roles."""
    return [
        (name, Role(role.agents, _without_arrays(role.observation), _without_arrays(role.action)))
        for name, role in world.roles.items()
    ]


def _state(world: World) -> Any:
    return world.reset(jax.random.key(0))[0]


def _without_arrays(space: Space) -> Space:
    if isinstance(space, Box):
        return Box(-np.inf, np.inf, space.shape)
    return dataclasses.replace(space, used=None) if isinstance(space, Simplex) else space


def _remembered(look: Callable[[World], Any], world: World) -> Any:
    arrays, rest = eqx.partition(world, eqx.is_array)
    leaves, structure = jax.tree.flatten(arrays)
    shapes = tuple(array_spec(leaf.shape, leaf.dtype) for leaf in leaves)
    others, remainder = jax.tree.flatten(rest)
    key = look, structure, shapes, remainder, tuple(others)
    try:
        hash(key)
    except TypeError:  # a setting, of another package's world, that cannot be looked up
        return _spec.__wrapped__(*key)
    return _spec(*key)


@lru_cache(maxsize=REMEMBERED)
def _spec(look: Any, structure: Any, shapes: Any, remainder: Any, others: Any) -> Any:
    arrays = jax.tree.unflatten(structure, shapes)
    rest = jax.tree.unflatten(remainder, others)
    return eqx.filter_eval_shape(lambda arrays: look(eqx.combine(arrays, rest)), arrays)
