"""Worlds whose observations or actions are numbers from 0, for tables and for choices.

Several whole numbers become one in mixed radix, the first of them the most significant.
"""

import dataclasses
from math import prod
from typing import Annotated, Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Int, Key
from pydantic import Field

from ethogram.core.errors import EthogramError, TooLarge
from ethogram.core.memory import readable_count
from ethogram.core.settings import Number, setting
from ethogram.core.spaces import LARGEST_INDEX, Box, Discrete, MultiDiscrete, Simplex, Space
from ethogram.core.world import Outcome, PerRole, Role
from ethogram.core.wrappers.base import Wrapper

Bins = Annotated[int, Field(ge=2, le=10_000)]


class DiscretizeObservation(Wrapper):
    """A world all of whose observations are `Discrete`.

    Of a `Box` or a `Simplex` each number falls in one of `bins` bins of equal width between its
    bounds, or between `low` and `high` where these are given; what lies beyond is in the outermost.
    """

    bins: int = setting(2, Bins, static=True)
    low: Number | None = setting(None, float | None)
    high: Number | None = setting(None, float | None)

    def __check_init__(self) -> None:
        """Refuse a world whose observations cannot be counted.

        Raises:
            EthogramError: a box has a bound that is not finite, and none is given instead, or its
                lower bound is not below the upper one.
            TooLarge: there are more observations than 32 bits can number.

        """
        for name, role in self.world.roles.items():
            space = role.observation
            if isinstance(space, Box):
                bounded = self._bounded(space)
                require_finite(type(self).__name__, name, bounded, "low and high")
                require_width(type(self).__name__, name, bounded)
            require_countable(type(self).__name__, name, space, self.bins)

    @property
    def roles(self) -> dict[str, Role]:
        """The other world's, with other observations."""
        return {
            name: dataclasses.replace(
                role, observation=Discrete(prod(digit_sizes(role.observation, self.bins)))
            )
            for name, role in self.world.roles.items()
        }

    def reset(self, key: Key[Array, ""]) -> tuple[Any, PerRole]:
        """As the other world."""
        state, observation = self.world.reset(key)
        return state, self._discrete(observation)

    def observe(self, state: Any) -> PerRole:
        """What the other world's agents observe, as numbers from 0."""
        return self._discrete(self.world.observe(state))

    def step(self, key: Key[Array, ""], state: Any, action: PerRole) -> tuple[Any, Outcome]:
        """As the other world."""
        after, outcome = self.world.step(key, state, action)
        discrete = self._discrete(outcome.observation)
        return after, dataclasses.replace(outcome, observation=discrete)

    def _discrete(self, observation: PerRole) -> PerRole:
        return {
            name: self._number(role.observation, observation[name])
            for name, role in self.world.roles.items()
        }

    def _number(self, space: Space, value: Array) -> Int[Array, "agent"]:
        if isinstance(space, Discrete):
            return value
        if isinstance(space, MultiDiscrete):
            return encode_mixed_radix(value, space.sizes)
        space = self._bounded(space) if isinstance(space, Box) else Box(0.0, 1.0, space.shape)
        share = (value - space.low) / (space.high - space.low)
        bin_ = jnp.clip(jnp.floor(self.bins * share), 0, self.bins - 1).astype(jnp.int32)
        return encode_mixed_radix(bin_.reshape(len(value), -1), digit_sizes(space, self.bins))

    def _bounded(self, space: Box) -> Box:
        low = space.low if self.low is None else self.low
        high = space.high if self.high is None else self.high
        return Box(low, high, space.shape)


class DiscretizeAction(Wrapper):
    """A world all of whose actions are `Discrete`.

    Of a `Simplex` an action is a pure choice; one that there is not counts as the first that there
    is.  Of a `Box` each number is one of `bins`, evenly spread from bound to bound.
    """

    bins: int = setting(3, Bins, static=True)

    def __check_init__(self) -> None:
        """Refuse a world whose actions cannot be counted.

        Raises:
            EthogramError: a box has a bound that is not finite.
            TooLarge: there are more actions than 32 bits can number.

        """
        for name, role in self.world.roles.items():
            if isinstance(role.action, Box):
                require_finite(type(self).__name__, name, role.action)
            if not isinstance(role.action, Simplex):
                require_countable(type(self).__name__, name, role.action, self.bins)

    @property
    def roles(self) -> dict[str, Role]:
        """The other world's, with other actions."""
        return {
            name: dataclasses.replace(role, action=Discrete(self._count(role.action)))
            for name, role in self.world.roles.items()
        }

    def step(self, key: Key[Array, ""], state: Any, action: PerRole) -> tuple[Any, Outcome]:
        """As the other world."""
        roles = self.world.roles
        taken = {name: self._value(roles[name].action, each) for name, each in action.items()}
        return self.world.step(key, state, taken)

    def _count(self, space: Space) -> int:
        return space.n if isinstance(space, Simplex) else prod(digit_sizes(space, self.bins))

    def _value(self, space: Space, number: Int[Array, "agent"]) -> Array:
        match space:
            case Discrete():
                return number
            case MultiDiscrete(sizes):
                return decode_mixed_radix(number, sizes)
            case Simplex(n, used):
                if used is not None:
                    number = jnp.where(jnp.asarray(used)[number], number, jnp.argmax(used))
                return jax.nn.one_hot(number, n)
            case Box():
                steps = decode_mixed_radix(number, digit_sizes(space, self.bins))
                share = steps.reshape(len(number), *space.shape) / (self.bins - 1)
                return space.nearest(space.low + share * (space.high - space.low))


def require_finite(owner: str, role: str, space: Box, instead: str | None = None) -> None:
    """Refuse a box with a bound that is not finite.

    Args:
        owner: who cannot use it.
        role: whose it is.
        space: the box.
        instead: the owner's settings that can replace the bounds.

    Raises:
        EthogramError: naming role and space.

    """
    if not space.is_bounded:
        hint = f" (or give {instead})" if instead else ""
        raise EthogramError(
            f"{owner} needs boxes with finite bounds{hint}; that of {role!r} is {space}."
        )


def require_width(owner: str, role: str, space: Box) -> None:
    """Refuse a box that is as wide as a point; padding may be, and bounds not known yet, in `jit`.

    Raises:
        EthogramError: naming role and bounds.

    """
    bounds = space.low, space.high
    if any(isinstance(bound, jax.core.Tracer) for bound in bounds):
        return
    wide = np.asarray(space.low) < np.asarray(space.high)
    if space.used is not None and not isinstance(space.used, jax.core.Tracer):
        wide = wide | ~np.asarray(space.used)
    if not wide.all():
        raise EthogramError(
            f"{owner}: low = {space.low}, high = {space.high} of {role!r}; allowed: low below high."
        )


def require_countable(owner: str, role: str, space: Space, bins: int) -> None:
    """Refuse a space of which more values are told apart than 32 bits can number.

    Raises:
        TooLarge: naming role and number.

    """
    count = prod(digit_sizes(space, bins))
    if count > LARGEST_INDEX:
        raise TooLarge(
            f"{owner} with bins = {bins} tells {readable_count(count)} values apart in the "
            f"{type(space).__name__} of {role!r}; allowed: {LARGEST_INDEX:,}."
        )


def encode_mixed_radix(digits: Int[Array, "*batch digit"], sizes: tuple[int, ...]) -> Array:
    """One number of several, of which digit i is one of 0 to sizes[i] - 1."""
    weights = np.array([prod(sizes[place + 1 :]) for place in range(len(sizes))], np.int32)
    return (digits * weights).sum(-1).astype(jnp.int32)


def decode_mixed_radix(number: Int[Array, "*batch"], sizes: tuple[int, ...]) -> Array:
    """The several of which `encode_mixed_radix` made one."""
    weights = np.array([prod(sizes[place + 1 :]) for place in range(len(sizes))], np.int32)
    return number[..., None] // weights % np.array(sizes, np.int32)


def digit_sizes(space: Space, bins: int) -> tuple[int, ...]:
    """How many values of each number of a space are told apart, with bins for real ones."""
    match space:
        case Discrete(n):
            return (n,)
        case MultiDiscrete(sizes):
            return sizes
        case Simplex() | Box():
            return (bins,) * prod(space.shape)
