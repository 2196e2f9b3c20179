"""The interface of every world: one world, one step; `vmap` outside, `jit` at the edge.

Agents are an array axis and roles are the keys: a world with movers and talkers takes
`{"mover": action[n, ...], "talker": action[m, ...]}` and answers in the same shape.
"""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Key, PyTree

from ethogram.core.actions import admitting, formed, require_inside
from ethogram.core.errors import EthogramError
from ethogram.core.module import Module
from ethogram.core.scene import Scene
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
    is still worth something).  An agent is `acting` if it was in play in this step; one that was
    not, as a car that is out for a while and will come back, has nothing to learn from the step.
    All are, unless the world says otherwise.
    """

    observation: PerRole
    reward: PerRole  # Float[n] per role
    terminated: PerRole  # Bool[n] per role
    truncated: PerRole  # Bool[n] per role
    metrics: dict[str, Array] = eqx.field(default_factory=dict)
    acting: PerRole = eqx.field(default_factory=dict)  # Bool[n] per role

    def __post_init__(self) -> None:
        """Have all agents in play, unless it is said who is."""
        if not self.acting:
            self.acting = jax.tree.map(jnp.ones_like, self.terminated)


class Transition(eqx.Module):
    """A step of a rollout; in a trajectory every array has the steps as its leading axis.

    `world.step(key, state, action)` gives `next_state` and `outcome` again.
    `outcome.observation` is that of the state reached; where an episode ended there, it is its
    final observation, while the next transition's `observation` is that of the new episode.
    """

    key: Key[Array, "..."]  # the world's chance
    state: Any  # the state left
    observation: PerRole
    action: PerRole
    outcome: Outcome
    next_state: Any  # the state reached
    episode_end: Bool[Array, ""]  # whether the episode ended with this step
    extras: Any = None  # what the policy said beside the action, such as its log-probability


class World(Module):
    """A world: settings as fields, dynamics as pure functions of explicit state and key.

    Numeric settings may be arrays, so that a sweep is a `vmap`; sizes are static.  `jax.jit` takes
    `world.step` and `world.reset` as they are; the settings are then constants of the program.
    `eqx.filter_jit` takes functions of a world, whose numeric settings may change without another
    program.

    Every `step` sees actions of the right form only: an array per role, of its shape and kind of
    number, is asked for when the step is traced, which costs nothing in a compiled program.  Values
    out of a space are taken for others in it (`nearest`, of each space), so that none can spoil a
    state.  `check` refuses them, and so does every step of `ethogram.core.wrappers.Checked(world)`.
    """

    def __init_subclass__(cls, *, any_action: bool = False, **further: Any) -> None:
        """Let the step that a world defines see actions of the right form only.

        Args:
            any_action: the step sees to it itself.
            further: of the classes above.

        """
        super().__init_subclass__(**further)
        if "step" in vars(cls) and not any_action:
            cls.step = admitting(vars(cls)["step"])  # type: ignore[method-assign]

    @property
    @abstractmethod
    def roles(self) -> dict[str, Role]:
        """Per role: the number of agents and their observation and action spaces."""

    @property
    @abstractmethod
    def horizon(self) -> int:
        """The most steps that an episode can last."""

    @property
    def kernels(self) -> dict[str, str]:
        """The native kernels that may do the work of its steps, and what is asked of each."""
        return {}

    @abstractmethod
    def reset(self, key: Key[Array, ""]) -> tuple[Any, PerRole]:
        """Draw an initial state and what each agent observes in it."""

    @abstractmethod
    def observe(self, state: Any) -> PerRole:
        """What each agent observes in a state; the same as `reset` and `step` return with it."""

    @abstractmethod
    def step(self, key: Key[Array, ""], state: Any, action: PerRole) -> tuple[Any, Outcome]:
        """Apply one action per agent.

        Raises:
            InvalidAction: a role, a shape or a kind of number is not that of `roles`.

        """

    def check(self, action: PerRole) -> PerRole:
        """The action as arrays, if all of it is in the spaces of `roles`.

        Raises:
            InvalidAction: it is not; the message names role, agent and value.  Inside `jit`, where
                values are not known, it names the role, and the program raises it as it runs.

        """
        name, roles = type(self).__name__, self.roles
        return require_inside(name, roles, formed(name, roles, action))

    def scene(self, trajectory: Transition) -> Scene:
        """What the first episode of a rollout looked like, as plain data.

        A world that can be shown has a method of its own for it, which begins with
        `ethogram.core.rollout.first_episode`.

        Args:
            trajectory: the transitions that `rollout` returned, of one world, the steps leading.

        Raises:
            EthogramError: this world draws no scenes, or the trajectory is that of another world
                or a batch of them.

        """
        del trajectory
        raise EthogramError(f"The world {type(self).__name__} draws no scenes.")
