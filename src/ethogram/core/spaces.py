"""What an agent can observe and do: discrete sets, integer vectors, weights, real boxes.

A space may be wider than what its world uses, so that settings that change a width share one
compiled program.  Then `used` tells which entries there are; the others are padding, always 0.
"""

from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np
from jax import Array

from ethogram.core.settings import Number

LARGEST_INDEX = 2**31 - 1  # arrays are indexed with 32 bits
ROUNDING = 1e-4  # by how much a sum of 32-bit weights may miss 1


@dataclass(frozen=True)
class Discrete:
    """The integers 0 to n - 1."""

    n: int

    @property
    def shape(self) -> tuple[int, ...]:
        """A single number."""
        return ()

    def contains(self, value: Array) -> Array:
        """Whether each number of an integer array is in the space."""
        return (value >= 0) & (value < self.n)


@dataclass(frozen=True)
class MultiDiscrete:
    """Integer vectors; entry i is one of 0 to sizes[i] - 1."""

    sizes: tuple[int, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """A vector with one entry per size."""
        return (len(self.sizes),)

    def contains(self, value: Array) -> Array:
        """Whether each vector along the last axis is in the space."""
        return ((value >= 0) & (value < jnp.asarray(np.asarray(self.sizes)))).all(-1)


@dataclass(frozen=True)
class Simplex:
    """Weights of n choices: none negative, 1 together; a pure choice is a one-hot vector."""

    n: int
    used: Array | None = field(default=None, compare=False)  # Bool[n]

    @property
    def shape(self) -> tuple[int, ...]:
        """A vector with one weight per choice."""
        return (self.n,)

    def contains(self, value: Array) -> Array:
        """Whether each vector along the last axis is in the space, up to rounding."""
        whole = jnp.abs(value.sum(-1) - 1) <= ROUNDING
        return (value >= 0).all(-1) & whole & _padding_is_zero(value, self.used).all(-1)


@dataclass(frozen=True)
class Box:
    """Real arrays of a shape, between two bounds; arrays where these are swept."""

    low: Number
    high: Number
    shape: tuple[int, ...]
    used: Array | None = field(default=None, compare=False)  # Bool[shape]

    def contains(self, value: Array) -> Array:
        """Whether each array along the last axes is in the space."""
        axes = tuple(range(-len(self.shape), 0))
        within = (value >= self.low) & (value <= self.high)
        return (within & _padding_is_zero(value, self.used)).all(axes)


def _padding_is_zero(value: Array, used: Array | None) -> Array:
    return jnp.ones(value.shape, bool) if used is None else used | (value == 0)


Space = Discrete | MultiDiscrete | Simplex | Box
