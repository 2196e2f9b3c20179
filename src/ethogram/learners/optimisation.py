"""Descent on networks: Adam on gradients that are clipped array by array."""

from typing import Any, TypeAlias, TypeVar

import jax
import jax.numpy as jnp
import optax
from jax import Array
from jaxtyping import Float

from ethogram.core.settings import Number

N = TypeVar("N")  # a network: any tree of arrays

Moments: TypeAlias = Any  # optax.ScaleByAdamState: what Adam remembers of earlier gradients

ADAM = optax.scale_by_adam()
SMALL = 1e-12  # a norm that counts as none


def no_moments(network: N) -> Moments:
    """Adam's memory at the beginning."""
    return ADAM.init(network)


def descend(
    network: N, gradient: N, moments: Moments, rate: Number, clip: Number
) -> tuple[N, Moments]:
    """One step of Adam (Kingma & Ba, ICLR 2015).

    Args:
        network: what is to improve.
        gradient: of its loss.
        moments: of earlier gradients.
        rate: of learning.
        clip: the norm to which each array's gradient is scaled down, if it is larger.

    """
    clipped = jax.tree.map(lambda array: clip_norm(array, clip), gradient)
    direction, moments = ADAM.update(clipped, moments)
    return jax.tree.map(lambda w, d: w - rate * d, network, direction), moments


def clip_norm(array: Float[Array, "..."], largest: Number) -> Float[Array, "..."]:
    """Scale an array down to a Euclidean norm, unless it is smaller."""
    norm = jnp.sqrt(jnp.square(array).sum())
    return array * jnp.minimum(1.0, largest / jnp.maximum(norm, SMALL))
