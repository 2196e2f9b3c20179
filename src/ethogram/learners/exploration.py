"""Epsilon-greedy choice, and how epsilon falls with the number of episodes."""

from abc import abstractmethod
from typing import Annotated

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Int, UInt32
from pydantic import Field

from ethogram.core.settings import Number, setting

Probability = Annotated[float, Field(ge=0, le=1)]

HALF = 16  # bits of a random word that decide whether to explore; the others choose


def epsilon_greedy(
    values: Float[Array, "actions agent"],
    bits: UInt32[Array, "agent"],
    epsilon: Number,
) -> Int[Array, "agent"]:
    """Explore with chance epsilon, else take an action of the highest value; ties at random.

    One random word per agent does both: its upper half decides whether to explore (so that
    chances are multiples of 2^-16), its lower half picks one of the candidates.
    """
    threshold = jnp.round(jnp.asarray(epsilon) * 2**HALF).astype(jnp.uint32)
    exploring = (bits >> HALF) < threshold
    candidate = exploring | (values == values.max(0))
    position = jnp.cumsum(candidate.astype(jnp.uint32), 0)
    pick = ((bits & (2**HALF - 1)) * position[-1]) >> HALF
    return (position <= pick).sum(0).astype(jnp.int32)


class Schedule(eqx.Module):
    """A value for each episode, counted from 0."""

    @abstractmethod
    def __call__(self, episode: Int[Array, ""]) -> Float[Array, ""]:
        """The value in this episode."""


class Constant(Schedule):
    """The same value throughout."""

    value: Number = eqx.field(converter=jnp.asarray)

    def __call__(self, episode: Int[Array, ""]) -> Float[Array, ""]:
        """The value, whatever the episode."""
        return jnp.full_like(episode, self.value, dtype=jnp.float32)


class ExponentialDecay(Schedule):
    """start x decay^episode, but never below end."""

    start: Number = setting(1.0, Probability)
    end: Number = setting(0.01, Probability)
    decay: Number = setting(0.9995, Probability)

    def __call__(self, episode: Int[Array, ""]) -> Float[Array, ""]:
        """The decayed value."""
        return jnp.maximum(self.end, self.start * jnp.power(self.decay, episode))


class LinearDecay(Schedule):
    """From start to end in equal steps over a number of episodes, then end."""

    start: Number = eqx.field(converter=jnp.asarray)
    end: Number = eqx.field(converter=jnp.asarray)
    episodes: Number = eqx.field(converter=jnp.asarray)

    def __call__(self, episode: Int[Array, ""]) -> Float[Array, ""]:
        """The interpolated value."""
        passed = jnp.clip(episode / self.episodes, 0.0, 1.0)
        return self.start + passed * (self.end - self.start)
