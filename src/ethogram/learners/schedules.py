"""How an exploration rate falls with the number of episodes."""

from abc import abstractmethod
from typing import Annotated

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Int
from pydantic import Field

from ethogram.core.settings import Number, setting

Probability = Annotated[float, Field(ge=0, le=1)]


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
