"""Phase of an oscillation after a whole number of steps, exact for as long as an episode lasts.

sin(2 pi f k dt) computed as written loses its phase: 2 pi f k dt is a large number, whose last bit
in 32 bits is worth 2e-3 rad after a million steps.  Whole periods are taken off first, in integers.
"""

import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Float, Int, UInt32

from ethogram.core.settings import Number

MOST_STEPS = 2**24  # that a 32-bit float counts one by one
PERIOD = 2.0**32  # a period in units of the fixed-point phase


def phase(
    step: Int[Array, "*batch"], frequency: Number, time_step: Number
) -> Float[Array, "*batch"]:
    """2 pi f k dt, less whole periods: in [-pi, pi), radians.

    f dt, the product of two floating-point numbers, is taken without rounding as a sum of four
    exact products; each is split into a 32-bit fraction of a period, which wraps around as the
    phase does when multiplied by k, and a remainder below 2^-32.  The error is that of a number in
    [-pi, pi), some 3e-7 rad in 32 bits, at every step up to 2^24.

    Args:
        step: k, from 0 to 2^24.
        frequency: f, Hz, not negative; differentiable.
        time_step: dt, s; differentiable.

    """
    whole, rest = _fixed_point(jnp.asarray(frequency, float), jnp.asarray(time_step, float))
    turned = step.astype(jnp.uint32) * whole + (step * rest).astype(jnp.uint32)
    signed = lax.bitcast_convert_type(turned, jnp.int32)
    angle = signed.astype(rest.dtype) * (2 * np.pi / PERIOD)
    rough = 2 * jnp.pi * frequency * step * time_step  # its derivatives are right, its value is not
    return lax.stop_gradient(angle) + (rough - lax.stop_gradient(rough))


def _fixed_point(
    frequency: Float[Array, "*batch"], time_step: Float[Array, "*batch"]
) -> tuple[UInt32[Array, "*batch"], Float[Array, "*batch"]]:
    """Fraction of a period per step in units of 2^-32: whole units, and the rest of a unit."""
    whole, rest = jnp.uint32(0), jnp.zeros(())
    for left in _halves(frequency):
        for right in _halves(time_step):
            units = left * right * PERIOD  # exact: each factor has half of the digits
            floor = jnp.floor(units)
            turned = floor - PERIOD * jnp.round(floor / PERIOD)  # whole periods are nothing
            whole = whole + turned.astype(jnp.int32).astype(jnp.uint32)
            rest = rest + (units - floor)
    return whole, rest


def _halves(
    number: Float[Array, "*batch"],
) -> tuple[Float[Array, "*batch"], Float[Array, "*batch"]]:
    """A number as the sum of two with half of its digits each."""
    kind = np.finfo(number.dtype)
    high = lax.reduce_precision(number, kind.nexp, (kind.nmant - 1) // 2)
    return high, number - high
