"""Multi-layer perceptrons, as the actors and critics of the learners.

A network may be wider than what is used of it, so that settings that change a width share one
compiled program (`ethogram.core.spaces`).  Weights are drawn for the width that is used: padding
feeds zeros in and takes nothing out, so a padded network learns like one without padding.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import prod

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Key

from ethogram.core.spaces import Box, Discrete, MultiDiscrete, Simplex, Space


class MLP(eqx.Module):
    """Dense layers with rectified linear units between them, and none after the last."""

    weights: tuple[Float[Array, "_in _out"], ...]
    biases: tuple[Float[Array, "_out"], ...]

    @classmethod
    def init(
        cls,
        key: Key[Array, ""],
        inputs: Bool[Array, "in"],
        hidden: Sequence[int],
        outputs: Bool[Array, "out"],
    ) -> "MLP":
        """Draw weights uniformly after Glorot & Bengio (2010); biases start at 0.

        Args:
            key: consumed.
            inputs: which inputs are used; their number is the width that counts.
            hidden: widths of the hidden layers.
            outputs: which outputs are used.

        """
        ends = [inputs, *(jnp.ones(width, bool) for width in hidden), outputs]
        weights, biases = [], []
        keys = jax.random.split(key, len(ends) - 1)
        for draw, before, after in zip(keys, ends[:-1], ends[1:], strict=True):
            bound = jnp.sqrt(6.0 / (before.sum() + after.sum()))
            shape = (before.size, after.size)
            weights.append(bound * jax.random.uniform(draw, shape, minval=-1.0, maxval=1.0))
            biases.append(jnp.zeros(after.size))
        return cls(tuple(weights), tuple(biases))

    @staticmethod
    def numbers(inputs: int, hidden: Sequence[int], outputs: int) -> int:
        """How many weights and biases a network of these widths has."""
        ends = (inputs, *hidden, outputs)
        return sum((before + 1) * after for before, after in pairwise(ends))

    def __call__(self, x: Float[Array, "*batch in"]) -> Float[Array, "*batch out"]:
        """Feed a batch through."""
        return self.from_first(x @ self.weights[0])

    def from_first(self, x: Float[Array, "*batch hidden"]) -> Float[Array, "*batch out"]:
        """Go on from the product of the inputs with the first layer's weights."""
        x = x + self.biases[0]
        for weight, bias in zip(self.weights[1:], self.biases[1:], strict=True):
            x = jax.nn.relu(x) @ weight + bias
        return x


def features(space: Space, value: Array) -> Float[Array, "*batch feature"]:
    """Numbers for a network to read: integers become one-hot vectors, arrays are flattened."""
    match space:
        case Discrete(n):
            return jax.nn.one_hot(value, n)
        case MultiDiscrete(sizes):
            parts = [jax.nn.one_hot(value[..., i], size) for i, size in enumerate(sizes)]
            return jnp.concatenate(parts, -1)
        case Simplex() | Box():
            return value.reshape(*value.shape[: value.ndim - len(space.shape)], -1)


def feature_count(space: Space) -> int:
    """How many numbers `features` makes of a value."""
    match space:
        case Discrete(n):
            return n
        case MultiDiscrete(sizes):
            return sum(sizes)
        case Simplex() | Box():
            return prod(space.shape)


def used_features(space: Space) -> Bool[Array, "feature"]:
    """Which entries of `features` can be other than zero."""
    match space:
        case Discrete(n):
            return jnp.ones(n, bool)
        case MultiDiscrete(sizes):
            return jnp.ones(sum(sizes), bool)
        case Simplex() | Box():
            return (jnp.ones(space.shape, bool) if space.used is None else space.used).reshape(-1)
