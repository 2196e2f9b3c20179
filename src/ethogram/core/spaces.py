"""What an agent can observe and do: discrete sets, integer vectors, weights, real boxes.

A space may be wider than what its world uses, so that settings that change a width share one
compiled program.  Then `used` tells which entries there are; the others are padding, always 0.

Of every space, `sample` draws values, `contains` tells which values are in it, and `nearest`
gives, for a value of its shape that is not, the one in it that a world takes it for.  Whole numbers
pass for real ones, real numbers never for whole ones, nor do truth values.
"""

import operator
from dataclasses import dataclass, field
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Int, Key

from ethogram.core.errors import EthogramError, shown
from ethogram.core.settings import Number

LARGEST_INDEX = 2**31 - 1  # arrays are indexed with 32 bits
ROUNDING = 1e-4  # by how much a sum of 32-bit weights may miss 1

_IN_ORDER = "The order is Box(low, high, shape), as in Box(0.0, 1.0, (3,))."

WHOLE, REAL = np.int32, float  # kinds of number


@dataclass(frozen=True)
class Discrete:
    """The integers 0 to n - 1."""

    n: int
    kind: ClassVar[Any] = WHOLE

    def __post_init__(self) -> None:
        _require_some(self, self.n)

    @property
    def shape(self) -> tuple[int, ...]:
        """A single number."""
        return ()

    def contains(self, value: Array) -> Array:
        """Whether each number of an array is in the space."""
        value = jnp.asarray(value)
        if not is_of_kind(self, value):
            return _none_of(self, value)
        return (value >= 0) & (value < self.n)

    def sample(self, key: Key[Array, ""], *batch: int) -> Int[Array, "*batch"]:
        """A number, uniform; an array of them with the axes of `batch`."""
        return jax.random.randint(key, batch, 0, self.n)

    def nearest(self, value: Array) -> Array:
        """A number below 0 counts as 0, one beyond the last as the last."""
        return jnp.clip(value, 0, self.n - 1)


@dataclass(frozen=True)
class MultiDiscrete:
    """Integer vectors; entry i is one of 0 to sizes[i] - 1."""

    sizes: tuple[int, ...]
    kind: ClassVar[Any] = WHOLE

    def __post_init__(self) -> None:
        _require_some(self, *self.sizes)

    @property
    def shape(self) -> tuple[int, ...]:
        """A vector with one entry per size."""
        return (len(self.sizes),)

    def contains(self, value: Array) -> Array:
        """Whether each vector along the last axis is in the space."""
        value = jnp.asarray(value)
        if not is_of_kind(self, value):
            return _none_of(self, value)
        return ((value >= 0) & (value < jnp.asarray(np.asarray(self.sizes)))).all(-1)

    def sample(self, key: Key[Array, ""], *batch: int) -> Int[Array, "*batch entry"]:
        """A vector, uniform."""
        shape = (*batch, *self.shape)
        return jax.random.randint(key, shape, 0, jnp.asarray(np.asarray(self.sizes)))

    def nearest(self, value: Array) -> Array:
        """An entry below 0 counts as 0, one beyond its last as the last."""
        return jnp.clip(value, 0, jnp.asarray(np.asarray(self.sizes) - 1))


@dataclass(frozen=True)
class Simplex:
    """Weights of n choices: none negative, 1 together; a pure choice is a one-hot vector."""

    n: int
    used: Array | None = field(default=None, compare=False, repr=False)  # Bool[n]
    kind: ClassVar[Any] = REAL

    def __post_init__(self) -> None:
        _require_some(self, self.n)

    @property
    def shape(self) -> tuple[int, ...]:
        """A vector with one weight per choice."""
        return (self.n,)

    def contains(self, value: Array) -> Array:
        """Whether each vector along the last axis is in the space, up to rounding."""
        value = jnp.asarray(value)
        if not is_of_kind(self, value):
            return _none_of(self, value)
        return _are_weights(value) & _padding_is_zero(value, self.used).all(-1)

    def sample(self, key: Key[Array, ""], *batch: int) -> Float[Array, "*batch choice"]:
        """A pure choice among those used, uniform, as a one-hot vector."""
        chance = jax.random.uniform(key, (*batch, self.n))
        used = True if self.used is None else self.used
        return jax.nn.one_hot(jnp.where(used, chance, -1.0).argmax(-1), self.n)

    def nearest(self, value: Array) -> Array:
        """What are no weights counts as the choice of the largest used one; padding may be chosen.

        So a talker that may not be silent can still be silenced.
        """
        used = True if self.used is None else self.used
        weight = jnp.where(used, jnp.nan_to_num(value), -jnp.inf)
        choice = jax.nn.one_hot(weight.argmax(-1), self.n, dtype=value.dtype)
        return jnp.where(_are_weights(value)[..., None], value, choice)


@dataclass(frozen=True)
class Box:
    """Real arrays of a shape, between two bounds; arrays where these are swept."""

    low: Number
    high: Number
    shape: tuple[int, ...]
    used: Array | None = field(default=None, compare=False, repr=False)  # Bool[shape]
    kind: ClassVar[Any] = REAL

    def __post_init__(self) -> None:
        for name, bound in (("low", self.low), ("high", self.high)):
            if not isinstance(bound, Array | np.ndarray | np.number | float | int):
                raise EthogramError(f"Box: {name} = {shown(bound)}; allowed: a number. {_IN_ORDER}")
        try:
            object.__setattr__(self, "shape", tuple(map(operator.index, self.shape)))
        except TypeError as error:
            raise EthogramError(
                f"Box: shape = {shown(self.shape)}; allowed: whole numbers in a tuple. {_IN_ORDER}"
            ) from error
        bounds = self.low, self.high
        if any(isinstance(bound, Array) for bound in bounds):
            return
        if not np.all(np.less_equal(*bounds)):
            raise EthogramError(
                f"Box: low = {self.low}, high = {self.high}; allowed: low up to high."
            )

    @property
    def is_bounded(self) -> bool:
        """Whether its bounds are finite; those not known yet, inside `jit`, count as such."""
        bounds = [each for each in (self.low, self.high) if not isinstance(each, jax.core.Tracer)]
        return all(np.isfinite(each).all() for each in bounds)

    def contains(self, value: Array) -> Array:
        """Whether each array along the last axes is in the space."""
        value = jnp.asarray(value)
        if not is_of_kind(self, value):
            return _none_of(self, value)
        axes = tuple(range(-len(self.shape), 0))
        within = (value >= self.low) & (value <= self.high)
        return (within & _padding_is_zero(value, self.used)).all(axes)

    def sample(self, key: Key[Array, ""], *batch: int) -> Float[Array, "..."]:
        """An array, uniform; exponential from a single bound, normal without any."""
        shape = (*batch, *self.shape)
        low, high = (jnp.asarray(bound, float) for bound in (self.low, self.high))
        above, below = jnp.isfinite(low), jnp.isfinite(high)
        uniform = jax.random.uniform(key, shape)
        beyond = -jnp.log1p(-uniform)
        normal = jax.random.normal(key, shape)
        bounded = jnp.where(above, low, 0) + uniform * jnp.where(above & below, high - low, 0)
        drawn = jnp.where(
            above & below,
            bounded,
            jnp.where(above, low + beyond, jnp.where(below, high - beyond, normal)),
        )
        return self.nearest(drawn)

    def nearest(self, value: Array) -> Array:
        """A number beyond a bound counts as the bound, and what is no number as 0 does."""
        inside = jnp.clip(jnp.where(jnp.isnan(value), 0, value), self.low, self.high)
        return inside if self.used is None else jnp.where(self.used, inside, 0)


Space = Discrete | MultiDiscrete | Simplex | Box


def is_of_kind(space: Space, value: Array) -> bool:
    """Whether an array has a space's kind of numbers, and its shape along the last axes."""
    is_whole = jnp.issubdtype(value.dtype, jnp.integer)
    is_real = is_whole or jnp.issubdtype(value.dtype, jnp.floating)
    fits = value.shape[value.ndim - min(value.ndim, len(space.shape)) :] == space.shape
    return fits and (is_whole if space.kind is WHOLE else is_real)


def _require_some(space: Space, *sizes: int) -> None:
    """Refuse a space without a value in it."""
    for size in sizes:
        if size < 1:
            raise EthogramError(f"{space}: a size of {size}; allowed: 1 or more.")


def _none_of(space: Space, value: Array) -> Array:
    """That nothing in an array is in a space, for as many values as it would hold."""
    return jnp.zeros(value.shape[: max(0, value.ndim - len(space.shape))], bool)


def _are_weights(value: Array) -> Array:
    return (value >= 0).all(-1) & (jnp.abs(value.sum(-1) - 1) <= ROUNDING)


def _padding_is_zero(value: Array, used: Array | None) -> Array:
    return jnp.ones(value.shape, bool) if used is None else used | (value == 0)
