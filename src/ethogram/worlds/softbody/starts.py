"""Starts of an episode that differ slightly from the one at rest: phase, height and speed.

Where contacts stick or slip by the last bits of a number, how far a robot gets from one start is
partly luck; a mean over starts is not.

Bodies that are flat along y, as the thesis' are, stay in their plane for ever, as nothing pulls
them out of it, unless they start sideways: then they may turn, and get less far along x.
"""

from typing import Annotated

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Key
from pydantic import Field

from ethogram.core.module import Module
from ethogram.core.settings import Number, setting


class Start(eqx.Module):
    """How robots start, side by side; all zeros is at rest on the floor, in phase."""

    phase: Float[Array, "*robot"]  # radians, that the clock is ahead
    height: Float[Array, "*robot"]  # m, of the body's lowest corner
    velocity: Float[Array, "2 *robot"]  # m/s, along x and y, of the whole body


class StartDistribution(Module):
    """Where starts are drawn from, uniformly and independently.

    Attributes:
        phase: clocks are up to so many radians ahead or behind, from 0 to pi.
        height: bodies drop from up to so high, in metres, 0 or more.
        speed: they move along x by up to so much, forwards or backwards, in m/s, 0 or more.
        sideways: they move along y by up to so much, to either side, in m/s, 0 or more.

    """

    phase: Number = setting(0.1, Annotated[float, Field(ge=0, le=np.pi)])
    height: Number = setting(1e-4, Annotated[float, Field(ge=0)])
    speed: Number = setting(0.01, Annotated[float, Field(ge=0)])
    sideways: Number = setting(0.0, Annotated[float, Field(ge=0)])

    def sample(self, key: Key[Array, ""], starts: int) -> Start:
        """Draw starts; the first ones are the same however many there are."""
        fastest = jnp.stack([jnp.asarray(self.speed), jnp.asarray(self.sideways)])

        def one(key: Key[Array, ""]) -> Start:
            for_phase, for_height, for_velocity = jax.random.split(key, 3)
            return Start(
                self.phase * jax.random.uniform(for_phase, minval=-1),
                self.height * jax.random.uniform(for_height),
                fastest * jax.random.uniform(for_velocity, (2,), minval=-1),
            )

        keys = jax.vmap(jax.random.fold_in, (None, 0))(key, jnp.arange(starts))
        return jax.vmap(one, out_axes=-1)(keys)
