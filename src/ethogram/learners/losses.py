"""Losses that learners minimise, over those steps of a minibatch that count.

Values and outputs of networks come in, a number comes out; which network is differentiated is the
learner's choice.  A step counts if the agent was acting in it.
"""

import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float

from ethogram.core.settings import Number


def critic_loss(
    value: Float[Array, "batch"], target: Float[Array, "batch"], counted: Bool[Array, "batch"]
) -> Float[Array, ""]:
    """The mean squared error of values: E_D (Q - y)^2.

    Args:
        value: what the critic says.
        target: y, such as `ethogram.learners.returns.td_target` gives it.
        counted: which steps count.

    """
    return masked_mean(jnp.square(value - target), counted)  # Lowe et al. (2017), eq. 6


def deterministic_policy_loss(
    value: Float[Array, "batch"],
    outputs: Float[Array, "batch output"],
    counted: Bool[Array, "batch"],
    used: Bool[Array, "output"],
    penalty: Number,
) -> Float[Array, ""]:
    """Minus the value of what an actor does, and a penalty on large outputs.

    Its gradient is the deterministic policy gradient, E_D grad mu(o) grad_a Q(o, a) at a = mu(o),
    if the value is differentiable in the action.

    Args:
        value: what the critic says of the actor's action.
        outputs: of the actor, from which the action was made.
        counted: which steps count.
        used: which outputs count; the others are padding.
        penalty: lambda, of the mean square of the outputs.

    """
    square = masked_mean(jnp.square(outputs), used & counted[:, None])
    return -masked_mean(value, counted) + penalty * square  # Lowe et al. (2017), eq. 5


def masked_mean(values: Float[Array, "*batch"], counted: Bool[Array, "*batch"]) -> Float[Array, ""]:
    """The mean of those values that count; 0 if there are none."""
    return jnp.where(counted, values, 0.0).sum() / jnp.maximum(counted.sum(), 1)
