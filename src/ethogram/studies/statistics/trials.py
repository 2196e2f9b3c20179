"""What is measured once per independent trial, and sums of means of it."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVarTuple

import numpy as np
from numpy.typing import NDArray

ROUNDING = 1e-9  # relative to the numbers compared: differences below it are floating point's
LEAST_TRIALS = 5  # below this many nothing is decided
NEARLY_ALL = 0.75  # of the trials: where as many are equal, their spread says little

Floats = NDArray[np.floating[Any]]
Record = TypeVarTuple("Record")  # what a measure takes its numbers from


@dataclass(frozen=True, kw_only=True)
class Support:
    """What numbers a measure can give at all: said where the measure is defined.

    Trials that are all equal tell of outcomes that they did not show only as far as the support
    reaches.  `capped` measures stop looking at `high` (an event within 10 steps, say): a trial
    that gave `high` is censored, its true value there or anywhere beyond.  `exact` ones cannot
    have any spread: equal trials are then the truth.
    """

    low: float = -math.inf
    high: float = math.inf
    capped: bool = False
    exact: bool = False

    def __post_init__(self) -> None:
        if not self.low <= self.high:
            raise ValueError(f"no number lies between {self.low} and {self.high}")


@dataclass(frozen=True)
class Bounded(Generic[*Record]):
    """A measure, one number per trial, with what its numbers can be; called as the measure is."""

    values: Callable[[*Record], Floats]
    support: Callable[[*Record], Support]

    def __call__(self, *record: *Record) -> Floats:
        """The measure of a record: [trial]."""
        return self.values(*record)


def bounded(
    support: Callable[[*Record], Support],
) -> Callable[[Callable[[*Record], Floats]], Bounded[*Record]]:
    """Say beside a measure's definition what its numbers can be."""
    return lambda values: Bounded(values, support)


def support_of(measure: Callable[[*Record], Floats], *record: *Record) -> Support:
    """What a measure's numbers can be: anything, unless it is said where it is defined."""
    return measure.support(*record) if isinstance(measure, Bounded) else Support()


@dataclass(frozen=True, eq=False)
class Trials:
    """One number per independent trial of a condition; None where the condition was not run."""

    name: str  # in words, for a note: "optional, cooperative, filling hidden"
    values: Floats | None  # [trial]
    support: Support = Support()

    def __post_init__(self) -> None:
        if self.values is not None and self.values.ndim != 1:
            raise ValueError(f"{self.name}: one number per trial, not shape {self.values.shape}")

    @property
    def missing(self) -> bool:
        """Whether no trial was run."""
        return self.values is None or self.values.size == 0

    @property
    def count(self) -> int:
        """How many trials there are."""
        return 0 if self.values is None else self.values.size

    @property
    def mean(self) -> float:
        """Of all trials; not a number where there is none."""
        return math.nan if self.values is None or self.missing else float(self.values.mean())

    @property
    def defect(self) -> str:
        """What forbids a test on these trials, in words; empty when nothing does."""
        values = np.empty(0) if self.values is None else self.values
        undefined = int(np.count_nonzero(~np.isfinite(values)))
        return (
            f"{undefined} of {values.size} trials have no value: {self.name}" if undefined else ""
        )

    @property
    def few(self) -> str:
        """That they are too few to decide anything, in words; empty when they are not."""
        values = np.empty(0) if self.values is None else self.values
        some = "1 trial" if values.size == 1 else f"{values.size} trials"
        return f"{some}, fewer than five: {self.name}" if values.size < LEAST_TRIALS else ""

    @property
    def hardly_varies(self) -> bool:
        """Whether nearly all trials are equal, though those of this measure could differ."""
        return not self.support.exact and hardly_varies(np.asarray(self.values, float))

    @property
    def censored(self) -> int:
        """How many trials sit at the cap of their measure."""
        if self.values is None or not self.support.capped:
            return 0
        slack = ROUNDING * max(1.0, abs(self.support.high))
        return int(np.count_nonzero(self.values >= self.support.high - slack))

    @property
    def blind(self) -> str:
        """What their spread does not tell, in words; empty where it tells."""
        if self.values is None:
            return ""
        if self.censored:
            return f"{self.censored} of {self.values.size} trials at the cap: {self.name}"
        if not self.hardly_varies:
            return ""
        spread = "no spread" if np.ptp(self.values) == 0 else "hardly any spread"
        return f"{spread} in {self.values.size} trials: {self.name}"


def hardly_varies(values: Floats) -> bool:
    """Whether three quarters or more of the trials are one and the same number."""
    middle = np.median(values)
    slack = ROUNDING * max(1e-300, float(np.abs(values).max()))
    return bool(np.mean(np.abs(values - middle) <= slack) >= NEARLY_ALL)


Terms = tuple[tuple[float, Trials], ...]


def reach(terms: Terms) -> tuple[float, float]:
    """The least and the largest effect that there can be, of what the measures can be."""
    low = high = 0.0
    for weight, trials in terms:
        if weight == 0:  # it bears on nothing, however far it reaches
            continue
        support = trials.support
        ends = weight * support.low, weight * (math.inf if support.capped else support.high)
        low, high = low + min(ends), high + max(ends)
    return low, high


def difference(a: Trials, b: Trials, scale: float = 1.0) -> Terms:
    """The effect mean(a) - scale mean(b).

    A scale of 0.9 with a margin of zero states "a is lower than b by no more than 10% of b".
    """
    return ((1.0, a), (-scale, b))


def jackknife_pseudovalues(statistic: Callable[..., float], *samples: Floats) -> list[Floats]:
    """A statistic of several samples as a sum of means over their trials (Tukey, 1958).

    What is no mean (a silhouette, a ratio) becomes terms of a part: one number per trial, the
    jackknife's pseudo-value about the statistic of all trials, in the first sample together with
    that statistic itself.  Their means add up to it, and their variances to the jackknife's.  Of a
    mean, they are the values themselves; of a difference of means, those of the first sample less
    the other's mean, and those of the other about its mean, negative.

    `statistic` takes the samples, each with trials on its first axis, and must be smooth: the
    variance of a median or of a count is not found in this way.
    """
    whole = statistic(*samples)
    found = []
    for place, sample in enumerate(samples):
        without = np.array(
            [
                statistic(*samples[:place], np.delete(sample, trial, axis=0), *samples[place + 1 :])
                for trial in range(len(sample))
            ]
        )
        found.append((len(sample) - 1) * (without.mean() - without))
    found[0] = found[0] + whole
    return found
