"""Figures 7.1 to 7.9: the initial impact factors, and a grid of snapshots for every scenario.

The thesis' grids have analyses as columns and years as rows; here analyses are rows, so that a page
can hold them.  The last column is the evolution over time, over all runs with a band; snapshots are
of the first run.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from ethogram.campaign.study import Records
from ethogram.core.findings import Figure
from ethogram.studies.plotting import (
    INK,
    SERIES,
    Row,
    data_table,
    draw_legend,
    draw_mean,
    new_figure,
    style,
    svg,
)
from ethogram.studies.publishing.condition import FIGURES, SNAPSHOTS, Condition
from ethogram.studies.publishing.results import (
    Results,
    correlations,
    indicator,
    kept_years,
    latent,
    papers_per_year,
)
from ethogram.studies.readings import DEFAULT
from ethogram.worlds.publishing.impact_2018 import IMPACT_2018

if TYPE_CHECKING:  # slow to load, and only drawing needs it
    from matplotlib.axes import Axes

BINS = 12  # of the distributions that are not of qualities
DOTS = 40  # in a path; matplotlib takes points away from those of more than 128 vertices
_BLUE, _RED, *_ = SERIES


class Analysis(NamedTuple):
    """A row of a grid: what its snapshots show, and the line of its evolution."""

    title: str
    snapshot: Callable[[xr.Dataset, int], "Snapshot"]
    evolution: Callable[[xr.Dataset], "Evolution"]


class Snapshot(NamedTuple):
    """Points, or bars where there is a width."""

    x: np.ndarray
    y: np.ndarray
    width: float = 0.0


class Evolution(NamedTuple):
    """A number in each of some years, for each run."""

    years: np.ndarray
    values: np.ndarray  # [trial, year]


@style()
def figures(records: Records) -> list[Figure]:
    """Every figure that the records have data for."""
    results = Results.of(records)
    shown = [at for at in results.by_condition if at.reading == DEFAULT]
    if not shown:
        return []
    return [_initial(results), *(_grid(results, at) for at in shown)]


def _initial(results: Results) -> Figure:
    """Figure 7.1, and how near the initial states come to it."""
    drawing, panels = new_figure(1, 1, share_y=False)
    panel = panels[0, 0]
    counts = np.array(IMPACT_2018["journals"])
    rounded, real = np.arange(len(counts)), counts / counts.sum()
    panel.bar(rounded, real, color=_BLUE.colour, alpha=0.35, label="2018, after SCImago")
    rows: list[Row] = [("2018", int(at), float(share)) for at, share in enumerate(real)]
    at = next(at for at in results.by_condition if at.reading == DEFAULT)
    impact = indicator(results.by_condition[at], "impact_factor")[:, 0]
    bins = np.minimum(np.round(np.nan_to_num(impact)), len(counts) - 1).astype(int)
    there = np.isfinite(impact)
    shares = np.array([(there & (bins == bin_)).mean(1) for bin_ in rounded]).mean(1)
    name = f"initial states, {impact.shape[1]} journals"
    panel.plot(rounded, shares, color=_RED.colour, marker=_RED.marker, linestyle="", label=name)
    rows += [(name, int(at), float(share)) for at, share in enumerate(shares)]
    panel.set(xlabel="rounded impact factor, 20: or more", ylabel="share of journals")
    draw_legend(drawing, panel)
    return Figure(
        name="figure-7-1",
        title="Figure 7.1: Impact factors in 2018, and of the initial states",
        caption="Bars: shares of the 24 620 journals by cites per document over two years, "
        f"rounded. Points: mean over the initial states of {impact.shape[0]} runs.",
        alt="A falling distribution; most journals have an impact factor of 0 or 1.",
        svg=svg(drawing),
        data=data_table("figure-7-1", ("series", "rounded impact factor", "share"), rows),
    )


def _grid(results: Results, at: Condition) -> Figure:
    """The snapshots and the evolution of a scenario."""
    data = results.by_condition[at]
    last = int(data.attrs["years"])
    years = [year for year in SNAPSHOTS if year <= last] or [last]
    drawing, panels = new_figure(
        len(ANALYSES),
        len(years) + 1,
        height=0.4 + 1.02 * len(ANALYSES),
        share_x=False,
        share_y=False,
    )
    rows: list[Row] = []
    for analysis, line in zip(ANALYSES, panels, strict=True):
        snapshots = {year: analysis.snapshot(data, year) for year in years}
        for year, panel in zip(years, line, strict=False):
            rows += _draw(panel, snapshots[year], analysis.title, year)
        _share(line[: len(years)])
        rows += _evolve(line[-1], data, analysis)
        line[0].set_ylabel(analysis.title, fontsize=5.5)
        for panel in line:
            panel.tick_params(labelsize=5, length=1.5, pad=1.5)
            panel.locator_params(nbins=3)
    for year, panel in zip(years, panels[0], strict=False):
        panel.set_title(f"year {year}", fontsize=6.5)
    panels[0, -1].set_title("years 0 to " + str(last), fontsize=6.5)
    number = FIGURES.get(at)
    name = f"figure-{number.replace('.', '-')}" if number else f"grid-{at.name.replace('_', '-')}"
    runs = data.sizes["trial"]
    return Figure(
        name=name,
        title=f"{f'Figure {number}: ' if number else ''}{at.description}",
        caption="Distributions and, over authors or journals, pairs at the end of a year, of the "
        "first run. Quality of a journal: mean of all that it has published. Last column: the mean "
        "of a distribution, or the correlation of a pair, against years (of the h-index: those of "
        f"the snapshots); mean of {runs} runs with a 95% band; runs in which it is not "
        "defined in some year are left out.",
        alt=f"A grid: nine analyses, snapshots of {len(years)} years, and the evolution of each.",
        svg=svg(drawing),
        data=data_table(name, ("analysis", "year", "x", "y", "low", "high"), rows),
    )


def _draw(panel: "Axes", seen: Snapshot, title: str, year: int) -> list[Row]:
    there = np.isfinite(seen.x) & np.isfinite(seen.y)
    x, y = seen.x[there], seen.y[there]
    if seen.width:
        edges = np.append(x - seen.width / 2, x[-1:] + seen.width / 2)
        panel.stairs(y, edges, fill=True, color=_BLUE.colour, alpha=0.5, lw=0)
    else:  # paths of dots, each a line without length: a marker each would be ten times as long
        gaps = np.full(len(x), np.nan)
        dots = np.stack([np.stack([one, one, gaps], 1) for one in (x, y)])
        for first in range(0, len(x), DOTS):
            some = dots[:, first : first + DOTS].reshape(2, -1)
            panel.plot(*some, color=_BLUE.colour, lw=1.6, solid_capstyle="round", alpha=0.8)
    return [(title, year, float(a), float(b), None, None) for a, b in zip(x, y, strict=True)]


def _evolve(panel: "Axes", data: xr.Dataset, analysis: Analysis) -> list[Row]:
    years, values = analysis.evolution(data)
    whole = np.isfinite(values).all(1)
    if not whole.any():
        panel.set_axis_off()
        return []
    drawn = draw_mean(panel, years, values[whole], _RED, analysis.title)
    if np.nanmin(values) < 0 < np.nanmax(values):
        panel.axhline(0, color=INK, lw=0.4)
    return [(analysis.title, f"{year:g}", None, mean, low, high) for year, mean, low, high in drawn]


def _share(panels: Any) -> None:
    """The same axes in all snapshots of an analysis, with numbers at the first."""
    for bounds, limit in (("get_xlim", "set_xlim"), ("get_ylim", "set_ylim")):
        found = np.array([getattr(panel, bounds)() for panel in panels])
        for panel in panels:
            getattr(panel, limit)(found[:, 0].min(), found[:, 1].max())
    for panel in panels[1:]:
        panel.tick_params(labelleft=False, labelbottom=False)


# The analyses, in the thesis' order


def _qualities(data: xr.Dataset, year: int) -> Snapshot:
    counts = data["histogram"].values[0, data["year"].values <= year].sum(0)
    at = data["bin"].values
    return Snapshot(at, counts / max(1, counts.sum()), at[1] - at[0])


def _mean_quality(data: xr.Dataset) -> Evolution:
    papers = data["papers"].values.sum(2).cumsum(1)
    total = data["quality"].values.astype(float).sum(2).cumsum(1)
    return Evolution(data["year"].values, total / np.maximum(papers, 1))


def _papers_per_year(data: xr.Dataset) -> Evolution:
    return Evolution(data["year"].values[1:], papers_per_year(data))


def _by_journal(data: xr.Dataset, year: int) -> Snapshot:
    papers = _in_year(data, "papers", indicator(data, "papers"), year)
    return Snapshot(np.arange(1, len(papers) + 1), papers, 1.0)


def _in_year(data: xr.Dataset, name: str, values: np.ndarray, year: int) -> np.ndarray:
    """Of the first run, what an indicator, or what it should tell, is at the end of a year."""
    found: np.ndarray = values[0, list(kept_years(data, name)).index(year)]
    return found


def _distribution(name: str) -> Callable[[xr.Dataset, int], Snapshot]:
    def snapshot(data: xr.Dataset, year: int) -> Snapshot:
        values = indicator(data, name)
        highest = max(np.nanmax(values[0], initial=0.0), 1e-6)
        then = _in_year(data, name, values, year)
        counts, edges = np.histogram(then[np.isfinite(then)], BINS, (0, highest))
        shares = counts / max(1, counts.sum())
        return Snapshot((edges[1:] + edges[:-1]) / 2, shares, edges[1] - edges[0])

    return snapshot


def _mean_of(name: str) -> Callable[[xr.Dataset], Evolution]:
    def evolution(data: xr.Dataset) -> Evolution:
        values = indicator(data, name)
        there = np.isfinite(values)
        count = there.sum(2)
        mean = np.where(there, values, 0.0).sum(2) / np.maximum(count, 1)
        return Evolution(kept_years(data, name), np.where(count > 0, mean, np.nan))

    return evolution


def _pair(name: str) -> Callable[[xr.Dataset, int], Snapshot]:
    def snapshot(data: xr.Dataset, year: int) -> Snapshot:
        quality, values = latent(data, name), indicator(data, name)
        return Snapshot(_in_year(data, name, quality, year), _in_year(data, name, values, year))

    return snapshot


def _correlation_of(name: str) -> Callable[[xr.Dataset], Evolution]:
    def evolution(data: xr.Dataset) -> Evolution:
        later = slice(1, None)  # nobody has an h-index at first
        return Evolution(kept_years(data, name)[later], correlations(data, name)[:, later])

    return evolution


ANALYSES = (
    Analysis("paper quality", _qualities, _mean_quality),
    Analysis("h-index", _distribution("h_index"), _mean_of("h_index")),
    Analysis("impact factor", _distribution("impact_factor"), _mean_of("impact_factor")),
    Analysis("acceptance", _distribution("acceptance_rate"), _mean_of("acceptance_rate")),
    Analysis("papers by journal", _by_journal, _papers_per_year),
    Analysis("h-index, quality", _pair("h_index"), _correlation_of("h_index")),
    Analysis("IF, quality", _pair("impact_factor"), _correlation_of("impact_factor")),
    Analysis("papers, quality", _pair("papers"), _correlation_of("papers")),
    Analysis("acceptance, quality", _pair("acceptance_rate"), _correlation_of("acceptance_rate")),
)
