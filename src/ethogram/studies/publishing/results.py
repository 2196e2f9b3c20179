"""The measures of the chapter, one number per run, taken from stored records.

A journal's quality is the mean quality of all that it has published, the initial papers too, or, as
a further measure, of the papers that its impact factor counts.  A correlation is over the authors,
or the journals, that have both numbers; it is not a number where fewer than three have, or where
either does not vary.  Which years are kept stands with `records`.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any, Literal

import numpy as np
import xarray as xr
from jaxtyping import Float, Int
from scipy.stats import rankdata

from ethogram.campaign.study import Records
from ethogram.studies import chapter
from ethogram.studies.chapter import Measure
from ethogram.studies.publishing.condition import SCENARIOS, Condition, Size
from ethogram.studies.publishing.readings import OF_LEARNED, READINGS
from ethogram.studies.publishing.records import COUNTED_YEARS, LAST_YEARS, PAPERS
from ethogram.studies.statistics import Support, bounded

Kind = Literal["pearson", "spearman"]
Years = Literal["all", "simulated", "last five", "last"]  # all: with the initial papers
Of = Literal["published", "counted"]  # a journal's papers: all, or those its impact factor counts

FEW = 4  # a fourth of the journals are few
LEAST = 3  # numbers that a correlation needs
DRAWS = 1000  # of years in which papers go anywhere


class Results(chapter.Results[Condition]):
    """The stored results by condition, in the order of the figures."""

    @classmethod
    def of(cls, records: Records) -> "Results":
        """Results by the condition that they say they are of."""
        found = {condition_in(groups["results"].attrs): groups for groups in records.values()}
        return cls({at: found[at]["results"] for at in sorted(found, key=_place)})

    def missing(self, condition: Condition) -> str:
        """A condition that was not run, with its size if it was run in others."""
        sizes = [
            at.size.description
            for at in self.by_condition
            if replace(at, size=condition.size) == condition
        ]
        if not sizes:
            return condition.description
        return f"{condition.policies} with {condition.size.description} (run: {', '.join(sizes)})"

    @property
    def readings(self) -> list[str]:
        """Under which anything was run."""
        return list(dict.fromkeys(at.reading for at in self.by_condition))


def indicator(data: xr.Dataset, name: str) -> Float[np.ndarray, "trial kept agent"]:
    """An indicator's values at the end of the years in which it is kept (`kept_years`)."""
    if name == PAPERS:
        return _at_end(data, data["papers"].values.cumsum(1).astype(float))
    found: np.ndarray = data[f"indicator.{name}"].values.astype(float)
    return found


def kept_years(data: xr.Dataset, name: str) -> Int[np.ndarray, "kept"]:
    """The years at whose end an indicator is kept; 0 is that of the initial state."""
    of = "journal" if name == PAPERS else data[f"indicator.{name}"].dims[-1]
    found: np.ndarray = data[f"{of}_year"].values
    return found


def indicators(data: xr.Dataset) -> list[str]:
    """The names of those that there are."""
    prefix = "indicator."
    names = [str(name) for name in data.data_vars]
    kept = [name.removeprefix(prefix) for name in names if name.startswith(prefix)]
    return sorted([*kept, PAPERS])


def latent(
    data: xr.Dataset, name: str, of: Of = "published"
) -> Float[np.ndarray, "trial kept agent"]:
    """The quality that an indicator should tell: of the authors, or of what journals published."""
    if name != PAPERS and data[f"indicator.{name}"].dims[-1] == "author":
        quality = data["author_quality"].values.astype(float)[:, None]
        return np.broadcast_to(quality, indicator(data, name).shape)
    total = data["quality"].values.astype(float).cumsum(1)
    papers = data["papers"].values.cumsum(1).astype(float)
    if of == "published":
        return _mean(_at_end(data, total), _at_end(data, papers))
    return _mean(*(_counted(data, sums) for sums in (total, papers)))


def _mean(
    total: Float[np.ndarray, "*batch"], papers: Float[np.ndarray, "*batch"]
) -> Float[np.ndarray, "*batch"]:
    """Quality per paper, not a number without papers."""
    return np.where(papers > 0, total / np.where(papers > 0, papers, 1), np.nan)


def _at_end(
    data: xr.Dataset, sums: Float[np.ndarray, "trial year journal"], before: int = 0
) -> Float[np.ndarray, "trial kept journal"]:
    """Sums over the years so far, at the end of the years in which indicators of journals are kept.

    Or some years before; not a number where that is before the first or was not kept.
    """
    years, wanted = data["year"].values, data["journal_year"].values - before
    place = np.minimum(np.searchsorted(years, wanted), len(years) - 1)
    there = years[place] == wanted
    return np.where(there[:, None], sums[:, place], np.nan)


def _counted(
    data: xr.Dataset, sums: Float[np.ndarray, "trial year journal"]
) -> Float[np.ndarray, "trial kept journal"]:
    """Sums over the two years before: those of whose papers an impact factor speaks (eq. 7.3)."""
    return _at_end(data, sums, 1) - _at_end(data, sums, 1 + COUNTED_YEARS)


def correlations(
    data: xr.Dataset, name: str, kind: Kind = "pearson", of: Of = "published"
) -> Float[np.ndarray, "trial kept"]:
    """How an indicator goes with the latent quality, at the end of the years that are kept."""
    return correlation(indicator(data, name), latent(data, name, of), kind)


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


def _of_coefficients(data: xr.Dataset) -> Support:
    del data
    return Support(low=-1.0, high=1.0)


_coefficient = bounded(_of_coefficients)


def last_correlation(name: str, kind: Kind = "pearson", of: Of = "published") -> Measure:
    """How an indicator goes with the latent quality in the end."""

    @_coefficient
    def measure(data: xr.Dataset) -> np.ndarray:
        return correlations(data, name, kind, of)[:, -1]

    return measure


@_coefficient
def papers_and_quality(data: xr.Dataset) -> np.ndarray:
    """How the journals' numbers of papers of the last year go with the mean qualities of these."""
    papers = _summed(data, "papers", "last")
    return correlation(papers, _mean(_summed(data, "quality", "last"), papers), "pearson")


def _of_shares(data: xr.Dataset) -> Support:
    """Those that have most have no less than they would have if all had as many."""
    journals = data.sizes["journal"]
    return Support(low=_few(journals) / journals, high=1.0)


@bounded(_of_shares)
def share_of_few(data: xr.Dataset) -> np.ndarray:
    """Share of the papers of all simulated years in the fourth of the journals that has most."""
    return _most(_summed(data, "papers", "simulated"))


@bounded(_of_shares)
def share_in_last_year(data: xr.Dataset) -> np.ndarray:
    """That share of the papers of the last year."""
    return _most(_summed(data, "papers", "last"))


def share_beyond_chance(data: xr.Dataset) -> np.ndarray:
    """That share in the last year, less what chance adds to a fourth.

    Chance: the mean share that the fourth has if each of as many papers goes to any journal.
    """
    papers = _summed(data, "papers", "last")
    journals = papers.shape[1]
    chance = [_share_by_chance(int(total), journals) for total in papers.sum(1)]
    return _most(papers) - np.array(chance) + _few(journals) / journals


def _few(journals: int) -> int:
    return max(1, journals // FEW)


def _most(papers: Float[np.ndarray, "trial journal"]) -> np.ndarray:
    most = np.sort(papers, 1)[:, ::-1][:, : _few(papers.shape[1])].sum(1)
    return _mean(most, papers.sum(1))


@cache
def _share_by_chance(papers: int, journals: int) -> float:
    """The mean over `DRAWS` years; not a number without papers."""
    if papers == 0:
        return np.nan
    years = np.random.default_rng(0).multinomial(papers, [1 / journals] * journals, DRAWS)
    return float(_most(years.astype(float)).mean())


def _summed(data: xr.Dataset, name: str, years: Years) -> Float[np.ndarray, "trial of"]:
    """What was published in some years."""
    last = int(data.attrs["years"])
    five = max(1, last - LAST_YEARS + 1)
    first = {"all": 0, "simulated": 1, "last five": five, "last": last}[years]
    found: np.ndarray = data[name].values[:, data["year"].values >= first].astype(float).sum(1)
    return found


def papers_per_year(data: xr.Dataset) -> Float[np.ndarray, "trial year"]:
    """Papers published in every simulated year that is kept."""
    found: np.ndarray = data["papers"].values[:, 1:].sum(2).astype(float)
    return found


def growth(data: xr.Dataset) -> np.ndarray:
    """Papers of the last year for each of the first, less 1."""
    papers = papers_per_year(data)
    return papers[:, -1] / np.maximum(papers[:, 0], 1) - 1


def off_centre(data: xr.Dataset, years: Years = "last five") -> np.ndarray:
    """Mean quality of the papers of some years less the middle of the range, over the range."""
    papers, total = (_summed(data, name, years).sum(1) for name in ("papers", "quality"))
    return _mean(total, papers) / float(data.attrs["quality_max"]) - 0.5


def skewness(data: xr.Dataset, years: Years = "last five") -> np.ndarray:
    """Skewness of the qualities of the papers of some years, from their recorded counts."""
    counts = _summed(data, "histogram", years)
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
    readings = [*READINGS, *OF_LEARNED]
    reading = readings.index(at.reading) if at.reading in readings else len(readings)
    plain = Condition(at.author, at.editor, at.size)
    scenario = SCENARIOS.index(plain) if plain in SCENARIOS else len(SCENARIOS)
    return reading, scenario, at.reading, plain.name
