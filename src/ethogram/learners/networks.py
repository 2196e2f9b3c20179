"""Multi-layer perceptrons, as the actors and critics of the learners.

A network may be wider than what is used of it, so that settings that change a width share one
compiled program (`ethogram.core.spaces`).  Weights are drawn for the width that is used: padding
feeds zeros in and takes nothing out, so a padded network learns like one without padding.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from math import prod
from types import MappingProxyType

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Key

from ethogram.core.spaces import Box, Discrete, MultiDiscrete, Simplex, Space

Activation = Callable[[Array], Array]
DrawWeights = Callable[..., Array]  # (key, inputs used, outputs used, gain) -> weights of a layer

ACTIVATIONS: Mapping[str, Activation] = MappingProxyType({"relu": jax.nn.relu, "tanh": jnp.tanh})


def glorot_uniform(
    key: Key[Array, ""], inputs: Bool[Array, "in"], outputs: Bool[Array, "out"], gain: float
) -> Float[Array, "in out"]:
    """Weights that are uniform within a bound (Glorot & Bengio, 2010, eq. 16), times a gain."""
    bound = gain * jnp.sqrt(6.0 / (inputs.sum() + outputs.sum()))
    return bound * jax.random.uniform(key, (inputs.size, outputs.size), minval=-1.0, maxval=1.0)


def orthogonal(
    key: Key[Array, ""], inputs: Bool[Array, "in"], outputs: Bool[Array, "out"], gain: float
) -> Float[Array, "in out"]:
    """Weights that turn and do not stretch, but by a gain (Saxe et al., ICLR 2014); padding is 0.

    The orthogonal part of a matrix of Gaussian numbers, which has no preferred direction.
    """
    used = inputs[:, None] & outputs
    gaussian = jnp.where(used, jax.random.normal(key, used.shape), 0.0)
    left, stretch, right = jnp.linalg.svd(gaussian, full_matrices=False)
    return gain * (left * (stretch > 1e-6 * stretch[0])) @ right


class MLP(eqx.Module):
    """Dense layers with an activation between them, and none after the last."""

    weights: tuple[Float[Array, "_in _out"], ...]
    biases: tuple[Float[Array, "_out"], ...]
    activation: Activation = eqx.field(static=True, default=jax.nn.relu)

    @classmethod
    def init(
        cls,
        key: Key[Array, ""],
        inputs: Bool[Array, "in"],
        hidden: Sequence[int],
        outputs: Bool[Array, "out"],
        *,
        activation: Activation = jax.nn.relu,
        draw: DrawWeights = glorot_uniform,
        hidden_gain: float = 1.0,
        gain: float = 1.0,
    ) -> "MLP":
        """Draw weights; biases start at 0.

        Args:
            key: consumed.
            inputs: which inputs are used; their number is the width that counts.
            hidden: widths of the hidden layers.
            outputs: which outputs are used.
            activation: between the layers.
            draw: the weights of a layer, `glorot_uniform` or `orthogonal`.
            hidden_gain: of the hidden layers' weights.
            gain: of the last layer's weights.

        """
        ends = [inputs, *(jnp.ones(width, bool) for width in hidden), outputs]
        gains = [hidden_gain] * len(hidden) + [gain]
        keys = jax.random.split(key, len(gains))
        layers = zip(keys, ends[:-1], ends[1:], gains, strict=True)
        weights = tuple(draw(*layer) for layer in layers)
        return cls(weights, tuple(jnp.zeros(after.size) for after in ends[1:]), activation)

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
            x = self.activation(x) @ weight + bias
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
