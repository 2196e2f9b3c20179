"""Targets for critics, advantages of actions, and returns of episodes."""

import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float

from ethogram.core.settings import Number


def td_target(
    reward: Float[Array, "*batch"],
    terminated: Bool[Array, "*batch"],
    next_value: Float[Array, "*batch"],
    discount: Number,
) -> Float[Array, "*batch"]:
    """The one-step target r + gamma V(s'): nothing follows a termination, a truncation goes on."""
    return reward + discount * jnp.where(terminated, 0.0, next_value)


def discounted_return(
    reward: Float[Array, "time *batch"], discount: Number
) -> Float[Array, "*batch"]:
    """The return sum_t gamma^t r_t over the leading axis, t from 0."""
    powers = jnp.asarray(discount) ** jnp.arange(reward.shape[0])
    return jnp.tensordot(powers, reward, 1)


def generalized_advantage(
    reward: Float[Array, "time *batch"],
    value: Float[Array, "time *batch"],
    next_value: Float[Array, "time *batch"],
    terminated: Bool[Array, "time *batch"],
    cut: Bool[Array, "time *batch"],
    acting: Bool[Array, "time *batch"],
    discount: Number,
    gae_lambda: Number,
) -> Float[Array, "time *batch"]:
    """Generalised advantage estimates (Schulman et al., ICLR 2016).

        delta_t = r_t + gamma V(o_t+1) - V(o_t)
        A_t     = delta_t + gamma lambda A_t+1

    Nothing follows a termination.  At any other cut, as a truncation or the end of what was played,
    what follows is worth V of the observation reached.  Steps in which an agent does not act are
    passed over: its next step is the next one in which it acts, by then discounted for all the time
    between, and what it earns meanwhile counts as earned on the way there.

    Args:
        reward: r.
        value: V of what was observed before each step.
        next_value: V of what was observed after it; it counts at cuts only.
        terminated: whether nothing follows.
        cut: whether the next step belongs to something else; it does after the last.
        acting: whether the agent acts in it.
        discount: gamma.
        gae_lambda: lambda.

    Returns:
        The advantages, 0 where an agent does not act.

    """
    cut = (cut | terminated).at[-1].set(True)

    def before(
        later: tuple[Array, Array], step: tuple[Array, ...]
    ) -> tuple[tuple[Array, Array], Array]:
        reward, value, next_value, terminated, cut, acting = step
        next_value = jnp.where(cut, next_value, later[0])
        target = td_target(reward, terminated, next_value, discount)
        later_advantage = discount * jnp.where(cut, 0.0, later[1])
        advantage = target - value + gae_lambda * later_advantage  # eq. 12 and 16
        seen = jnp.where(acting, value, target), jnp.where(acting, advantage, later_advantage)
        return seen, jnp.where(acting, advantage, 0.0)

    steps = reward, value, next_value, terminated, cut, acting
    nothing = jnp.zeros_like(value[0])
    return lax.scan(before, (nothing, nothing), steps, reverse=True)[1]


def running_return(
    reward: Float[Array, "time *batch"], ended: Bool[Array, "time *batch"], discount: Number
) -> Float[Array, "time *batch"]:
    """What was earned so far in an episode, discounted backwards: g_t = r_t + gamma g_t-1.

    Args:
        reward: r.
        ended: whether an episode ended with a step; the next begins another.
        discount: gamma.

    """

    def advance(before: Array, step: tuple[Array, Array]) -> tuple[Array, Array]:
        earned = step[0] + discount * before
        return jnp.where(step[1], 0.0, earned), earned

    return lax.scan(advance, jnp.zeros_like(reward[0]), (reward, ended))[1]
