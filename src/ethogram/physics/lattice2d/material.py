"""Material of voxels in the plane: rigid squares, springs between them, and what they touch."""

from typing import Annotated, Literal

import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float
from pydantic import Field

from ethogram.core.module import Module
from ethogram.core.settings import Number, setting

Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0)]
Springs = Literal["all", "outline"]


class Material(Module):
    """Constants of voxels; SI units.  The defaults are those of the thesis' simulator.

    Attributes:
        springs: which there are: "all" 18 of a voxel, or the 6 of the "outline" and the diagonals.
        frequency: f, of all springs, Hz; above 0.
        damping_ratio: zeta, of all springs: 1 is critical; 0 or more.
        edge: L, of a voxel at rest, m; above 0.
        square: a, the side of a rigid square, m; above 0 and below a half of the smallest edge.
        square_mass: m, kg; above 0.
        smallest_area: that springs contract to, relative to rest; above 0.
        largest_area: that springs expand to, relative to rest; above 0.
        drag: c, of velocities, linear and angular, 1/s; 0 or more.
        friction: mu, between squares and ground; 0 or more.
        self_friction: mu, between squares; 0 or more.
        restitution: e, of what squares touch faster than 1 m/s; from 0 to 1.
        time_step: dt, s; above 0.
        sweeps: of the solver, in each step; 1 or more.

    """

    springs: Springs = setting("all", Springs, static=True)
    frequency: Number = setting(8.0, Positive)
    damping_ratio: Number = setting(0.3, Share)
    edge: Number = setting(3.0, Positive)
    square: Number = setting(0.9, Positive)
    square_mass: Number = setting(0.2025, Positive)
    smallest_area: Number = setting(0.75, Positive)
    largest_area: Number = setting(1.25, Positive)
    drag: Number = setting(1.0, Share)
    friction: Number = setting(float(np.sqrt(100 * 0.2)), Share)
    self_friction: Number = setting(100.0, Share)
    restitution: Number = setting(0.1, Annotated[float, Field(ge=0, le=1)])
    time_step: Number = setting(1 / 60, Positive)
    sweeps: int = setting(10, Annotated[int, Field(ge=1, le=1000)], static=True)

    @classmethod
    def soft(cls) -> "Material":
        """The thesis' soft material, of avalanches: 5 Hz, without inner and crossed springs."""
        return cls(springs="outline", frequency=5.0)

    @property
    def square_inertia(self) -> Number:
        """Moment of inertia of a square about its centre: I = m (a^2 + a^2) / 12, kg m^2."""
        return self.square_mass * self.square**2 / 6

    @property
    def angular_frequency(self) -> Number:
        """Angular frequency omega = 2 pi f, 1/s."""
        return 2 * np.pi * self.frequency

    @property
    def spring_inertia(self) -> Number:
        """What springs add to masses: 1 / (gamma m_e) = dt (2 zeta omega + dt omega^2).

        It is relative to the reduced mass m_e of what the spring joins.
        """
        omega, time = self.angular_frequency, self.time_step
        return time * (2 * self.damping_ratio * omega + time * omega**2)

    @property
    def spring_pull(self) -> Number:
        """What a metre of stretch does to a velocity: bias / (gamma m_e) = dt omega^2, 1/s."""
        return self.time_step * self.angular_frequency**2

    @property
    def edges(self) -> Float[Array, "3"]:
        """L_min, L, L_max: edges of a voxel that is contracted, at rest, expanded, m."""
        ratios = [self.smallest_area, 1.0, self.largest_area]
        return self.edge * jnp.sqrt(jnp.stack([jnp.asarray(ratio, float) for ratio in ratios]))
