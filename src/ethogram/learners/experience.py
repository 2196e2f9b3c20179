"""What was played, as a policy learns from it: choices, advantages, and targets of values."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float

from ethogram.core.settings import Number
from ethogram.core.world import PerRole, Transition
from ethogram.learners.returns import generalized_advantage, running_return
from ethogram.learners.running_statistics import RunningStatistics


class Choice(NamedTuple):
    """What was chosen and expected, beside the action; Float[agent, ...] per role."""

    drawn: PerRole  # what became the action
    outputs: PerRole  # of the actors
    value: PerRole
    next_value: PerRole | None = None  # of what was observed then


class Experience(NamedTuple):
    """What a role learns from; the steps of all episodes are one axis."""

    drawn: Array
    outputs: Float[Array, "step agent output"]
    value: Float[Array, "step agent"]
    advantage: Float[Array, "step agent"]
    target: Float[Array, "step agent"]  # of the value
    counted: Bool[Array, "step agent"]


class Estimation(NamedTuple):
    """How advantages are estimated."""

    discount: Number  # gamma
    gae_lambda: Number
    fragment_steps: int  # after so many, the critic says how it goes on; 0 for never


def experience(
    role: str,
    running: RunningStatistics | None,
    played: Transition,
    acting: Bool[Array, "episode step agent"],
    how: Estimation,
) -> Experience:
    """Advantages of what a role did, and what goes with them.

    Args:
        role: whose.
        running: of returns, by whose deviation rewards are divided, if there are any.
        played: episodes side by side, with `Choice` as extras.
        acting: which steps count.
        how: settings.

    """
    outcome, choice = played.outcome, played.extras
    reward, value = outcome.reward[role], choice.value[role]
    if running is not None:
        reward = reward / running.deviation
    cut = outcome.truncated[role] | played.episode_end[..., None]
    if how.fragment_steps:
        steps = jnp.arange(1, cut.shape[1] + 1)
        cut |= (steps % how.fragment_steps == 0)[:, None]
    advantage = jax.vmap(generalized_advantage, (0,) * 6 + (None,) * 2)(
        reward,
        value,
        choice.next_value[role],
        outcome.terminated[role],
        cut,
        acting,
        how.discount,
        how.gae_lambda,
    )
    target = advantage + value
    parts = choice.drawn[role], choice.outputs[role], value, advantage, target, acting
    return Experience(*map(rows, parts))


def returns_so_far(role: str, played: Transition, discount: Number) -> Float[Array, "step agent"]:
    """Discounted returns up to each step, which start anew with every episode."""
    outcome = played.outcome
    ended = outcome.terminated[role] | outcome.truncated[role] | played.episode_end[..., None]
    return rows(jax.vmap(running_return, (0, 0, None))(outcome.reward[role], ended, discount))


def rows(values: Array) -> Array:
    """Steps of all episodes below each other: from axes of episodes and steps, one."""
    return values.reshape(-1, *values.shape[2:])
