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


def clipped_surrogate(
    ratio: Float[Array, "*batch"], advantage: Float[Array, "*batch"], clip: Number
) -> Float[Array, "*batch"]:
    """What proximal policy optimisation maximises in each step.

    Args:
        ratio: of the chance that the policy gives to what was done, to that by which it was done.
        advantage: of what was done.
        clip: epsilon; beyond 1 - epsilon to 1 + epsilon a ratio has nothing more to gain.

    """
    clipped = jnp.clip(ratio, 1 - clip, 1 + clip)
    return jnp.minimum(ratio * advantage, clipped * advantage)  # Schulman et al. (2017), eq. 7


def clipped_value_error(
    value: Float[Array, "*batch"],
    old_value: Float[Array, "*batch"],
    target: Float[Array, "*batch"],
    clip: Number,
) -> Float[Array, "*batch"]:
    """The squared error of values, or if that is larger, of values kept near what they were.

    It is not halved.

    Args:
        value: V.
        old_value: V before the update.
        target: of V.
        clip: by how much V may move; 0 is no limit.

    """
    reach = jnp.where(jnp.asarray(clip) > 0, clip, jnp.inf)
    near = old_value + jnp.clip(value - old_value, -reach, reach)
    return jnp.maximum(jnp.square(value - target), jnp.square(near - target))


def adapted_kl_coefficient(
    coefficient: Float[Array, "*batch"], kl: Float[Array, "*batch"], target: Number
) -> Float[Array, "*batch"]:
    """The coefficient of a penalty on the divergence of policies, after one that diverged by kl.

    Schulman et al. (2017), below eq. 8, with the thresholds and the factors of RLlib: 1.5 times as
    much above twice the target, half as much below half of it.
    """
    factor = jnp.where(kl > 2 * target, 1.5, jnp.where(kl < 0.5 * target, 0.5, 1.0))
    return coefficient * factor
