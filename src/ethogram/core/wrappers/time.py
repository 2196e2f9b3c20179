"""Worlds with another time: shorter episodes, slower decisions."""

import dataclasses
from typing import Annotated, Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Int, Key
from pydantic import Field

from ethogram.core.keys import branch
from ethogram.core.rollout import episode_ended
from ethogram.core.settings import setting
from ethogram.core.world import Outcome, PerRole
from ethogram.core.wrappers.base import Wrapper


class TimedState(eqx.Module):
    """A state of the other world, and the steps since the start."""

    inner: Any
    time: Int[Array, ""]


class TimeLimit(Wrapper):
    """A world whose episodes are cut after so many steps."""

    steps: int = setting(100, Annotated[int, Field(ge=1)], static=True)

    @property
    def horizon(self) -> int:
        """Steps, or fewer if the other world's are fewer."""
        return min(self.steps, self.world.horizon)

    def reset(self, key: Key[Array, ""]) -> tuple[TimedState, PerRole]:
        """As the other world."""
        state, observation = self.world.reset(key)
        return TimedState(state, jnp.int32(0)), observation

    def observe(self, state: TimedState) -> PerRole:
        """As the other world."""
        return self.world.observe(state.inner)

    def step(
        self, key: Key[Array, ""], state: TimedState, action: PerRole
    ) -> tuple[TimedState, Outcome]:
        """As the other world; who has not terminated is truncated when time is up."""
        inner, outcome = self.world.step(key, state.inner, action)
        after = TimedState(inner, state.time + 1)
        is_late = after.time >= self.steps
        truncated = {
            role: cut | (is_late & ~outcome.terminated[role])
            for role, cut in outcome.truncated.items()
        }
        return after, dataclasses.replace(outcome, truncated=truncated)

    def inner_state(self, state: TimedState) -> Any:
        """The other world's."""
        return state.inner


class RepeatAction(Wrapper):
    """A world in which every action is taken for some steps, whose rewards add up.

    The steps end with the episode.  An agent is `acting` if it was in any of them; metrics are
    those of the last one.
    """

    times: int = setting(4, Annotated[int, Field(ge=1)], static=True)

    @property
    def horizon(self) -> int:
        """The other world's steps, by the number of them in a step here."""
        return -(-self.world.horizon // self.times)

    def step(self, key: Key[Array, ""], state: Any, action: PerRole) -> tuple[Any, Outcome]:
        """Take some steps."""
        after, outcome = self.world.step(branch(key, 0), state, action)
        reward = {role: earned.astype(float) for role, earned in outcome.reward.items()}
        first = after, dataclasses.replace(outcome, reward=reward)

        def again(at: tuple[Any, Outcome], number: Int[Array, ""]) -> tuple[Any, None]:
            state, so_far = at
            after, outcome = self.world.step(branch(key, number), state, action)
            is_over = episode_ended(so_far)
            further = after, _added(so_far, outcome)
            return jax.tree.map(lambda new, old: jnp.where(is_over, old, new), further, at), None

        (state, outcome), _ = lax.scan(again, first, jnp.arange(1, self.times))
        return state, outcome


def _added(so_far: Outcome, outcome: Outcome) -> Outcome:
    """Two steps as one; who has ended earns no more."""
    over = {role: so_far.terminated[role] | so_far.truncated[role] for role in so_far.terminated}
    return Outcome(
        observation=outcome.observation,
        reward={
            role: so_far.reward[role] + jnp.where(over[role], 0.0, reward)
            for role, reward in outcome.reward.items()
        },
        terminated={
            role: so_far.terminated[role] | (ended & ~over[role])
            for role, ended in outcome.terminated.items()
        },
        truncated={
            role: so_far.truncated[role] | (cut & ~over[role])
            for role, cut in outcome.truncated.items()
        },
        metrics=outcome.metrics,
        acting={role: so_far.acting[role] | acts for role, acts in outcome.acting.items()},
    )
