"""Distributions of actions, of which a stochastic policy is one per observation.

A `Discrete` action is drawn by the softmax of the outputs of a network, and so is each entry of a
`MultiDiscrete` one, independently of the others.

The others are made of numbers from a Gaussian distribution, independent of each other, whose means
are the outputs and whose deviations are parameters.  In a `Box` with bounds 0 is its middle and
-1 and 1 are its bounds, and what is beyond them is clipped, or all is squashed by tanh; a bound
that there is not, clips nothing.  Weights of a `Simplex` are the softmax of the numbers: a Gaussian
in place of a Dirichlet distribution, since it reaches pure choices, has its entropy and its
divergence in closed form, and is drawn without rejections, of which every copy in a batch would
wait for that with the most.

What is drawn (`sample`) is kept as it was before it became an action (`action_of`): the ratio of
two policies' densities is that of their Gaussians, whatever follows.  Entropy and divergence are
those of the Gaussians, too.
"""

from abc import abstractmethod
from collections.abc import Iterable

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int, Key

from ethogram.core.spaces import Box, Discrete, MultiDiscrete, Simplex, Space
from ethogram.learners.action_heads import OUT_OF_REACH
from ethogram.learners.distributions import (
    categorical_entropy,
    categorical_kl,
    categorical_log_prob,
    gaussian_entropy,
    gaussian_kl,
    gaussian_log_prob,
)
from ethogram.learners.networks import feature_count, used_features


class ActionDistribution(eqx.Module):
    """A distribution of what becomes an action, for each of a batch of observations."""

    @abstractmethod
    def sample(self, key: Key[Array, ""]) -> Array:
        """One of each; consumes the key."""

    @abstractmethod
    def mode(self) -> Array:
        """The most probable of each."""

    @abstractmethod
    def log_prob(self, drawn: Array) -> Float[Array, "*batch"]:
        """The logarithm of the probability, or of the density, of what was drawn."""

    @abstractmethod
    def entropy(self) -> Float[Array, "*batch"]:
        """The entropy, in nats."""

    @abstractmethod
    def kl(self, other: "ActionDistribution") -> Float[Array, "*batch"]:
        """The Kullback-Leibler divergence KL(self || other) from another one of the same kind."""


class Categoricals(ActionDistribution):
    """Independent choices, one or more."""

    logits: Float[Array, "*batch output"]  # those of all choices next to each other
    sizes: tuple[int, ...] = eqx.field(static=True)

    def sample(self, key: Key[Array, ""]) -> Int[Array, "*batch entry"]:
        """Choices, each drawn by its probability."""
        return self._best(self.logits + jax.random.gumbel(key, self.logits.shape))

    def mode(self) -> Int[Array, "*batch entry"]:
        """The choices with the largest logits."""
        return self._best(self.logits)

    def log_prob(self, drawn: Int[Array, "*batch entry"]) -> Float[Array, "*batch"]:
        """The logarithm of the probability of these choices."""
        entries = enumerate(self._parts(self.logits))
        return _sum(categorical_log_prob(logits, drawn[..., i]) for i, logits in entries)

    def entropy(self) -> Float[Array, "*batch"]:
        """The sum over the choices."""
        return _sum(map(categorical_entropy, self._parts(self.logits)))

    def kl(self, other: ActionDistribution) -> Float[Array, "*batch"]:
        """The sum over the choices."""
        assert isinstance(other, Categoricals)
        return _sum(map(categorical_kl, self._parts(self.logits), self._parts(other.logits)))

    def _parts(self, outputs: Float[Array, "*batch output"]) -> list[Array]:
        ends = [sum(self.sizes[: i + 1]) for i in range(len(self.sizes) - 1)]
        return jnp.split(outputs, ends, -1)

    def _best(self, outputs: Float[Array, "*batch output"]) -> Int[Array, "*batch entry"]:
        return jnp.stack([part.argmax(-1) for part in self._parts(outputs)], -1)


class DiagonalGaussian(ActionDistribution):
    """Independent Gaussian numbers."""

    mean: Float[Array, "*batch output"]
    log_std: Float[Array, "*#batch output"]
    used: Bool[Array, "output"]  # the others are padding

    def sample(self, key: Key[Array, ""]) -> Float[Array, "*batch output"]:
        """Numbers around the mean."""
        return self.mean + jnp.exp(self.log_std) * jax.random.normal(key, self.mean.shape)

    def mode(self) -> Float[Array, "*batch output"]:
        """The mean."""
        return self.mean

    def log_prob(self, drawn: Float[Array, "*batch output"]) -> Float[Array, "*batch"]:
        """The logarithm of the density of these numbers."""
        return self._total(gaussian_log_prob(self.mean, self.log_std, drawn))

    def entropy(self) -> Float[Array, "*batch"]:
        """The sum over the numbers."""
        entropy = gaussian_entropy(self.log_std)
        return self._total(jnp.broadcast_to(entropy, self.mean.shape))

    def kl(self, other: ActionDistribution) -> Float[Array, "*batch"]:
        """The sum over the numbers."""
        assert isinstance(other, DiagonalGaussian)
        return self._total(gaussian_kl(self.mean, self.log_std, other.mean, other.log_std))

    def _total(self, values: Float[Array, "*batch output"]) -> Float[Array, "*batch"]:
        return jnp.where(self.used, values, 0.0).sum(-1)


def deviation_count(space: Space) -> int:
    """How many deviations there are to learn."""
    return feature_count(space) if isinstance(space, Simplex | Box) else 0


def action_distribution(
    space: Space, outputs: Float[Array, "*batch output"], log_std: Float[Array, "*#batch number"]
) -> ActionDistribution:
    """The distribution of actions that outputs of a network stand for.

    Args:
        space: of the actions.
        outputs: logits or means.
        log_std: the logarithms of the deviations; none for choices.

    """
    match space:
        case Discrete(n):
            return Categoricals(outputs, (n,))
        case MultiDiscrete(sizes):
            return Categoricals(outputs, sizes)
        case Simplex() | Box():
            return DiagonalGaussian(outputs, log_std, used_features(space))


def action_of(space: Space, drawn: Array, *, squash: bool) -> Array:
    """The action that the world is given, of what was drawn.

    Args:
        space: of the actions.
        drawn: by a distribution of `action_distribution`; the last axis is its own.
        squash: whether boxes with both bounds are reached by tanh; else what is beyond is clipped.

    """
    match space:
        case Discrete():
            return drawn[..., 0]
        case MultiDiscrete():
            return drawn
        case Simplex():
            weights = jax.nn.softmax(jnp.where(used_features(space), drawn, OUT_OF_REACH))
            return space.nearest(weights)
        case Box():
            shaped = drawn.reshape(*drawn.shape[:-1], *space.shape)
            return space.nearest(_in_box(space, shaped, squash))


def _in_box(space: Box, drawn: Float[Array, "..."], squash: bool) -> Float[Array, "..."]:
    """Numbers of which -1 and 1 are the bounds of a box; as they are, where there are not both."""
    low, high = (jnp.asarray(bound, jnp.float32) for bound in (space.low, space.high))
    bounded = jnp.isfinite(low) & jnp.isfinite(high)
    low, high = jnp.where(bounded, low, -1.0), jnp.where(bounded, high, 1.0)
    reached = jnp.where(bounded, jnp.tanh(drawn), drawn) if squash else drawn
    return (low + high) / 2 + (high - low) / 2 * reached


def _sum(values: Iterable[Array]) -> Array:
    return jnp.stack([*values]).sum(0)
