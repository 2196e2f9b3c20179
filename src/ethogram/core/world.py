"""The interface of every world: one world, one step; `vmap` outside, `jit` at the edge.

Agents are an array axis and roles are the keys: a world with movers and talkers takes
`{"mover": action[n, ...], "talker": action[m, ...]}` and answers in the same shape.
"""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import equinox as eqx
from jax import Array
from jaxtyping import Bool, Key, PyTree

from ethogram.core.errors import EthogramError
from ethogram.core.scene import Scene
from ethogram.core.settings import check_settings
from ethogram.core.spaces import Space

PerRole = dict[str, Array]  # an array per role; the leading axis counts the role's agents
State = PyTree[Array]  # a world's own state: arrays only


@dataclass(frozen=True)
class Role:
    """How many agents play a role, and what each observes and does."""

    agents: int
    observation: Space
    action: Space


class Outcome(eqx.Module):
    """What a step brings each agent.

    `observation` is that of the state reached, also when the episode ends there: a world never
    resets itself.  An agent whose episode ends because of what happened is `terminated` (nothing
    follows, its future is worth 0); one that merely ran out of time is `truncated` (its future
    is still worth something).
    """

    observation: PerRole
    reward: PerRole  # Float[n] per role
    terminated: PerRole  # Bool[n] per role
    truncated: PerRole  # Bool[n] per role
    metrics: dict[str, Array] = eqx.field(default_factory=dict)


class Transition(eqx.Module):
    """A step of a rollout; in a trajectory every array has the steps as its leading axis.

    `world.step(key, before, action)` gives `state` and `outcome` again.  `outcome.observation` is
    that of the state reached; where an episode ended there, it is its final observation, while
    the next transition's `observation` is that of the new episode.
    """

    key: Key[Array, "..."]  # the world's chance
    before: Any  # the state left
    observation: PerRole
    action: PerRole
    outcome: Outcome
    state: Any  # the state reached
    last: Bool[Array, ""]  # whether the episode ended with this step


class World(eqx.Module):
    """A world: settings as fields, dynamics as pure functions of explicit state and key.

    Numeric settings may be arrays, so that a sweep is a `vmap`; sizes are static.
    """

    def __check_init__(self) -> None:
        """Refuse settings out of range, naming each (see `ethogram.core.settings`)."""
        check_settings(self)

    @property
    @abstractmethod
    def roles(self) -> dict[str, Role]:
        """Per role: the number of agents and their observation and action spaces."""

    @property
    @abstractmethod
    def horizon(self) -> int:
        """The most steps that an episode can last."""

    @abstractmethod
    def reset(self, key: Key[Array, ""]) -> tuple[Any, PerRole]:
        """Draw an initial state and what each agent observes in it."""

    @abstractmethod
    def observe(self, state: Any) -> PerRole:
        """What each agent observes in a state; the same as `reset` and `step` return with it."""

    @abstractmethod
    def step(self, key: Key[Array, ""], state: Any, action: PerRole) -> tuple[Any, Outcome]:
        """Apply one action per agent."""

    def scene(self, trajectory: Transition) -> Scene:
        """What the first episode of a rollout looked like, as plain data.

        A world that can be shown has a method of its own for it, which begins with
        `ethogram.core.rollout.first_episode`.

        Args:
            trajectory: the transitions that `rollout` returned, of one world, the steps leading.

        Raises:
            EthogramError: this world draws no scenes, or the trajectory is a batch of them.

        """
        del trajectory
        raise EthogramError(f"The world {type(self).__name__} draws no scenes.")
