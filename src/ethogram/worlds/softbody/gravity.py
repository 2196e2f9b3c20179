"""Gravity programs: surfaces are even or not by the way that weight pulls.

A program takes the moment, the share of the simulation that has passed, to an acceleration
(x, y, z) in m/s^2.  Thesis, section 5.4.2: an uneven surface is one on which gravity, of a constant
9.8 m/s^2, tilts towards x and back.  On the even surface of section 5.4.1 it is the simulator's own
9.81 m/s^2, straight down.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from ethogram.core.errors import InvalidSettings
from ethogram.core.settings import function_of

Program = Callable[[Float[Array, ""]], Float[Array, "3"]]
Sideways = Callable[[Float[Array, ""]], Array | float]  # moment -> g_x, m/s^2

DOWNWARDS = 9.81  # m/s^2, the simulator's
TILTED = 9.8  # m/s^2, the norm of a gravity that tilts
EVOLUTION_CYCLES, VALIDATION_CYCLES = 2, 5
STEP = 3.0  # m/s^2


def tilt(sideways: Sideways) -> Program:
    """A program from any g_x(moment) below 9.8 m/s^2: g_z = -sqrt(9.8^2 - g_x^2)."""

    def tilted(moment: Float[Array, ""]) -> Float[Array, "3"]:
        g_x = jnp.asarray(sideways(moment), float)
        return jnp.stack([g_x, jnp.zeros_like(g_x), -jnp.sqrt(TILTED**2 - g_x**2)])

    return tilted


def even(moment: Float[Array, ""]) -> Float[Array, "3"]:
    """Straight down, always."""
    return jnp.zeros(3).at[2].set(-DOWNWARDS + 0 * moment)


GRAVITY: dict[str, Program] = {
    "even": even,
    "evolution": tilt(lambda moment: jnp.sin(2 * jnp.pi * EVOLUTION_CYCLES * moment)),  # eq. 5.4
    "flat": tilt(lambda moment: 0 * moment),  # eq. 5.5
    "step": tilt(lambda moment: jnp.where(moment > 0.5, STEP, 0.0)),  # eq. 5.6
    "sin": tilt(lambda moment: jnp.sin(2 * jnp.pi * VALIDATION_CYCLES * moment)),  # eq. 5.7
}


def schedule(gravity: str | Program, steps: int) -> Float[Array, "step 3"]:
    """What a program gives at each step of a simulation.

    Raises:
        UnknownName: there is no such program.
        InvalidSettings: it is neither a name nor a function, or gives something that is no
            acceleration: not three numbers, or not finite, as where a tilt is asked for that
            exceeds gravity.

    """
    found = jax.vmap(function_of(GRAVITY, gravity))(jnp.arange(steps) / steps)
    if found.shape != (steps, 3):
        raise InvalidSettings(
            f"gravity: a program gives 3 numbers (x, y, z); this one gives {found.shape[1:]}."
        )
    if not np.isfinite(found).all():
        step = int(np.argwhere(~np.isfinite(np.asarray(found)))[0, 0])
        raise InvalidSettings(
            f"gravity: at step {step} of {steps} it is {found[step]}; allowed: finite numbers, and "
            f"tilts (g_x) below {TILTED} m/s^2."
        )
    return found
