"""Figures 6.1 to 6.4."""

import math
from typing import TYPE_CHECKING

import numpy as np

from ethogram.campaign.study import Records
from ethogram.core.findings import Figure
from ethogram.studies.criticality.condition import Condition
from ethogram.studies.criticality.plan import EVOLVED
from ethogram.studies.criticality.results import SQUARES, Results, Thresholds
from ethogram.studies.plotting import (
    INK,
    PAGE_WIDTH,
    SERIES,
    Row,
    data_table,
    draw_legend,
    draw_mean,
    new_figure,
    style,
    svg,
)
from ethogram.worlds.softbody.bodies import PLANE, cells_of
from ethogram.worlds.softbody.criticality import threshold

if TYPE_CHECKING:  # slow to load, and only drawing needs it
    from matplotlib.axes import Axes

ACROSS = 4  # panels of figure 6.2
GALLERY = 10  # bodies in a row of figure 6.3


@style()
def figures(records: Records) -> list[Figure]:
    """Every figure that the records have data for."""
    results = Results.of(records)
    drawn = [_thresholds(results), _distributions(results), _gallery(results), _evolution(results)]
    return [figure for figure in drawn if figure is not None]


def _thresholds(results: Results) -> Figure | None:
    """Figure 6.1."""
    data = results.by_condition.get(SQUARES)
    if data is None:
        return None
    found = Thresholds(data)
    voxels = np.arange(found.sides[0] ** 2, found.sides[-1] ** 2 + 1)
    fitted = np.polynomial.polynomial.polyval(voxels, found.coefficients)
    drawing, panels = new_figure(height=2.4)
    panel = panels[0, 0]
    panel.plot(
        found.sides**2,
        found.chosen,
        color=SERIES[0].colour,
        marker=SERIES[0].marker,
        linestyle="",
        label="greatest variance of sizes",
    )
    panel.plot(voxels, fitted, color=SERIES[0].colour, linestyle=SERIES[0].dash, label="parabola")
    original = [threshold(int(n)) for n in voxels]
    panel.plot(
        voxels, original, color=SERIES[1].colour, linestyle=SERIES[1].dash, label="the original's"
    )
    panel.set(xlabel="voxels", ylabel="threshold tau")
    draw_legend(drawing, panel)
    rows: list[Row] = [
        ("chosen", int(side**2), float(tau))
        for side, tau in zip(found.sides, found.chosen, strict=True)
    ]
    rows += [("parabola", int(n), float(tau)) for n, tau in zip(voxels, fitted, strict=True)]
    rows += [("original", int(n), float(tau)) for n, tau in zip(voxels, original, strict=True)]
    return Figure(
        name="figure-6-1",
        title="Figure 6.1: Threshold of activity against the number of voxels",
        caption="Dots: of square bodies, the threshold at which avalanche sizes vary the most. "
        "Beyond 77 voxels the original's parabola is not used; here it stays at its least.",
        alt="Dots that fall with the number of voxels, and parabolas through them.",
        svg=svg(drawing),
        data=data_table("figure-6-1", ("series", "voxels", "threshold"), rows),
    )


def _distributions(results: Results) -> Figure | None:
    """Figure 6.2."""
    data = results.by_condition.get(SQUARES)
    if data is None:
        return None
    found = Thresholds(data)
    down = math.ceil(len(found.sides) / ACROSS)
    drawing, panels = new_figure(down, ACROSS, share_x=False, share_y=False)
    for panel in panels.flat[len(found.sides) :]:
        panel.set_axis_off()
    rows: list[Row] = []
    for place, (side, panel) in enumerate(zip(found.sides, panels.flat, strict=False)):
        panel.set_title(f"{side} x {side}")
        for number, tau in enumerate(found.tried):
            sizes, counts = np.unique(found.sizes(place, number), return_counts=True)
            chosen = tau == found.chosen[place]
            look = SERIES[1] if chosen else SERIES[5]
            panel.scatter(
                np.full(len(sizes), 1e3 * tau), sizes, s=60 * counts / side**2, color=look.colour
            )
            rows += [
                (f"{side} x {side}", float(tau), int(size), int(count))
                for size, count in zip(sizes, counts, strict=True)
            ]
    for panel in panels[-1]:
        panel.set_xlabel("threshold (1e-3)")
    for panel in panels[:, 0]:
        panel.set_ylabel("avalanche size")
    return Figure(
        name="figure-6-2",
        title="Figure 6.2: Avalanche sizes of square bodies at each threshold",
        caption="The area of a dot is the share of the voxels that start an avalanche of that "
        "size. Coloured: the threshold at which sizes vary the most.",
        alt="A panel per square body: sizes fall from all voxels to one as the threshold rises.",
        svg=svg(drawing),
        data=data_table("figure-6-2", ("body", "threshold", "size", "avalanches"), rows),
    )


def _gallery(results: Results) -> Figure | None:
    """Figure 6.3."""
    shown = [at for at in reversed(results.scored) if results.bodies(at)]
    if not shown:
        return None
    lines = [
        list(results.bodies(at).items())[first : first + GALLERY]
        for at in shown
        for first in range(0, min(len(results.bodies(at)), GALLERY), GALLERY)
    ]
    height = PAGE_WIDTH / GALLERY * 1.35 * len(lines)
    drawing, panels = new_figure(len(lines), GALLERY, height=height, share_x=False, share_y=False)
    rows: list[Row] = []
    for at, line, row in zip(shown, lines, panels, strict=True):
        scores = results.by_condition[at]["score"].values
        for panel in row:
            panel.set_axis_off()
        for place, (panel, (name, text)) in enumerate(zip(row, line, strict=False)):
            panel.set_title(f"{name}\n{scores[place]:.2f}", fontsize=5.5, loc="center")
            _draw(panel, text)
            rows.append((name, float(scores[place]), text))
    return Figure(
        name="figure-6-3",
        title="Figure 6.3: Bodies",
        caption="Bodies and their scores; rows from above: "
        + "; ".join(at.description for at in shown)
        + ".",
        alt=f"{len(rows)} bodies of square voxels.",
        svg=svg(drawing),
        data=data_table("figure-6-3", ("body", "score", "cells"), rows),
    )


def _draw(panel: "Axes", text: str) -> None:
    """A body as squares."""
    from matplotlib.patches import Rectangle

    cells = cells_of(text, axes=PLANE)
    for x, y in cells.tolist():
        square = Rectangle((x, y), 1, 1, facecolor="#7fb8dc", edgecolor=INK, lw=0.4)
        panel.add_patch(square)
    side = max(cells.max() + 1, 6)
    panel.set(xlim=(-0.2, side + 0.2), ylim=(-0.2, side + 0.2), aspect="equal")


def _evolution(results: Results) -> Figure | None:
    """Figure 6.4."""
    run = [Condition(name) for name in EVOLVED if Condition(name) in results.by_condition]
    if not run:
        return None
    drawing, panels = new_figure(height=2.4)
    panel = panels[0, 0]
    rows: list[Row] = []
    for series, at in zip(SERIES, run, strict=False):
        data = results.by_condition[at]
        best = data["best"].transpose("trial", "generation").values
        drawn = draw_mean(panel, data["generation"].values, best, series, at.description)
        rows += [(at.description, *row) for row in drawn]
    panel.set(xlabel="generation", ylabel="best score")
    draw_legend(drawing, panel)
    return Figure(
        name="figure-6-4",
        title="Figure 6.4: Criticality during evolution",
        caption="Best score so far: mean over runs with 95% bands.",
        alt="Best score against generations.",
        svg=svg(drawing),
        data=data_table("figure-6-4", ("series", "generation", "mean", "low", "high"), rows),
    )
