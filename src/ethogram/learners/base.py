"""The interface of every learner, and of independent trials of one.

    state = learner.init(key)
    state, metrics = learner.update(key, state)
    action = learner.policy(state, explore=True)(key, observation)

A learner is built for one world, or one fitness function, that its caller gives it, and is one
trial.  `Trials` has the same interface for many, whose arrays have the trials as leading axis.

Metrics are a dict of arrays, or of arrays per role.  Every learner has `episode_return` among them:
per role, Float[..., episode, agent], the reward, not discounted, that each agent earned in each of
the episodes that the update played, from its start to its end.  A learner that knows a fitness and
no world gives that of its best individual, Float[...].
"""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import equinox as eqx
import jax
from jax import Array, lax
from jaxtyping import Key, PyTree

from ethogram.core.module import Module
from ethogram.core.rollout import Policy
from ethogram.core.spaces import Box, Discrete, MultiDiscrete, Simplex
from ethogram.core.world import PerRole

LearnerState: TypeAlias = PyTree[Array]  # what a learner has learned so far: arrays only
Metrics: TypeAlias = dict[str, Any]  # arrays, or arrays per role


class Spaces(NamedTuple):
    """Kinds of spaces that a learner can use, in its attribute `spaces`; unless it says, all."""

    observation: tuple[type, ...] = (Discrete, MultiDiscrete, Simplex, Box)
    action: tuple[type, ...] = (Discrete, MultiDiscrete, Simplex, Box)


@runtime_checkable
class Learner(Protocol):
    """What everybody may ask of a learner.

    A learner some of whose metrics may be undefined, such as the mean over no finished episode,
    names them in an attribute `undefined_metrics: frozenset[str]`.  Where undefined they are NaN,
    and only there; infinite ones always mean that the learner has diverged.
    """

    def init(self, key: Key[Array, "..."]) -> LearnerState:
        """The state before the first update.

        Args:
            key: consumed.

        Raises:
            EthogramError: the learner cannot act in its world; the message names the space.
            TooLarge: the state would not fit in memory; the message names the size.

        """

    def update(self, key: Key[Array, "..."], state: Any) -> tuple[Any, Metrics]:
        """Learn once.

        Args:
            key: consumed.
            state: arrays of the same shapes as those of `init`; donate them, as `train` does.

        Returns:
            The state after, and metrics, `episode_return` among them.

        """

    def policy(self, state: Any, *, explore: bool = False) -> Policy:
        """How to act by what was learned: `(key, observation) -> action` in one world.

        Args:
            state: the learner's.
            explore: whether to act as in training, or as well as it is known.

        """


class Trials(Module):
    """Independent trials of a learner, with the interface of a learner.

    Keys, states, metrics, observations and actions have the trials as their leading axis.  The
    numbers of a trial depend on its own key alone.
    """

    learner: Learner
    in_turn: bool = eqx.field(static=True, default=False)  # by `lax.map`; else side by side

    @property
    def undefined_metrics(self) -> frozenset[str]:
        """The learner's."""
        return undefined_metrics(self.learner)

    @property
    def spaces(self) -> "Spaces":
        """The learner's."""
        return getattr(self.learner, "spaces", Spaces())

    def init(self, key: Key[Array, "trial"]) -> LearnerState:
        """The states before the first update."""
        return self._of_each(self.learner.init)(key)

    def update(self, key: Key[Array, "trial"], state: Any) -> tuple[Any, Metrics]:
        """Learn once in every trial."""
        return self._of_each(self.learner.update)(key, state)

    def policy(self, state: Any, *, explore: bool = False) -> Policy:
        """Act in a world per trial, each by what was learned in its own."""

        def act(state: Any, key: Key[Array, ""], observation: PerRole) -> PerRole:
            return self.learner.policy(state, explore=explore)(key, observation)

        def act_in_all(key: Key[Array, "trial"], observation: PerRole) -> PerRole:
            return self._of_each(act)(state, key, observation)

        return act_in_all

    def _of_each(self, function: Callable[..., Any]) -> Callable[..., Any]:
        if self.in_turn:
            return lambda *arguments: lax.map(lambda of_one: function(*of_one), arguments)
        return jax.vmap(function)


def undefined_metrics(learner: Any) -> frozenset[str]:
    """Names of the metrics that may be NaN where they are undefined; none unless declared."""
    return getattr(learner, "undefined_metrics", frozenset())
