"""What an action was worth: targets for critics, returns of episodes."""

import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float

from ethogram.core.settings import Number


def one_step(
    reward: Float[Array, "*batch"],
    terminated: Bool[Array, "*batch"],
    future: Float[Array, "*batch"],
    discount: Number,
) -> Float[Array, "*batch"]:
    """The one-step target r + gamma V(s'): nothing follows a termination, a truncation goes on."""
    return reward + discount * jnp.where(terminated, 0.0, future)


def discounted(reward: Float[Array, "time *batch"], discount: Number) -> Float[Array, "*batch"]:
    """The return sum_t gamma^t r_t over the leading axis, t from 0."""
    powers = jnp.asarray(discount) ** jnp.arange(reward.shape[0])
    return jnp.tensordot(powers, reward, 1)
