"""Claims as they are stated before a run, and the verdicts on them.

A claim has one part for each setting that it speaks of and holds only if every part does.  A part
compares an effect (`ethogram.studies.statistics.effects`) with a margin.  That gives `p_holds`,
small when the effect is credibly on the claimed side of the margin, and `p_fails`, small when it is
credibly on the other side.  "Within" is two one-sided tests (Schuirmann, 1987).

A claim is confirmed by its weakest part (the intersection-union test: p = max p_holds) and refuted
by its strongest counter-example (Bonferroni over k parts: p = k min p_fails).  Twice the smaller of
the two is the claim's p-value, to which Holm's step-down correction (1979) over the claims of the
study is applied.

The interval reported is that of the deciding part at the level that Holm leaves to the claim.  It
lies wholly on one side of the margin exactly when the verdict is a decision, and allows for the
choice of the part among k: both of its ends by Bonferroni, but for the end of a confirmed claim
that is towards the margin.  The part shown is the one that comes out weakest, so this end is too
far in only if that of the truly weakest part is.

What withholds a decision: fewer than five trials in any term of a part; parts that were not run
(a counter-example among the others refutes the claim, but what they agree on does not confirm it);
and a claim that needs more than was run, or has another reservation.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ethogram.core.findings import Claim, ClaimPart, Revision, Side, Verdict
from ethogram.studies.statistics.effects import LEAST_P, Effect, estimate
from ethogram.studies.statistics.intervals import Interval
from ethogram.studies.statistics.needs import Need, shortage
from ethogram.studies.statistics.trials import ROUNDING, Terms, reach

NO_INTERVAL = Interval(None, None)
FAMILY_ERROR = 0.05  # chance of one wrong verdict or more among a study's claims


@dataclass(frozen=True, kw_only=True)
class Part:
    """What a claim says of one setting: where an effect lies relative to a margin.

    The effect is the sum of weight times mean over trials.  Every term has trials of its own; for
    paired trials give the differences as one term.

    "More than" and "less than" are strict, "at least", "at most" and "within" admit the margin
    itself.  This matters only for measures that cannot have any spread: two conditions that always
    earn 99 match, and neither earns more than the other.
    """

    label: str  # what is compared, in words: "0.9 I(always) - I(optional)"
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

    @property
    def bounds(self) -> Interval:
        """Between what the claim puts the effect."""
        if self.side == "within":
            return Interval(-self.margin, self.margin)
        if self.side in ("at least", "more than"):
            return Interval(self.margin, np.inf)
        return Interval(-np.inf, self.margin)

    def admits(self, effect: float) -> bool:
        """Whether the effect is where the claim puts it; off the margin by rounding is on it."""
        terms = [weight * trials.mean for weight, trials in self.terms]
        slack = ROUNDING * max(map(abs, [self.margin, *terms]))
        lower, upper = self.bounds
        on_the_margin = min(abs(effect - lower), abs(effect - upper)) <= slack
        if on_the_margin:
            return self.side not in ("more than", "less than")
        return bool(lower < effect < upper)


@dataclass(frozen=True, kw_only=True)
class ClaimSpec:
    """A claim as stated before the run; it holds if all of its parts do.

    A reservation says why these trials cannot decide the claim, where that is not for want of
    something that it needs.
    """

    number: int  # unique in the study
    statement: str
    test: str
    parts: tuple[Part, ...]
    source: str = ""  # where it is said, for claims that somebody published
    needs: tuple[Need, ...] = ()
    reservation: str = ""
    stated: str = ""  # the date on which the test was first stated
    history: tuple[Revision, ...] = ()  # changes since then, oldest first
    depends_on: tuple[str, ...] = ()  # measures or readings under which the verdict is another

    def __post_init__(self) -> None:
        if not self.parts:
            raise ValueError(f"claim {self.number} has no part to test")

    @property
    def lack(self) -> str:
        """Which conditions were not run: the first few by name, the others counted."""
        names = list(dict.fromkeys(name for part in self.parts for name in part.missing))
        more = f"; and {len(names) - 3} more" if len(names) > 3 else ""
        return f"not run: {'; '.join(names[:3])}{more}" if names else ""

    @property
    def withheld(self) -> str:
        """Why the claim is decided neither way, in words; empty where it may be."""
        return "; ".join(filter(None, [shortage(self.needs), self.reservation]))


def tests_revised(known: str) -> Revision:
    """What became of the tests of all claims when it was known how few trials deceive them."""
    return Revision(
        date="2026-11-29",
        change="The test of every part: Hall's transformation beside Welch's t, both stretched; "
        "trials without spread bounded by what their measure can be, censored ones open; below "
        "five trials no decision; intervals of several parts simultaneous.",
        reason="Equal trials were taken as certain, and skewed ones decided too often.",
        known=known,
    )


def judge(specs: Sequence[ClaimSpec]) -> list[Claim]:
    """Test a study's claims together and return them with verdicts, in the order given.

    Tested are the parts whose conditions were all run.  A claim without any is "not run".  It takes
    no share of the correction, nor does one of which every part has too few trials.  A claim of
    which some parts were not run, or cannot be tested for want of trials or of a defined value, can
    be refuted and not confirmed; the note of an undecided claim says so, which way it leans, and
    about how many trials would decide it.
    """
    tested = [[_test(part) for part in spec.parts if not part.missing] for spec in specs]
    p_values = [_p_value(parts) for parts in tested if _testable(parts)]
    corrected = iter(holm(p_values))
    return [
        _conclude(spec, parts, next(corrected) if _testable(parts) else None)
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


@dataclass(frozen=True)
class _Tested:
    """A part with its two one-sided p-values, which are 1 where it cannot be tested."""

    part: Part
    effect: Effect | None = None  # None where it is not defined
    few: bool = False  # trials: an effect, and nothing to judge it by
    p_holds: float = 1.0
    p_fails: float = 1.0
    note: str = ""

    @property
    def admitted(self) -> bool:
        """Whether the estimate, whatever its error, is where the claim puts the effect."""
        return self.effect is not None and self.part.admits(self.effect.mean)

    def interval(self, below: float, above: float) -> Interval:
        """The bounds of the effect, each at its one-sided chance of error, as far as it can be."""
        if self.effect is None or self.few:
            return NO_INTERVAL
        low, high = reach(self.part.terms)
        return Interval(max(low, self.effect.lower(below)), min(high, self.effect.upper(above)))


def _test(part: Part, times: float = 1.0) -> _Tested:
    """A part tested, on so many times the trials that there are, spread as these are."""
    every = [trials for _, trials in part.terms]
    defects = [trials.defect for trials in every if trials.defect]
    if defects:
        return _Tested(part, note="; ".join(defects))
    few = [trials.few for trials in every if trials.few]
    if few:
        mean = sum(weight * trials.mean for weight, trials in part.terms)
        return _Tested(part, Effect(mean), few=True, note="; ".join(few))
    effect = estimate(part.terms).of_more_trials(times)
    if effect.certain:
        holds = part.admits(effect.mean)
        p_holds, p_fails = (LEAST_P, 1.0) if holds else (1.0, LEAST_P)
        return _Tested(part, effect, p_holds=p_holds, p_fails=p_fails)
    lower, upper = part.bounds
    return _Tested(
        part,
        effect,
        p_holds=max(effect.above(lower), effect.below(upper)),
        p_fails=min(effect.below(lower), effect.above(upper)),
        note="; ".join(dict.fromkeys(trials.blind for trials in every if trials.blind)),
    )


def _testable(parts: Sequence[_Tested]) -> bool:
    return any(not one.few for one in parts)


def _p_confirm(parts: Sequence[_Tested]) -> float:
    return max(one.p_holds for one in parts)


def _p_refute(parts: Sequence[_Tested]) -> float:
    return len(parts) * min(one.p_fails for one in parts)


def _p_value(parts: Sequence[_Tested]) -> float:
    return min(1.0, 2.0 * min(_p_confirm(parts), _p_refute(parts)))


def _conclude(spec: ClaimSpec, parts: Sequence[_Tested], corrected: Corrected | None) -> Claim:
    """Verdict, and the effect and interval of the part, of those tested, on which it rests."""
    if not parts:
        return _claim(spec, "not run", spec.parts[0], note=spec.lack)
    verdict: Verdict = "undecided"
    level = FAMILY_ERROR if corrected is None else corrected.level
    each = level / len(parts) / 2
    decisive = max(parts, key=lambda one: (one.p_holds, not one.admitted))
    interval = decisive.interval(each, each)
    if corrected is not None and corrected.rejected:
        if _p_confirm(parts) < _p_refute(parts):
            verdict, interval = "confirmed", _of_the_weakest(decisive, level / 2, each)
        else:
            verdict, decisive = "refuted", min(parts, key=lambda one: one.p_fails)
            interval = decisive.interval(each, each)
    if spec.withheld or (spec.lack and verdict == "confirmed"):
        verdict = "undecided"
    undecided = verdict == "undecided"
    lack = spec.lack if undecided else ""
    rests = f"rests on: {decisive.part.label}" if len(spec.parts) > 1 else ""
    leans = _leaning(parts) if undecided else ""
    more = "" if not undecided or spec.withheld or spec.lack else _more_trials(parts, level)
    return _claim(
        spec,
        verdict,
        decisive.part,
        effect=None if decisive.effect is None else decisive.effect.mean,
        interval=interval,
        p_value=None if corrected is None else corrected.p_value,
        note="; ".join(filter(None, [spec.withheld, lack, rests, decisive.note, leans, more])),
        parts=_told_apart(spec, parts, each),
    )


def _told_apart(spec: ClaimSpec, tested: Sequence[_Tested], each: float) -> tuple[ClaimPart, ...]:
    """Every part of a claim that has several, in its order; the tested ones with intervals."""
    left = iter(tested)
    found = [_Tested(part) if part.missing else next(left) for part in spec.parts]
    if len(found) == 1:
        return ()
    return tuple(_claim_part(one, one.interval(each, each)) for one in found)


def _claim_part(one: _Tested, interval: Interval) -> ClaimPart:
    missing = f"not run: {'; '.join(one.part.missing)}" if one.part.missing else ""
    return ClaimPart(
        compared=one.part.label,
        effect=None if one.effect is None else one.effect.mean,
        low=interval.low,
        high=interval.high,
        unit=one.part.unit,
        side=one.part.side,
        margin=float(one.part.margin),
        note=missing or one.note,
    )


def _of_the_weakest(one: _Tested, near: float, far: float) -> Interval:
    """Of a part chosen as the weakest: the end towards the margin needs no correction.

    "Within" has two margins and is nearest to one: the other end reaches no further than the other
    margin, beyond which the verdict says that the effect is not.
    """
    assert one.effect is not None  # a part without one confirms nothing
    lower, upper = one.part.bounds
    low_is_near = one.effect.above(lower) > one.effect.below(upper)
    if low_is_near:
        low, high = one.interval(near, far)
        return Interval(low, max(low, min(high, upper)))
    low, high = one.interval(far, near)
    return Interval(min(high, max(low, lower)), high)


def _leaning(parts: Sequence[_Tested]) -> str:
    """Which way the estimates point, whatever their error."""
    known = [one for one in parts if one.effect is not None]
    if not known:
        return ""
    admitted = sum(one.admitted for one in known)
    if admitted == len(known):
        return "leans towards the claim"
    some = f" in {len(known) - admitted} of {len(known)} parts" if len(known) > 1 else ""
    return f"leans against the claim{some}"


def _more_trials(parts: Sequence[_Tested], level: float) -> str:
    """About how many trials would decide a claim, in words, at the effect and the spread seen.

    Nothing where the test cannot tell: too few trials to know a spread, trials at a cap, or an
    effect so near to its margin that a thousand times as many would not do.
    """
    if any(one.effect is None or one.few for one in parts):
        return ""

    def decides(times: float) -> bool:
        return _p_value([_test(one.part, times) for one in parts]) < level

    enough = next((2.0**power for power in range(1, 11) if decides(2.0**power)), None)
    if enough is None:
        return ""
    least = enough / 2
    while enough - least > 0.01 * enough:
        middle = (least + enough) / 2
        least, enough = (least, middle) if decides(middle) else (middle, enough)
    smallest = min(trials.count for one in parts for _, trials in one.part.terms)
    return (
        f"about {math.ceil(enough * smallest)} trials in place of {smallest} would decide it, if "
        "effect and spread stay as they are"
    )


def _claim(
    spec: ClaimSpec,
    verdict: Verdict,
    part: Part,
    *,
    effect: float | None = None,
    interval: Interval = NO_INTERVAL,
    p_value: float | None = None,
    note: str,
    parts: tuple[ClaimPart, ...] = (),
) -> Claim:
    return Claim(
        number=spec.number,
        statement=spec.statement,
        source=spec.source,
        test=spec.test,
        effect=effect,
        low=interval.low,
        high=interval.high,
        unit=part.unit,
        p_value=p_value,
        verdict=verdict,
        note=note,
        side=part.side,
        margin=float(part.margin),
        compared=part.label,
        stated=spec.stated,
        history=spec.history,
        depends_on=spec.depends_on,
        parts=parts,
    )
