"""The measures of the chapter, one number per run, taken from stored records.

A journal's quality is the mean quality of all that it has published, the initial papers too.  A
correlation is over the authors, or the journals, that have both numbers; it is not a number where
fewer than three have, or where either does not vary.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np
import xarray as xr
from jaxtyping import Float
from scipy.stats import rankdata

from ethogram.campaign.study import Records
from ethogram.studies.publishing.condition import SCENARIOS, Condition, Size
from ethogram.studies.publishing.readings import READINGS
from ethogram.studies.statistics import Trials

Measure = Callable[[xr.Dataset], np.ndarray]  # -> [run]
Kind = Literal["pearson", "spearman"]

LAST_YEARS = slice(-5, None)  # whose papers are looked at in the end: one year may have too few
ALL_YEARS = slice(None)  # with the initial papers
FEW = 4  # a fourth of the journals are few
LEAST = 3  # numbers that a correlation needs


class Results(NamedTuple):
    """The stored results by condition, in the order of the figures."""

    by_condition: dict[Condition, xr.Dataset]

    @classmethod
    def of(cls, records: Records) -> "Results":
        """Results by the condition that they say they are of."""
        found = {condition_in(groups["results"].attrs): groups for groups in records.values()}
        return cls({at: found[at]["results"] for at in sorted(found, key=_place)})

    def trials(self, measure: Measure, condition: Condition) -> Trials:
        """One number per run of a condition, or word that it was not run."""
        data = self.by_condition.get(condition)
        if data is None:
            return Trials(self._missing(condition), None)
        return Trials(condition.words, measure(data).astype(float))

    def _missing(self, condition: Condition) -> str:
        """A condition that was not run, with its size if it was run in others."""
        sizes = [
            at.size.words
            for at in self.by_condition
            if replace(at, size=condition.size) == condition
        ]
        if not sizes:
            return condition.words
        return f"{condition.policies} with {condition.size.words} (run: {', '.join(sizes)})"

    @property
    def readings(self) -> list[str]:
        """Under which anything was run."""
        return list(dict.fromkeys(at.reading for at in self.by_condition))

    def least(self, attribute: str, conditions: tuple[Condition, ...]) -> int | None:
        """The least number of years, steps or episodes with which any of some was run."""
        run = [self.by_condition[at] for at in conditions if at in self.by_condition]
        return min((int(data.attrs[attribute]) for data in run), default=None)


def indicator(data: xr.Dataset, name: str) -> Float[np.ndarray, "trial year agent"]:
    """An indicator's values at the end of every year; the first are those at the start."""
    found: np.ndarray = data[f"indicator.{name}"].values.astype(float)
    return found


def latent(data: xr.Dataset, name: str) -> Float[np.ndarray, "trial year agent"]:
    """The quality that an indicator should tell: of the authors, or of what journals published."""
    if data[f"indicator.{name}"].dims[-1] == "author":
        quality = data["author_quality"].values.astype(float)[:, None]
        return np.broadcast_to(quality, indicator(data, name).shape)
    total = data["quality"].values.astype(float).cumsum(1)
    papers = data["papers"].values.cumsum(1)
    return np.where(papers > 0, total / np.maximum(papers, 1), np.nan)


def correlations(
    data: xr.Dataset, name: str, kind: Kind = "pearson"
) -> Float[np.ndarray, "trial year"]:
    """How an indicator goes with the latent quality, at the end of every year."""
    return correlation(indicator(data, name), latent(data, name), kind)


def correlation(
    one: Float[np.ndarray, "*batch agent"], other: Float[np.ndarray, "*batch agent"], kind: Kind
) -> Float[np.ndarray, "*batch"]:
    """Pearson's or Spearman's coefficient along the last axis; undefined numbers are left out."""
    there = np.isfinite(one) & np.isfinite(other)
    one, other = (np.where(there, each, np.nan) for each in (one, other))
    if kind == "spearman":
        one, other = (rankdata(each, axis=-1, nan_policy="omit") for each in (one, other))
    count = there.sum(-1)
    a, b = (
        np.where(there, each, 0.0)
        - np.where(there, each, 0.0).sum(-1, keepdims=True) / np.maximum(count, 1)[..., None]
        for each in (one, other)
    )
    a, b = np.where(there, a, 0.0), np.where(there, b, 0.0)
    scale = np.sqrt((a**2).sum(-1) * (b**2).sum(-1))
    varies = (count >= LEAST) & (scale > 1e-9 * np.maximum(count, 1))
    return np.where(varies, (a * b).sum(-1) / np.where(varies, scale, 1.0), np.nan)


def last_correlation(name: str, kind: Kind = "pearson") -> Measure:
    """How an indicator goes with the latent quality in the end."""

    def measure(data: xr.Dataset) -> np.ndarray:
        return correlations(data, name, kind)[:, -1]

    return measure


def share_of_few(data: xr.Dataset) -> np.ndarray:
    """Share of the papers of all simulated years in the fourth of the journals that has most."""
    papers = data["papers"].values[:, 1:].sum(1)
    most = np.sort(papers, 1)[:, ::-1][:, : max(1, papers.shape[1] // FEW)].sum(1)
    total = papers.sum(1)
    return np.where(total > 0, most / np.maximum(total, 1), np.nan)


def papers_per_year(data: xr.Dataset) -> Float[np.ndarray, "trial year"]:
    """Papers published in every simulated year."""
    found: np.ndarray = data["papers"].values[:, 1:].sum(2).astype(float)
    return found


def growth(data: xr.Dataset) -> np.ndarray:
    """Papers of the last year for each of the first, less 1."""
    papers = papers_per_year(data)
    return papers[:, -1] / np.maximum(papers[:, 0], 1) - 1


def off_centre(data: xr.Dataset, years: slice = LAST_YEARS) -> np.ndarray:
    """Mean quality of the papers of some years less the middle of the range, over the range."""
    whole = float(data.attrs["quality_max"])
    papers = data["papers"].values[:, years].sum((1, 2))
    total = data["quality"].values[:, years].astype(float).sum((1, 2))
    return np.where(papers > 0, total / np.maximum(papers, 1) / whole - 0.5, np.nan)


def skewness(data: xr.Dataset, years: slice = LAST_YEARS) -> np.ndarray:
    """Skewness of the qualities of the papers of some years, from their recorded counts."""
    counts = data["histogram"].values[:, years].sum(1).astype(float)
    at = data["bin"].values
    total = np.maximum(counts.sum(1), 1)
    mean = counts @ at / total
    away = at - mean[:, None]
    deviation = np.sqrt((counts * away**2).sum(1) / total)
    third = (counts * away**3).sum(1) / total
    return np.where(deviation > 0, third / np.where(deviation > 0, deviation, 1.0) ** 3, np.nan)


def stuck(data: xr.Dataset) -> np.ndarray:
    """Share of the authors whose draft, in the end, was rejected more than ten times."""
    found: np.ndarray = data["stuck"].values[:, -1].astype(float)
    return found


def acceptance(data: xr.Dataset) -> np.ndarray:
    """Mean acceptance rate of the journals in the end."""
    return np.nanmean(indicator(data, "acceptance_rate")[:, -1], 1)


def condition_in(attrs: Mapping[str, Any]) -> Condition:
    """What results say that they are of."""
    return Condition(
        attrs["author"], attrs["editor"], Size(*map(int, attrs["size"])), attrs["reading"]
    )


def _place(at: Condition) -> tuple[int, int, str, str]:
    """Where a condition stands: readings in their order, scenarios in that of the figures."""
    readings = list(READINGS)
    reading = readings.index(at.reading) if at.reading in readings else len(readings)
    plain = Condition(at.author, at.editor, at.size)
    scenario = SCENARIOS.index(plain) if plain in SCENARIOS else len(SCENARIOS)
    return reading, scenario, at.reading, plain.name
