"""Values that change as a learner learns: how much to explore, how far to step."""

from abc import abstractmethod
from typing import Annotated, Any

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Int
from pydantic import Field

from ethogram.core.errors import InvalidSettings, shown
from ethogram.core.module import Module
from ethogram.core.settings import Number, setting

Probability = Annotated[float, Field(ge=0, le=1)]


class Schedule(Module):
    """A value for each update of a learner, counted from 0 (for Q-learning, each episode)."""

    @abstractmethod
    def __call__(self, update: Int[Array, ""]) -> Float[Array, ""]:
        """The value at this update."""


class Constant(Schedule):
    """The same value throughout."""

    value: Number = eqx.field(converter=jnp.asarray)

    def __call__(self, update: Int[Array, ""]) -> Float[Array, ""]:
        """The value, whatever the update."""
        return jnp.full_like(update, self.value, dtype=jnp.float32)


class ExponentialDecay(Schedule):
    """start x decay^update, but never below end."""

    start: Number = setting(1.0, Probability)
    end: Number = setting(0.01, Probability)
    decay: Number = setting(0.9995, Probability)

    def __call__(self, update: Int[Array, ""]) -> Float[Array, ""]:
        """The decayed value."""
        return jnp.maximum(self.end, self.start * jnp.power(self.decay, update))


class Linear(Schedule):
    """From start to end in equal steps over a number of updates, then end."""

    start: Number = eqx.field(converter=jnp.asarray)
    end: Number = eqx.field(converter=jnp.asarray)
    updates: Number = eqx.field(converter=jnp.asarray)

    def __call__(self, update: Int[Array, ""]) -> Float[Array, ""]:
        """The interpolated value."""
        passed = jnp.clip(update / self.updates, 0.0, 1.0)
        return self.start + passed * (self.end - self.start)


def schedule_of(value: Any) -> Schedule:
    """A schedule as it is; a number as `Constant`.

    Raises:
        InvalidSettings: it is neither.

    """
    if isinstance(value, Schedule):
        return value
    if isinstance(value, int | float | Array) and not isinstance(value, bool):
        return Constant(value)
    raise InvalidSettings(f"{shown(value)} is no schedule; allowed: a number or a Schedule.")
