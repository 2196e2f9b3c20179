"""Verdicts on claims that were stated before the run, and intervals for tables and figures.

The unit of evidence is the independent trial: an agent, an episode or a step of the same trial is
no second witness.  A claim has one part for each setting that it speaks of and holds only if every
part does.  A part compares an effect, a weighted sum of means over trials, with a margin.

The test of a part is Welch's: t = (effect - margin) / error, with the degrees of freedom of
Satterthwaite (1946), so conditions may differ in spread and in the number of trials.  It gives
`p_holds`, small when the effect is credibly on the claimed side of the margin, and `p_fails`,
small when it is credibly on the other side.  "Within" is two one-sided tests (Schuirmann, 1987).

A claim is confirmed by its weakest part (the intersection-union test: p = max p_holds) and refuted
by its strongest counter-example (Bonferroni over k parts: p = k min p_fails).  Twice the smaller of
the two is the claim's p-value, to which Holm's step-down correction (1979) over the claims of the
study is applied.  The interval reported is that of the deciding part at the level that Holm leaves
to the claim, so it lies wholly on one side of the margin exactly when the verdict is a decision.

Two things withhold a decision.  A claim of which only some parts were run is tested on these: a
counter-example among them refutes it, but what they agree on does not confirm it, for want of the
others.  A claim with a reservation is decided neither way.  P-value and interval are in both cases
those of the test.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from ethogram.core.findings import Claim, Measured, Side, Verdict

FAMILY_ERROR = 0.05  # chance of one wrong verdict or more among a study's claims
ROUNDING = 1e-9  # relative to an effect's terms: differences below it are floating point's

Floats = NDArray[np.floating[Any]]


class Interval(NamedTuple):
    """Two bounds: numbers, or arrays of numbers where the statistic is an array."""

    low: Any
    high: Any


def bootstrap_interval(
    samples: Floats,
    statistic: Callable[..., Any] = np.mean,
    *,
    level: float = 0.95,
    resamples: int = 2000,
    seed: int = 0,
) -> Interval:
    """Percentile interval of a statistic over independent trials (Efron, 1979).

    `samples` has trials on its first axis; further axes (time, say) are kept, and a resampled
    trial is taken whole.  `statistic` takes an `axis`, as NumPy's do.  Equal arguments give equal
    intervals, and trials without spread an interval of no width.  An undefined number (NaN) in a
    column makes its bounds NaN.  Raises `ValueError` when there is no trial.
    """
    trials = len(samples)
    if trials == 0:
        raise ValueError("an interval needs at least one trial")
    picks = np.random.default_rng(seed).integers(trials, size=(resamples, trials))
    blocks = math.ceil(resamples * samples.size / 2**22)  # each at most 32 MiB of doubles
    replicas = np.concatenate(
        [statistic(samples[block], axis=1) for block in np.array_split(picks, blocks)]
    )
    tail = (1.0 - level) / 2.0
    return Interval(*np.quantile(replicas, [tail, 1.0 - tail], axis=0))


@dataclass(frozen=True, eq=False)
class Trials:
    """One number per independent trial of a condition; None where the condition was not run."""

    name: str  # in words, for a note: "optional, cooperative, filling hidden"
    values: Floats | None  # [trial]

    def __post_init__(self) -> None:
        if self.values is not None and self.values.ndim != 1:
            raise ValueError(f"{self.name}: one number per trial, not shape {self.values.shape}")

    @property
    def missing(self) -> bool:
        """Whether no trial was run."""
        return self.values is None or self.values.size == 0

    @property
    def defect(self) -> str:
        """What forbids a test on these trials, in words; empty when nothing does."""
        values = np.empty(0) if self.values is None else self.values
        undefined = int(np.count_nonzero(~np.isfinite(values)))
        if undefined:
            return f"{undefined} of {values.size} trials have no value: {self.name}"
        return f"fewer than two trials: {self.name}" if values.size < 2 else ""


def measured(
    trials: Trials, statistic: Callable[..., Any] = np.mean, *, published: float | None = None
) -> Measured | None:
    """A statistic over trials with its bootstrap interval; None where nothing was run."""
    if trials.values is None:
        return None
    low, high = bootstrap_interval(trials.values, statistic)
    value = float(statistic(trials.values))
    return Measured(value=value, low=float(low), high=float(high), published=published)


Terms = tuple[tuple[float, Trials], ...]


def difference(a: Trials, b: Trials, scale: float = 1.0) -> Terms:
    """The effect mean(a) - scale mean(b).

    A scale of 0.9 with a margin of zero states "a is lower than b by no more than 10% of b".
    """
    return ((1.0, a), (-scale, b))


def contributions(statistic: Callable[..., float], *samples: Floats) -> list[Floats]:
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


@dataclass(frozen=True, kw_only=True)
class Part:
    """What a claim says of one setting: where an effect lies relative to a margin.

    The effect is the sum of weight times mean over trials.  Every term has trials of its own; for
    paired trials give the differences as one term.

    "More than" and "less than" are strict, "at least", "at most" and "within" admit the margin
    itself.  This matters only for an effect without spread, which is taken as certain: two
    conditions that always earn 99 match, and neither earns more than the other.
    """

    label: str  # the setting, for a note
    terms: Terms
    side: Side
    margin: float  # "within": the effect lies between -margin and margin
    unit: str

    def __post_init__(self) -> None:
        if not self.terms:
            raise ValueError(f"{self.label}: a part compares at least one condition")
        if self.side == "within" and self.margin < 0:
            raise ValueError(f"{self.label}: nothing lies within the margin {self.margin}")

    @property
    def missing(self) -> list[str]:
        """The conditions that it compares and that were not run."""
        return [trials.name for _, trials in self.terms if trials.missing]


@dataclass(frozen=True, kw_only=True)
class ClaimSpec:
    """A claim as stated before the run; it holds if all of its parts do.

    A reservation, such as "trained for a tenth of the time", says why these trials cannot decide
    the claim: it is tested all the same, and stays undecided whatever the test gives.
    """

    number: int  # unique in the study
    statement: str
    source: str
    test: str
    parts: tuple[Part, ...]
    reservation: str = ""

    def __post_init__(self) -> None:
        if not self.parts:
            raise ValueError(f"claim {self.number} has no part to test")

    @property
    def lack(self) -> str:
        """Which conditions were not run: the first few by name, the others counted."""
        names = list(dict.fromkeys(name for part in self.parts for name in part.missing))
        more = f"; and {len(names) - 3} more" if len(names) > 3 else ""
        return f"not run: {'; '.join(names[:3])}{more}" if names else ""


def judge(specs: Sequence[ClaimSpec]) -> list[Claim]:
    """Test a study's claims together and return them with verdicts, in the order given.

    Tested are the parts whose conditions were all run.  A claim without any is "not run" and
    takes no share of the correction.  A claim of which other parts were not run, or cannot be
    tested for want of a second trial or of a defined value, can be refuted and not confirmed; the
    note of an undecided claim says so.
    """
    tested = [[_test(part) for part in spec.parts if not part.missing] for spec in specs]
    corrected = iter(holm([_p_value(parts) for parts in tested if parts]))
    return [
        _conclude(spec, parts, next(corrected)) if parts else _not_run(spec)
        for spec, parts in zip(specs, tested, strict=True)
    ]


class Corrected(NamedTuple):
    """Holm's verdict on one of a family of hypotheses."""

    p_value: float  # adjusted
    rejected: bool
    level: float  # the share of the family's error at which it was tested or, failing, would be


def holm(p_values: Sequence[float], level: float = FAMILY_ERROR) -> list[Corrected]:
    """Holm's step-down procedure: the smallest of m p-values is held to level / m, and so on.

    It stops at the first that is not rejected; the rest are held to that one's level.
    """
    count = len(p_values)
    corrected: dict[int, Corrected] = {}
    adjusted, share = 0.0, level
    for rank, index in enumerate(np.argsort(p_values, kind="stable")):
        if adjusted < level:  # nothing has failed so far
            share = level / (count - rank)
        adjusted = min(1.0, max(adjusted, (count - rank) * p_values[index]))
        corrected[int(index)] = Corrected(adjusted, adjusted < level, share)
    return [corrected[index] for index in range(count)]


class _Effect(NamedTuple):
    """An estimate with its standard error and that error's degrees of freedom."""

    mean: float
    error: float
    freedom: float

    def below(self, limit: float) -> float:
        """One-sided p-value for "the true effect is at or above the limit"."""
        return float(student.cdf((self.mean - limit) / self.error, self.freedom))

    def above(self, limit: float) -> float:
        """One-sided p-value for "the true effect is at or below the limit"."""
        return float(student.sf((self.mean - limit) / self.error, self.freedom))

    def interval(self, level: float) -> Interval:
        """The two-sided interval that misses the true effect with the chance `level`."""
        if self.error == 0:
            return Interval(self.mean, self.mean)
        reach = float(student.isf(level / 2, self.freedom)) * self.error
        return Interval(self.mean - reach, self.mean + reach)


@dataclass(frozen=True)
class _Tested:
    """A part with its two one-sided p-values; without an effect where it could not be tested."""

    part: Part
    effect: _Effect | None = None
    p_holds: float = 1.0
    p_fails: float = 1.0
    note: str = ""


def _test(part: Part) -> _Tested:
    defects = [trials.defect for _, trials in part.terms if trials.defect]
    if defects:
        return _Tested(part, note="; ".join(defects))
    effect = _estimate(part)
    if effect.error == 0:
        holds = _certainly(part, effect.mean)
        return _Tested(part, effect, float(not holds), float(holds))
    lower, upper = _bounds(part)
    return _Tested(
        part,
        effect,
        p_holds=max(effect.above(lower), effect.below(upper)),
        p_fails=min(effect.below(lower), effect.above(upper)),
    )


def _estimate(part: Part) -> _Effect:
    """Effect, Welch's standard error and Satterthwaite's degrees of freedom.

    Moments are taken about the first trial, so that equal trials have exactly no variance.
    """
    mean, scale, variances, freedoms = 0.0, abs(part.margin), [], []
    for weight, trials in part.terms:
        values = np.asarray(trials.values, dtype=float)
        shifted = values - values[0]
        term = weight * (values[0] + shifted.mean())
        mean += term
        scale = max(scale, abs(term))
        variances.append(weight**2 * shifted.var(ddof=1) / values.size)
        freedoms.append(values.size - 1)
    variance = sum(variances)
    if variance == 0:
        return _Effect(_snapped(mean, part, ROUNDING * scale), 0.0, math.inf)
    shares = [one / variance for one in variances]
    freedom = 1.0 / sum(share**2 / df for share, df in zip(shares, freedoms, strict=True))
    return _Effect(float(mean), math.sqrt(variance), freedom)


def _bounds(part: Part) -> tuple[float, float]:
    """Between what the claim puts the effect."""
    if part.side == "within":
        return -part.margin, part.margin
    if part.side in ("at least", "more than"):
        return part.margin, math.inf
    return -math.inf, part.margin


def _snapped(mean: float, part: Part, tolerance: float) -> float:
    """Put a mean that differs from a bound by rounding on the bound."""
    return next((b for b in _bounds(part) if abs(mean - b) <= tolerance), float(mean))


def _certainly(part: Part, mean: float) -> bool:
    """Whether an effect without spread is where the claim puts it."""
    lower, upper = _bounds(part)
    strict = part.side in ("more than", "less than")
    return lower < mean < upper if strict else lower <= mean <= upper


def _p_confirm(parts: Sequence[_Tested]) -> float:
    return max(one.p_holds for one in parts)


def _p_refute(parts: Sequence[_Tested]) -> float:
    return len(parts) * min(one.p_fails for one in parts)


def _p_value(parts: Sequence[_Tested]) -> float:
    return min(1.0, 2.0 * min(_p_confirm(parts), _p_refute(parts)))


def _not_run(spec: ClaimSpec) -> Claim:
    return Claim(
        number=spec.number,
        statement=spec.statement,
        source=spec.source,
        test=spec.test,
        effect=None,
        low=None,
        high=None,
        unit=spec.parts[0].unit,
        p_value=None,
        verdict="not run",
        note=spec.lack,
    )


def _conclude(spec: ClaimSpec, parts: Sequence[_Tested], corrected: Corrected) -> Claim:
    """Verdict, and the effect and interval of the part, of those tested, on which it rests."""
    verdict: Verdict = "undecided"
    decisive = max(parts, key=lambda one: one.p_holds)
    level = corrected.level / len(parts)
    if corrected.rejected and _p_confirm(parts) < _p_refute(parts):
        verdict, level = "confirmed", corrected.level
    elif corrected.rejected:
        verdict, decisive = "refuted", min(parts, key=lambda one: one.p_fails)
    if spec.reservation or (spec.lack and verdict == "confirmed"):
        verdict = "undecided"
    lack = spec.lack if verdict == "undecided" else ""
    effect = decisive.effect
    interval = Interval(None, None) if effect is None else effect.interval(level)
    rests = f"rests on: {decisive.part.label}" if len(spec.parts) > 1 else ""
    return Claim(
        number=spec.number,
        statement=spec.statement,
        source=spec.source,
        test=spec.test,
        effect=None if effect is None else effect.mean,
        low=interval.low,
        high=interval.high,
        unit=decisive.part.unit,
        p_value=corrected.p_value,
        verdict=verdict,
        note="; ".join(filter(None, [spec.reservation, lack, rests, decisive.note])),
    )
