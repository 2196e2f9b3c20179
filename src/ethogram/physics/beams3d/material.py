"""Material of a soft body, and what follows from it: stiffness, damping, the step of time."""

from typing import Annotated, NamedTuple

import jax.numpy as jnp
from jax import Array
from jaxtyping import Float
from pydantic import Field

from ethogram.core.module import Module
from ethogram.core.settings import Number, setting

Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0)]
PI_OF_THE_TIME_STEP = 3.1415926  # the original simulator's, in this place alone


class Material(Module):
    """Constants of voxels, beams and floor; SI units.

    The defaults are those of the thesis' simulator.  Mass and moment of inertia are the same
    whatever edge is commanded, and so is a beam's stiffness: that of a square beam of the edge at
    rest.

    Attributes:
        edge: L, of a voxel at rest, m; above 0.
        mass: m, of a voxel, kg; above 0.
        elastic_modulus: E, Pa; above 0.
        poisson_ratio: nu, above -1 and up to 0.5; for shear alone.
        static_friction: mu_s, of the floor; 0 or more.
        dynamic_friction: mu_d, of the floor; 0 or more.
        bond_damping: zeta, of the beams: 1 is critical; 0 or more.
        floor_damping: of what moves into the floor: 1 is critical; 0 or more.
        global_damping: drag, everywhere; 0 or more.
        step_fraction: of the longest step of time; above 0 and up to 1.

    """

    edge: Number = setting(0.01, Positive)  # L, m, at rest
    mass: Number = setting(1.0, Positive)  # m, kg, of a voxel
    elastic_modulus: Number = setting(5e6, Positive)  # E, Pa
    poisson_ratio: Number = setting(0.35, Annotated[float, Field(gt=-1, le=0.5)])  # nu: shear alone
    static_friction: Number = setting(1.0, Share)  # mu_s, of the floor
    dynamic_friction: Number = setting(0.5, Share)  # mu_d
    bond_damping: Number = setting(1.0, Share)  # zeta: 1 is critical
    floor_damping: Number = setting(0.8, Share)
    global_damping: Number = setting(0.01, Share)  # drag, everywhere
    step_fraction: Number = setting(0.2, Annotated[float, Field(gt=0, le=1)])  # of the longest step

    @property
    def time_step(self) -> Float[Array, ""]:
        """Seconds: a fraction of 1 / omega of the stiffest spring."""
        omega = jnp.sqrt(self.elastic_modulus * self.edge / self.mass)
        return self.step_fraction / (2 * PI_OF_THE_TIME_STEP * omega)

    @property
    def inertia(self) -> Number:
        """I = m L^2 / 6, kg m^2, about any axis."""
        return self.mass * self.edge**2 / 6

    @property
    def beam(self) -> "Beam":
        """Stiffness of the beams."""
        young, edge = self.elastic_modulus, self.edge
        shear = young / (2 * (1 + self.poisson_ratio))
        return Beam(
            axial=young * edge,
            twist=shear * edge**3 / 6,
            shear=young * edge,
            shear_bend=young * edge**2 / 2,
            bend=young * edge**3 / 6,
        )

    @property
    def bond_dashpot(self) -> "Beam":
        """Damping of the beams: zeta / 2 of twice the root of each stiffness times its inertia."""
        beam, moment = self.beam, self.mass * self.edge / 2
        inertia = Beam(self.mass, self.inertia, self.mass, moment, self.inertia)
        return Beam(
            *(self.bond_damping * jnp.sqrt(k * m) for k, m in zip(beam, inertia, strict=True))
        )

    @property
    def contact_dashpot(self) -> Float[Array, ""]:
        """2 sqrt(m E L), N s / m: critical damping of a voxel on the floor."""
        return 2 * jnp.sqrt(self.mass * self.elastic_modulus * self.edge)

    @property
    def spin_decay(self) -> Float[Array, ""]:
        """What drag leaves of the angular momentum in a step."""
        critical = 2 * jnp.sqrt(self.inertia * self.elastic_modulus * self.edge**3)
        return 1 - 10 * self.global_damping * critical / self.inertia * self.time_step


class Beam(NamedTuple):
    """Coefficients of a beam, for displacements (stiffness) or for their rates (damping)."""

    axial: Number  # a1: force per stretch
    twist: Number  # a2: moment per twist
    shear: Number  # b1: force per displacement across
    shear_bend: Number  # b2: force per bend, moment per displacement across
    bend: Number  # b3: moment per bend
