"""Episodes played side by side by one policy, and what each agent earned in them."""

import dataclasses
from collections.abc import Callable, Iterable

import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Key

from ethogram.core.rollout import Policy, PolicyWithExtras, rollout
from ethogram.core.world import PerRole, Transition, World


def role_keys(roles: Iterable[str], key: Key[Array, ""]) -> dict[str, Key[Array, ""]]:
    """A random key for each role, by the role's number in the order of the world's."""
    return {role: jax.random.fold_in(key, number) for number, role in enumerate(roles)}


def play_episodes(
    world: World,
    policy: Policy | PolicyWithExtras,
    key: Key[Array, ""],
    episodes: int,
    *,
    keep: Callable[[Transition], Transition] = lambda transition: transition,
) -> Transition:
    """Transitions of some episodes: arrays have the episodes and then the steps as leading axes.

    Each takes the world's `horizon` of steps; one that ends before is followed by another.

    Args:
        world: any world.
        policy: as `rollout` takes it.
        key: consumed.
        episodes: how many, side by side.
        keep: a transition with what of it is stored; all of it, unless a function says what.

    """

    def play(key: Key[Array, ""]) -> Transition:
        transitions: Transition = rollout(world, policy, key, world.horizon, keep=keep)[1]
        return transitions

    return jax.vmap(play)(jax.random.split(key, episodes))


def in_first_episode(transitions: Transition) -> PerRole:
    """Which steps each agent took before its first episode ended, that step included.

    Args:
        transitions: arrays with axes of batches, then of steps.

    Returns:
        Bool[*batch, step, agent] per role.

    """
    outcome, found = transitions.outcome, {}
    for role in outcome.terminated:
        ended = outcome.terminated[role] | outcome.truncated[role]
        found[role] = jnp.cumsum(ended, axis=-2) - ended == 0
    return found


def learned_steps(transitions: Transition) -> PerRole:
    """Which steps of its first episode each agent learns from: those in which it was acting.

    Args:
        transitions: arrays with axes of batches, then of steps.

    Returns:
        Bool[*batch, step, agent] per role.

    """
    acting = transitions.outcome.acting
    return {role: steps & acting[role] for role, steps in in_first_episode(transitions).items()}


def acting_steps(transitions: Transition) -> PerRole:
    """Which steps of all its episodes each agent learns from: until its own end it was acting.

    `learned_steps` with those of the episodes that followed the first.

    Args:
        transitions: arrays with an axis of a batch, then one of steps.

    Returns:
        Bool[batch, step, agent] per role.

    """
    outcome, found = transitions.outcome, {}

    def advance(
        is_out: Bool[Array, "batch agent"], step: tuple[Array, Array]
    ) -> tuple[Array, Array]:
        own_end, episode_end = step
        return (is_out | own_end) & ~episode_end[:, None], ~is_out

    for role, acting in outcome.acting.items():
        own_end = outcome.terminated[role] | outcome.truncated[role]
        steps = own_end.swapaxes(0, 1), transitions.episode_end.swapaxes(0, 1)
        still_in = lax.scan(advance, jnp.zeros_like(acting[:, 0]), steps)[1]
        found[role] = still_in.swapaxes(0, 1) & acting
    return found


def episode_returns(transitions: Transition) -> PerRole:
    """What each agent earned in its first episode, not discounted: Float[*batch, agent] per role.

    Args:
        transitions: arrays with axes of batches, then of steps.

    """
    counted = in_first_episode(transitions)
    returns = {}
    for role, reward in transitions.outcome.reward.items():
        some = jnp.where(counted[role], reward, 0.0).sum(-2)  # XLA adds these in another order
        returns[role] = jnp.where(counted[role].all(-2), reward.sum(-2), some)
    return returns


def episode_sums(transitions: Transition) -> dict[str, Array]:
    """The world's metrics, each summed over the steps of the first episode: Num[*batch, ...].

    Args:
        transitions: arrays with axes of batches, then of steps.

    """
    ends = transitions.episode_end
    counted = jnp.cumsum(ends, -1) - ends == 0

    def total(values: Array) -> Array:
        mask = counted.reshape(counted.shape + (1,) * (values.ndim - counted.ndim))
        return jnp.where(mask, values, 0).sum(counted.ndim - 1)

    return {name: total(values) for name, values in transitions.outcome.metrics.items()}


def returns_of_policy(world: World, policy: Policy, key: Key[Array, "episode"]) -> PerRole:
    """What each agent earns in whole episodes, not discounted: Float[episode, agent] per role.

    Args:
        world: any world.
        policy: `policy(key, observation) -> action`, per role.
        key: one per episode, consumed; the same key gives the same episode.

    """
    return episode_returns(rewards_of_policy(world, policy, key))


def rewards_of_policy(
    world: World, policy: Policy | PolicyWithExtras, key: Key[Array, "episode"]
) -> Transition:
    """Whole episodes of which rewards, ends and the policy's extras are kept.

    Args:
        world: any world.
        policy: as `rollout` takes it.
        key: one per episode, consumed; the same key gives the same episode.

    """

    def play(key: Key[Array, ""]) -> Transition:
        kept: Transition = rollout(world, policy, key, world.horizon, keep=_rewards)[1]
        return kept

    return jax.vmap(play)(key)


def _rewards(transition: Transition) -> Transition:
    """What returns are made of."""
    outcome = dataclasses.replace(transition.outcome, observation={}, metrics={})
    return dataclasses.replace(
        transition, state=None, next_state=None, observation={}, action={}, outcome=outcome
    )
