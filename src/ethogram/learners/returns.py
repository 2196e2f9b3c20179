"""Targets for critics, and returns of episodes."""

import jax.numpy as jnp
from jax import Array
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
