"""Intervals for tables and figures, about means over independent trials."""

from typing import Any, NamedTuple

import numpy as np
from scipy.special import stdtrit

from ethogram.core.findings import Measured
from ethogram.studies.statistics.effects import SKEWNESS, moments, reach_of
from ethogram.studies.statistics.trials import LEAST_TRIALS, Floats, Trials, hardly_varies


class Interval(NamedTuple):
    """Two bounds: numbers, or arrays of numbers where the samples have more axes."""

    low: Any
    high: Any


def interval_of_mean(samples: Floats, *, level: float = 0.95) -> Interval:
    """Student's interval of a mean over trials, widened for skewness by Hall's transformation.

    `samples` has trials on its first axis; further axes (time, say) are kept.  Trials without
    spread have an interval of no width; of fewer than five trials it is their range.  An undefined
    number (NaN) in a column makes its bounds NaN.  Raises `ValueError` when there is no trial.
    """
    trials = len(samples)
    if trials == 0:
        raise ValueError("an interval needs at least one trial")
    samples = np.asarray(samples, dtype=float)
    if trials < LEAST_TRIALS:
        return Interval(samples.min(0), samples.max(0))
    mean, variance, third = moments(samples)
    biased = variance * (trials - 1) / trials
    spread = np.where(biased > 0, biased, 1.0)
    skewness = SKEWNESS * third / spread**1.5 / np.sqrt(trials)
    quantile = -stdtrit(trials - 1, (1.0 - level) / 2.0)
    error = np.sqrt(variance / trials)
    below, above = (reach_of(quantile, sign * skewness) for sign in (1, -1))
    return Interval(mean - error * below, mean + error * above)


def measured(trials: Trials, *, published: float | None = None) -> Measured | None:
    """The mean over trials with its interval; None where nothing was run.

    Bounded by what the measure can be.  Of fewer than five trials, or of trials that are nearly
    all equal, an interval would say nothing: the bounds are then their range.
    """
    values = trials.values
    if values is None:
        return None
    interval = interval_of_mean(values)
    value = float(values.mean())
    if len(values) < LEAST_TRIALS or hardly_varies(values):
        low, high = float(values.min()), float(values.max())
        return Measured(value=value, low=low, high=high, published=published, bounds="range")
    low, high = max(interval.low, trials.support.low), min(interval.high, trials.support.high)
    return Measured(value=value, low=float(low), high=float(high), published=published)
