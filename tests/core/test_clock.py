"""Phases after many steps, against exact fractions."""

from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.core.clock import MOST_STEPS, phase

STEPS = np.array([0, 1, 2, 999, 10_000, 10**6, 10**7, MOST_STEPS], np.int32)
phases = jax.jit(phase)


def exactly(step, frequency, time_step):
    """The phase in radians, from the fraction of a period that is exactly f k dt mod 1."""
    periods = Fraction(float(frequency)) * Fraction(float(time_step)) * int(step)
    return 2 * np.pi * float(periods % 1)


@pytest.mark.parametrize(
    ("frequency", "time_step"), [(40.0, 1.42e-4), (0.3, 1.0), (997.3, 1e-2), (1e-3, 3e-6), (0.0, 1)]
)
def test_a_phase_is_right_to_the_last_bits_however_long_the_episode(frequency, time_step):
    pair = np.float32(frequency), np.float32(time_step)
    found = np.asarray(phases(jnp.asarray(STEPS), *pair), float)
    missed = found - [exactly(step, *pair) for step in STEPS]
    assert np.abs(np.sin(missed / 2)).max() < 2e-7
    assert np.abs(found).max() <= np.float32(np.pi)


def test_the_derivatives_of_a_phase_are_those_of_the_formula():
    at = jnp.int32(1000), 40.0, 1.4e-4
    by_frequency, by_step = jax.grad(lambda f, dt: phase(at[0], f, dt), (0, 1))(*at[1:])
    assert by_frequency == pytest.approx(2 * np.pi * 1000 * 1.4e-4, rel=1e-5)
    assert by_step == pytest.approx(2 * np.pi * 1000 * 40.0, rel=1e-5)
