"""What an agent can observe and do: discrete sets, integer vectors, real boxes."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jax import Array

LARGEST_INDEX = 2**31 - 1  # arrays are indexed with 32 bits


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
class Box:
    """Real arrays of a shape, between two bounds."""

    low: float
    high: float
    shape: tuple[int, ...]

    def contains(self, value: Array) -> Array:
        """Whether each array along the last axes is in the space."""
        axes = tuple(range(-len(self.shape), 0))
        return ((value >= self.low) & (value <= self.high)).all(axes)


Space = Discrete | MultiDiscrete | Box
