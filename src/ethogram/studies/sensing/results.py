"""The measures of the chapter, one number per run, taken from stored records.

Distances are in mm.  Where fitness was a mean over starts, a distance is the mean over validation
starts, else that from rest; behaviours are always those from rest.  A run whose best robot
diverged has no finite distance: means leave it out, tables say so, and a claim that needs it is
left undecided.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float
from scipy.stats import mannwhitneyu

from ethogram.campaign.study import Records
from ethogram.core.findings import Measured
from ethogram.learners.evolution import WORST_FITNESS
from ethogram.studies import chapter
from ethogram.studies.chapter import Measure
from ethogram.studies.sensing.behaviour import Behaviours, behaviours
from ethogram.studies.sensing.condition import (
    FITNESS,
    MORPHOLOGIES,
    NON_SENSING_LAWS,
    OUTPUTS,
    SCENARIOS,
    VALIDATION,
    Condition,
)
from ethogram.studies.statistics import (
    LEAST_TRIALS,
    Support,
    Trials,
    bounded,
    jackknife_pseudovalues,
    measured,
)

MILLIMETRES = 1000.0  # in a metre
VALIDATED = "start_distance"  # the variable: distances from validation starts (m)


@dataclass(frozen=True)
class Results(chapter.Results[Condition]):
    """The stored results, and what the robots looked like, by condition."""

    scenes: dict[Condition, xr.Dataset]

    @classmethod
    def of(cls, records: Records) -> "Results":
        """Results by the condition that they say they are of, in the order of the tables."""
        found = {_condition(groups["results"].attrs): groups for groups in records.values()}
        voxels = {at: int(groups["results"].attrs["voxels"]) for at, groups in found.items()}
        run = sorted(found, key=lambda at: _place(at, voxels[at]))
        return cls(
            {at: found[at]["results"] for at in run},
            {at: found[at]["scene"] for at in run if "scene" in found[at]},
        )

    @property
    def bodies(self) -> list[str]:
        """Of which anything was run."""
        return list(dict.fromkeys(at.body for at in self.by_condition))

    def on(self, surface: str) -> list[Condition]:
        """The conditions that were run on a surface."""
        return [at for at in self.by_condition if at.surface == surface]

    def kinds(self, body: str, surface: str) -> list[Condition]:
        """The controllers that a body was run with on a surface and that moved it comparably.

        Behaviours can be compared if their paths were sampled at the same times; those that were
        not as the first was are left out.
        """
        run = [at for at in self.on(surface) if at.body == body]
        return [at for at in run if self._times(at) == self._times(run[0])]

    def behaviours(self, condition: Condition, scenario: str) -> Behaviours:
        """How the best robots of a condition that was run move (mm), run by run."""
        data = self.by_condition[condition]
        path = data["path"].sel(scenario=scenario).transpose("trial", "axis", "sample")
        return behaviours(MILLIMETRES * path.values.astype(float))

    def comparable(self, one: Condition, other: Condition) -> bool:
        """Whether two conditions were run and their paths sampled at the same times."""
        both = {one, other} <= self.by_condition.keys()
        return both and self._times(one) == self._times(other)

    def _times(self, condition: Condition) -> list[float]:
        times: list[float] = self.by_condition[condition]["sample"].values.tolist()
        return times


def distance(scenario: str) -> Measure:
    """How far the best robot of each run goes (mm), from rest or on average over fresh starts."""

    def measure(data: xr.Dataset) -> np.ndarray:
        chosen = over_starts if is_over_starts(data) else from_rest
        return chosen(scenario)(data)

    return measure


def is_over_starts(data: xr.Dataset) -> bool:
    """Whether a distance is the mean over validation starts: where fitness was a mean, too."""
    return VALIDATED in data and int(data.attrs["starts"]) > 1


def over_starts(scenario: str) -> Measure:
    """How far the best robot of each run goes on average over validation starts (mm)."""

    def measure(data: xr.Dataset) -> np.ndarray:
        return _from_starts(data, scenario).mean(1)

    return measure


def from_rest(scenario: str) -> Measure:
    """How far the best robot of each run goes from the start at rest (mm)."""

    def measure(data: xr.Dataset) -> np.ndarray:
        return MILLIMETRES * data["distance"].sel(scenario=scenario).values.astype(float)

    return measure


def start_spread(scenario: str) -> Measure:
    """Standard deviation over validation starts of how far a run's best robot goes (mm)."""

    def measure(data: xr.Dataset) -> np.ndarray:
        return _from_starts(data, scenario).std(1)

    return measure


def trained(data: xr.Dataset) -> np.ndarray:
    """The fitness that the best robot of each run has in evolution (mm)."""
    last: np.ndarray = MILLIMETRES * data["fitness"].isel(generation=-1).values.astype(float)
    return np.where(last > MILLIMETRES * WORST_FITNESS, last, np.nan)


def _from_starts(data: xr.Dataset, scenario: str) -> Float[np.ndarray, "run start"]:
    found = data[VALIDATED].sel(scenario=scenario).transpose("trial", "start")
    return MILLIMETRES * found.values.astype(float)


def further(scenario: str, other: str) -> Measure:
    """How much further the best robot of each run goes in one scenario than in another (mm)."""
    one, two = distance(scenario), distance(other)

    def measure(data: xr.Dataset) -> np.ndarray:
        return one(data) - two(data)

    return measure


def validated(*, above: bool) -> Measure:
    """In how many validation scenarios a run's ratio of distance to fitness is above 1, or below.

    Of a positive fitness, above 1 is to go further than the fitness; this is what is counted.
    """

    @bounded(lambda _: Support(low=0.0, high=float(len(VALIDATION))))
    def measure(data: xr.Dataset) -> np.ndarray:
        gained = np.stack([further(scenario, FITNESS)(data) for scenario in VALIDATION])
        count = (gained > 0 if above else gained < 0).sum(0).astype(float)
        return np.where(np.isfinite(gained).all(0), count, np.nan)

    return measure


def diverged(data: xr.Dataset) -> int:
    """Robots whose simulation diverged, of all that were evaluated in evolution."""
    return int(data["diverged"].sum())


def sound(trials: Trials) -> Trials:
    """The runs that have a value; not run where none has."""
    if trials.values is None:
        return trials
    kept = trials.values[np.isfinite(trials.values)]
    return Trials(trials.name, kept if kept.size else None)


def u_test(one: Trials, other: Trials) -> float | None:
    """Two-sided p of Mann and Whitney's U test over runs; None with fewer than two on a side.

    Exact for few runs without ties, as SciPy chooses.
    """
    a, b = sound(one).values, sound(other).values
    if a is None or b is None or min(a.size, b.size) < 2:
        return None
    return float(mannwhitneyu(a, b, alternative="two-sided").pvalue)


def ratio(data: xr.Dataset, scenario: str, published: float | None = None) -> Measured | None:
    """Mean distance in a validation scenario over mean fitness, with its interval.

    A ratio of means is no mean: its interval is that of the jackknife's pseudo-values, a number for
    each run.  None where a robot did not go forward in evolution: a ratio would say nothing.
    """
    pairs = np.stack([distance(scenario)(data), distance(FITNESS)(data)], 1)
    pairs = pairs[np.isfinite(pairs).all(1)]
    if not pairs.size or (pairs[:, 1] <= 0).any():
        return None
    if len(pairs) < LEAST_TRIALS:
        own = pairs[:, 0] / pairs[:, 1]
        value, low, high = _of_means(pairs), float(own.min()), float(own.max())
        return Measured(value=value, low=low, high=high, published=published, bounds="range")
    (each,) = jackknife_pseudovalues(_of_means, pairs)
    return measured(Trials(f"ratio, {scenario}", each), published=published)


def _of_means(pairs: np.ndarray) -> float:
    over, under = pairs.mean(0)
    return float(over / under)


def ratios_above_one(
    datasets: Sequence[xr.Dataset], published: float | None = None
) -> Measured | None:
    """In how many cases, a data set in a validation scenario, the ratio of means is above 1."""
    counts = []
    for data in datasets:
        gained = np.stack([further(scenario, FITNESS)(data) for scenario in VALIDATION], 1)
        gained = gained[np.isfinite(gained).all(1)]
        if not gained.size:
            return None
        counts.append((gained.mean(0) > 0).sum())
    return Measured(value=float(np.sum(counts)), published=published) if counts else None


def curve(data: xr.Dataset) -> Float[np.ndarray, "run generation"]:
    """Best fitness (mm) of each generation, in the runs of which no whole population diverged."""
    best = data["fitness"].transpose("trial", "generation").values.astype(float)
    kept: np.ndarray = MILLIMETRES * best[(np.isfinite(best) & (best > WORST_FITNESS)).all(1)]
    return kept


def _condition(attrs: Mapping[str, Any]) -> Condition:
    """What results say that they are of."""
    return Condition(*(str(attrs[name]) for name in ("body", "controller", "law", "surface")))


def _place(at: Condition, voxels: int) -> tuple[int, int, int, str, int]:
    """Where a condition stands in a table: the thesis' bodies first, the controllers in order."""
    laws = (*NON_SENSING_LAWS, *OUTPUTS)
    surface, body = _index(tuple(SCENARIOS), at.surface), _index(MORPHOLOGIES, at.body)
    return surface, body, voxels, at.body, _index(laws, at.law)


def _index(known: Sequence[str], name: str) -> int:
    return known.index(name) if name in known else len(known)
