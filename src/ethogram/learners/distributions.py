"""Actions drawn by what a learner makes of them, and the logarithms of their probabilities."""

import math

import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float, Int, Key, UInt32

from ethogram.core.settings import Number

HALF = 16  # bits of a random word that decide whether to explore; the others choose
HALF_LOG_TWO_PI = 0.5 * math.log(2 * math.pi)


def epsilon_greedy(
    values: Float[Array, "actions agent"],
    bits: UInt32[Array, "agent"],
    epsilon: Number,
) -> Int[Array, "agent"]:
    """Explore with chance epsilon, else take an action of the highest value; ties at random.

    Where a value is no number none is the highest, and any action is taken.

    One random word per agent does both: its upper half decides whether to explore (so that
    chances are multiples of 2^-16), its lower half picks one of the candidates.
    """
    threshold = jnp.round(jnp.asarray(epsilon) * 2**HALF).astype(jnp.uint32)
    exploring = (bits >> HALF) < threshold
    candidate = exploring | ~(values < values.max(0))
    position = jnp.cumsum(candidate.astype(jnp.uint32), 0)
    pick = ((bits & (2**HALF - 1)) * position[-1]) >> HALF
    return (position <= pick).sum(0).astype(jnp.int32)


def gumbel_softmax(
    key: Key[Array, ""] | None,
    logits: Float[Array, "*batch choice"],
    temperature: Number,
    *,
    straight_through: bool = False,
) -> Float[Array, "*batch choice"]:
    """Weights of choices, of which each is the heaviest with the chance that softmax gives it.

    softmax((logits + g) / temperature) with g of the standard Gumbel distribution (Jang et al.,
    ICLR 2017; Maddison et al., ICLR 2017), differentiable in the logits; without a key, g = 0.
    Where logits are not finite, as in a learner that has diverged, one choice has all the weight.

    Args:
        key: consumed.
        logits: large and negative for a choice that there is not.
        temperature: the lower, the nearer to one-hot.
        straight_through: give the heaviest choice all the weight, with the gradients of the
            weights that it would have had.

    """
    if key is not None:
        logits = logits + jax.random.gumbel(key, logits.shape)
    weights = jax.nn.softmax(logits / temperature)
    largest = jnp.nan_to_num(logits, nan=0.0, neginf=0.0).argmax(-1)
    choice = jax.nn.one_hot(largest, weights.shape[-1], dtype=weights.dtype)
    weights = jnp.where(jnp.isnan(weights).any(-1, keepdims=True), choice, weights)
    if not straight_through:
        return weights
    heaviest = jax.nn.one_hot(weights.argmax(-1), weights.shape[-1])
    return weights + lax.stop_gradient(heaviest - weights)


def categorical_log_prob(
    logits: Float[Array, "*batch choice"], choice: Int[Array, "*batch"]
) -> Float[Array, "*batch"]:
    """The logarithm of the probability that softmax gives to a choice."""
    chosen = jax.nn.one_hot(choice, logits.shape[-1], dtype=bool)
    return jnp.where(chosen, jax.nn.log_softmax(logits), 0.0).sum(-1)


def categorical_entropy(logits: Float[Array, "*batch choice"]) -> Float[Array, "*batch"]:
    """The entropy of the choice that softmax makes: -sum p log p, in nats."""
    return -(jax.nn.softmax(logits) * jax.nn.log_softmax(logits)).sum(-1)


def categorical_kl(
    logits: Float[Array, "*batch choice"], other: Float[Array, "*batch choice"]
) -> Float[Array, "*batch"]:
    """The Kullback-Leibler divergence of choices: sum p (log p - log q)."""
    difference = jax.nn.log_softmax(logits) - jax.nn.log_softmax(other)
    return (jax.nn.softmax(logits) * difference).sum(-1)


def gaussian_log_prob(
    mean: Float[Array, "..."], log_std: Float[Array, "..."], value: Float[Array, "..."]
) -> Float[Array, "..."]:
    """The log-density of a number: -((x - mu) / sigma)^2 / 2 - log(sigma sqrt(2 pi))."""
    return -0.5 * jnp.square((value - mean) * jnp.exp(-log_std)) - log_std - HALF_LOG_TWO_PI


def gaussian_entropy(log_std: Float[Array, "..."]) -> Float[Array, "..."]:
    """The entropy of a Gaussian number: log(sigma sqrt(2 pi e)), in nats."""
    return log_std + HALF_LOG_TWO_PI + 0.5


def gaussian_kl(
    mean: Float[Array, "..."],
    log_std: Float[Array, "..."],
    other_mean: Float[Array, "..."],
    other_log_std: Float[Array, "..."],
) -> Float[Array, "..."]:
    """The Kullback-Leibler divergence of Gaussian numbers, from another Gaussian."""
    variance = jnp.exp(2 * (log_std - other_log_std))
    shift = jnp.square((mean - other_mean) * jnp.exp(-other_log_std))
    return other_log_std - log_std + 0.5 * (variance + shift - 1)
