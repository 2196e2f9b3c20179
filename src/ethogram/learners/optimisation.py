"""Descent on networks: Adam, on gradients that are clipped array by array or as a whole."""

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


def descend(network: N, gradient: N, moments: Moments, rate: Number) -> tuple[N, Moments]:
    """One step of Adam (Kingma & Ba, ICLR 2015).

    Args:
        network: what is to improve.
        gradient: of its loss.
        moments: of earlier gradients.
        rate: of learning.

    """
    direction, moments = ADAM.update(gradient, moments)
    return jax.tree.map(lambda w, d: w - rate * d, network, direction), moments


def clip_each_norm(gradient: N, largest: Number) -> N:
    """Scale each array down to a Euclidean norm, unless it is smaller."""
    return jax.tree.map(lambda array: _scaled_down(array, _norm(array), largest), gradient)


def clip_global_norm(gradient: N, largest: Number) -> N:
    """Scale all arrays down together to a Euclidean norm, unless it is smaller."""
    norm = jnp.sqrt(sum(jnp.square(array).sum() for array in jax.tree.leaves(gradient)))
    return jax.tree.map(lambda array: _scaled_down(array, norm, largest), gradient)


def _norm(array: Float[Array, "..."]) -> Float[Array, ""]:
    return jnp.sqrt(jnp.square(array).sum())


def _scaled_down(
    array: Float[Array, "..."], norm: Float[Array, ""], largest: Number
) -> Float[Array, "..."]:
    return array * jnp.minimum(1.0, largest / jnp.maximum(norm, SMALL))
