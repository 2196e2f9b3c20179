"""An effect, a weighted sum of means over trials, with its bounds and its one-sided p-values.

What spreads is tested by t, the distance from a limit over Welch's error (1947), and, as few skewed
trials deceive it, by Hall's transformation of t (1992), which takes the skewness of the estimate
into account:

    g(t) = t + b t^2 / 3 + b^2 t^3 / 27 + b / 6,
    b = 2 (sum w^3 m3 / n^2) / (sum w^2 m2 / n)^(3/2),

with the second and third moments m2, m3 of each term's trials.  b is twice the estimate: few trials
of a skewed measure show half of its skewness or less.  The larger of the two p-values counts.  Both
statistics are held to a tail heavier than Student's own of f degrees of freedom, where f + 1 is the
number of trials of the smallest term: Student's t of f / 3 degrees of freedom (but not below 4),
stretched by 1 + 37 / f^2 + 370 / f^4.  Doubling, tail and stretch were chosen by simulation, so
that trials as skewed as a lognormal of sigma 1 keep the error that they should
(`benchmarks/verdicts.py`).  With Satterthwaite's f differences would not: a sample that happens to
miss its large values has a small spread too, and seems to count for little.

What does not spread is no certainty: of n trials that are (nearly) all equal, up to 1 - a^(1/n)
of the other outcomes may have stayed unseen at the confidence 1 - a (Clopper and Pearson, 1934),
and each may lie as far away as the measure's support reaches.  Bounds from several sources share
the error a equally.

A trial at the cap of its measure is censored: its true value is there or beyond, and the effect has
no bound on that side.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.special import stdtr, stdtrit

from ethogram.studies.statistics.trials import ROUNDING, Floats, Terms, Trials

SKEWNESS = 2.0  # times that of the trials
STRETCH, MORE = 37.0, 370.0  # over the second and fourth power of the degrees of freedom
TAIL, HEAVIEST = 1 / 3, 4.0  # of the degrees of freedom; no heavier than a t of 4
LEAST_P = 1e-100  # no p-value is smaller, none is zero
HALVINGS = 60  # of an interval of log p


class Unseen(NamedTuple):
    """Outcomes that a term's nearly equal trials did not show, and what they could do."""

    trials: int
    down: float  # what the effect loses if all outcomes are the worst, >= 0
    up: float

    def reach(self, error: float, gap: float) -> float:
        """By how much the effect may be off, at a one-sided chance of error."""
        return (1.0 - error ** (1.0 / self.trials)) * gap if gap else 0.0


class Effect(NamedTuple):
    """An estimate with its standard error, and what else it takes to bound the truth."""

    mean: float
    error: float = 0.0
    freedom: float = math.inf  # of the term with the fewest trials
    skewness: float = 0.0  # b: of the estimate, doubled
    unseen: tuple[Unseen, ...] = ()
    open_below: bool = False  # censored trials: the truth may lie anywhere on that side
    open_above: bool = False

    @property
    def certain(self) -> bool:
        """Whether nothing is left to chance."""
        return self.error == 0 and not self.unseen

    def lower(self, error: float) -> float:
        """The bound that the true effect is below with a chance of at most `error`."""
        if self.open_below:
            return -math.inf
        share = error / self._sources
        gaps = sum(each.reach(share, each.down) for each in self.unseen)
        return self.mean - self._reach(share, self.skewness) - gaps

    def upper(self, error: float) -> float:
        """The bound that the true effect is above with a chance of at most `error`."""
        if self.open_above:
            return math.inf
        share = error / self._sources
        gaps = sum(each.reach(share, each.up) for each in self.unseen)
        return self.mean + self._reach(share, -self.skewness) + gaps

    def above(self, limit: float) -> float:
        """One-sided p-value for "the true effect is at or below the limit"."""
        if limit == -math.inf:
            return LEAST_P
        if self.open_below or self.mean <= limit:
            return 1.0
        if self.unseen:
            return _inverted(lambda error: self.lower(error) > limit)
        return self._p_value(self.mean - limit, self.skewness)

    def below(self, limit: float) -> float:
        """One-sided p-value for "the true effect is at or above the limit"."""
        if limit == math.inf:
            return LEAST_P
        if self.open_above or self.mean >= limit:
            return 1.0
        if self.unseen:
            return _inverted(lambda error: self.upper(error) < limit)
        return self._p_value(limit - self.mean, -self.skewness)

    def of_more_trials(self, times: float) -> "Effect":
        """What so many times as many trials would estimate, if they spread as these do."""
        shrink = math.sqrt(times)
        return self._replace(
            error=self.error / shrink,
            freedom=times * (self.freedom + 1) - 1,
            skewness=self.skewness / shrink,
            unseen=tuple(each._replace(trials=round(times * each.trials)) for each in self.unseen),
        )

    @property
    def _sources(self) -> int:
        return max(1, (self.error > 0) + len(self.unseen))

    @property
    def _stretch(self) -> float:
        return 1.0 + STRETCH / self.freedom**2 + MORE / self.freedom**4

    @property
    def _tail(self) -> float:
        """Degrees of freedom of the t that it is held to."""
        return max(min(self.freedom, HEAVIEST), TAIL * self.freedom)

    def _reach(self, error: float, skewness: float) -> float:
        if self.error == 0:
            return 0.0
        quantile = self._stretch * -float(stdtrit(self._tail, error))
        return float(reach_of(quantile, skewness)) * self.error

    def _p_value(self, distance: float, skewness: float) -> float:
        if self.error == 0:
            return LEAST_P
        t = distance / self.error
        hall = t + skewness * t**2 / 3 + skewness**2 * t**3 / 27 + skewness / 6
        p_value = float(stdtr(self._tail, -min(t, hall) / self._stretch))
        return max(LEAST_P, p_value)


def reach_of(quantile: Any, skewness: Any) -> Any:
    """How many standard errors below the estimate a bound lies: t's, or Hall's if it is more.

    Above the estimate, with the skewness negative.  Numbers or arrays.
    """
    safe = np.where(np.abs(skewness) < ROUNDING, ROUNDING, skewness)
    hall = 3 / safe * (np.cbrt(1 + safe * (quantile - safe / 6)) - 1)
    return np.maximum(quantile, hall)


def estimate(terms: Terms) -> Effect:
    """The effect of terms that all have two trials or more, all with a value.

    Moments are taken about the first trial, so that equal trials have exactly no variance.
    """
    mean, third, biased, variances, freedoms = 0.0, 0.0, 0.0, [], []
    for weight, trials in terms:
        values = np.asarray(trials.values, dtype=float)
        centre, variance, moment = moments(values)
        count = values.size
        mean += weight * float(centre)
        variances.append(weight**2 * float(variance) / count)
        freedoms.append(count - 1)
        biased += weight**2 * float(variance) * (count - 1) / count**2
        third += weight**3 * float(moment) / count**2
    variance = sum(variances)
    sides = [_censored(*term) for term in terms]
    certain = Effect(
        mean,
        unseen=tuple(_unseen(*term) for term in terms if term[0] and term[1].hardly_varies),
        open_below=any(below for below, _ in sides),
        open_above=any(above for _, above in sides),
    )
    if variance == 0:
        return certain
    return certain._replace(
        error=math.sqrt(variance),
        freedom=min(df for df, one in zip(freedoms, variances, strict=True) if one > 0),
        skewness=SKEWNESS * third / biased**1.5,
    )


def moments(values: Floats) -> tuple[Any, Any, Any]:
    """Mean, variance (of n - 1) and third central moment (of n) over trials, the first axis."""
    shifted = values - values[0]
    centre = shifted.mean(0)
    return values[0] + centre, shifted.var(0, ddof=1), ((shifted - centre) ** 3).mean(0)


def _unseen(weight: float, trials: Trials) -> Unseen:
    values = np.asarray(trials.values, dtype=float)
    support = trials.support
    high = math.inf if support.capped else support.high
    down, up = max(0.0, values.mean() - support.low), max(0.0, high - values.mean())
    if weight < 0:
        down, up = up, down
    return Unseen(values.size, abs(weight) * float(down), abs(weight) * float(up))


def _censored(weight: float, trials: Trials) -> tuple[bool, bool]:
    """Whether the effect has no bound below, or above, for want of the true values of trials."""
    censored = trials.censored > 0
    return censored and weight < 0, censored and weight > 0


def _inverted(excluded: Callable[[float], bool]) -> float:
    """The smallest one-sided error at which a bound excludes a limit; 1 where that is over 0.5."""
    if not excluded(0.5):
        return 1.0
    if excluded(LEAST_P):
        return LEAST_P
    low, high = math.log(LEAST_P), math.log(0.5)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if excluded(math.exp(middle)) else (middle, high)
    return math.exp(high)
