"""Tables of numbers for every agent, observation and action of a world with `Discrete` spaces."""

from math import prod
from typing import TypeAlias

import jax.numpy as jnp

from ethogram.core.errors import EthogramError
from ethogram.core.spaces import Discrete
from ethogram.core.world import PerRole, World

Tables: TypeAlias = PerRole  # Float[agents, observations, actions] per role


def blank_tables(world: World, learner: str) -> Tables:
    """Zeros for every agent, observation and action.

    Args:
        world: one whose spaces are `Discrete`.
        learner: who asks, for the message.

    Raises:
        EthogramError: a role's observations or actions are not `Discrete`.

    """
    return {role: jnp.zeros(shape) for role, shape in _shapes(world, learner).items()}


def table_bytes(world: World, learner: str) -> int:
    """Memory that `blank_tables` needs; raises as it does."""
    return sum(4 * prod(shape) for shape in _shapes(world, learner).values())


def rows(tables: Tables, observation: PerRole) -> PerRole:
    """The row of each agent's table that it observes: Float[agents, actions] per role."""
    return {
        role: table[jnp.arange(len(table)), observation[role]] for role, table in tables.items()
    }


def _shapes(world: World, learner: str) -> dict[str, tuple[int, int, int]]:
    shapes = {}
    for role, played in world.roles.items():
        if not (isinstance(played.observation, Discrete) and isinstance(played.action, Discrete)):
            raise EthogramError(
                f"{learner} needs discrete spaces: {role!r} of {type(world).__name__} "
                f"observes {played.observation} and acts in {played.action}."
            )
        shapes[role] = played.agents, played.observation.n, played.action.n
    return shapes
