"""Figures 4.3 to 4.6, and those of what lies beyond the thesis."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ethogram.campaign.study import Records
from ethogram.core.findings import Figure
from ethogram.studies.plotting import (
    INK,
    SERIES,
    Row,
    Series,
    data_table,
    draw_band,
    draw_legend,
    fullest,
    new_figure,
    style,
    svg,
)
from ethogram.studies.readings import DEFAULT
from ethogram.studies.rules import results as measure
from ethogram.studies.rules.comparing import USUAL
from ethogram.studies.rules.condition import COLLIDED, NO_RULES, RULES, Collided, Condition
from ethogram.studies.rules.results import Results
from ethogram.studies.rules.validation import GROUPS, HUMANS, SHARES, TRAFFIC
from ethogram.studies.statistics import interval_of_mean
from ethogram.worlds.traffic.graph import Graph, grid_oneway

if TYPE_CHECKING:  # slow to load, and only drawing needs it
    from matplotlib.axes import Axes

LOOK = {RULES: SERIES[0], NO_RULES: SERIES[1]}  # blue with rules and red without, as in the thesis
NUMBER: dict[Collided, str] = {"removed": "4.4", "restored": "4.5"}
QUANTITIES = {"R": "reward R", "E": "efficiency E", "C": "collisions C"}


@style()
def figures(records: Records) -> list[Figure]:
    """Every figure that the records have data for."""
    results = Results.of(records)
    if not results.by_condition:
        return []
    mixed = results.having("mixed_collisions")
    drawn = [
        _graph(),
        *(_training(results, collided) for collided in COLLIDED),
        _traffic(results),
        _mixed(mixed),
        _fines(results),
    ]
    return [figure for figure in drawn if figure is not None]


def _graph() -> Figure:
    """Figure 4.3."""
    graph = grid_oneway()
    drawing, panels = new_figure(1, 1, width=3.2, height=3.2)
    panel = panels[0, 0]
    spots = np.array(graph.places, float)
    for start, end in _ends(graph):
        way = spots[end] - spots[start]
        panel.annotate(
            "",
            xy=spots[end] - 0.12 * way,
            xytext=spots[start] + 0.12 * way,
            arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.2},
        )
    panel.plot(*spots.T, "o", markersize=13, color=SERIES[0].colour)
    for number, spot in enumerate(spots):
        panel.annotate(str(number), spot, color="white", ha="center", va="center", fontsize=7.5)
    panel.set_axis_off()
    panel.set_aspect("equal")
    panel.margins(0.12)
    return Figure(
        name="figure-4-3",
        title="Figure 4.3: The road graph",
        caption="Nine intersections and twelve one-way sections of 100 m with two lanes.",
        alt="A grid of three by three intersections: a clockwise ring, two roads into the centre "
        "from above and below, and two out of it to the sides.",
        svg=svg(drawing),
        data=data_table("figure-4-3", ("from", "to"), list(_ends(graph))),
    )


def _ends(graph: Graph) -> tuple[tuple[int, int], ...]:
    return tuple((section.start, section.end) for section in graph.sections)


def _training(results: Results, collided: Collided) -> Figure | None:
    """Figures 4.4 and 4.5."""
    run = _both(results, collided)
    if not run:
        return None
    drawing, panels = new_figure(1, len(QUANTITIES), share_y=False)
    rows: list[Row] = []
    for panel, (quantity, words) in zip(panels[0], QUANTITIES.items(), strict=True):
        panel.set(title=words, xlabel="updates")
        for at in run:
            data, look = results.by_condition[at], LOOK[at.fines]
            mean = data[f"training_{quantity}"].values.mean(0)
            deviation = data[f"training_{quantity}_deviation"].values.mean(0)
            points = data["point"].values
            low, high = mean - deviation, mean + deviation
            draw_band(panel, points, mean, low, high, look, at.fines.description)
            rows += [
                (at.fines.description, quantity, int(point), float(one), float(spread))
                for point, one, spread in zip(points, mean, deviation, strict=True)
            ]
    draw_legend(drawing, panels[0, 0])
    number = NUMBER[collided]
    name = f"figure-{number.replace('.', '-')}"
    return Figure(
        name=name,
        title=f"Figure {number}: Training with cars {collided}",
        caption="Mean over cars and trials; shaded, as in the thesis, the standard deviation among "
        "cars, mean over trials.",
        alt="Reward, efficiency and collisions against updates, with rules and without.",
        svg=svg(drawing),
        data=data_table(
            name, ("drivers", "quantity", "update", "mean", "deviation among cars"), rows
        ),
    )


def _traffic(results: Results) -> Figure | None:
    """Figure 4.6."""
    run = _both(results, "restored")
    if not run:
        return None
    drawing, panels = new_figure(1, 1, height=2.8)
    panel = panels[0, 0]
    rows: list[Row] = []
    for at in run:
        points = []
        for level in TRAFFIC:
            distance, collisions = (
                np.asarray(results.trials(measure.overall(what, level), at).values)
                for what in ("distance", "collisions")
            )
            points.append((distance.mean() / 1000, collisions.mean()))
            rows.append((at.fines.description, level, *points[-1]))
        _draw_path(panel, points, [str(level) for level in TRAFFIC], LOOK[at.fines], at)
    panel.set(xlabel="distance of all cars, km", ylabel="collisions of all cars")
    draw_legend(drawing, panel)
    return Figure(
        name="figure-4-6",
        title="Figure 4.6: Collisions against distance, by traffic",
        caption="After training with restored cars: sums over all cars of an episode, mean over "
        "trials; the numbers are those of the cars.",
        alt="Collisions against distance for 10 to 80 cars, with rules and without.",
        svg=svg(drawing),
        data=data_table("figure-4-6", ("drivers", "cars", "distance, km", "collisions"), rows),
    )


def _draw_path(
    panel: "Axes",
    points: list[tuple[float, float]],
    labels: list[str],
    look: Series,
    at: Condition,
) -> None:
    x, y = zip(*points, strict=True)
    panel.plot(
        x,
        y,
        color=look.colour,
        linestyle=look.dash,
        marker=look.marker,
        label=at.fines.description,
    )
    for point, label in zip(points, labels, strict=True):
        panel.annotate(label, point, xytext=(3, 3), textcoords="offset points", fontsize=7)


def _mixed(results: Results) -> Figure | None:
    """Collisions of both groups by the share of human drivers."""
    run = _both(results, "restored")
    if not run:
        return None
    drawing, panels = new_figure(len(GROUPS), len(HUMANS), share_y="row")
    rows: list[Row] = []
    for group, row in zip(GROUPS, panels, strict=True):
        shares = [share for share in SHARES if share != (1.0 if group == "driver" else 0.0)]
        for human, panel in zip(HUMANS, row, strict=True):
            for at in run:
                look, label = LOOK[at.fines], at.fines.description
                every = [
                    np.asarray(
                        results.trials(measure.mixed("collisions", human, share, group), at).values
                    )
                    for share in shares
                ]
                samples = np.stack(every, 1)
                low, high = interval_of_mean(samples)
                mean = samples.mean(0)
                draw_band(panel, shares, mean, low, high, look, label, markers=True)
                rows += [
                    (label, human, group, *(float(each) for each in numbers))
                    for numbers in zip(shares, mean, low, high, strict=True)
                ]
        row[0].set_ylabel("C, trained" if group == "driver" else "C, human")
    for human, panel in zip(HUMANS, panels[0], strict=True):
        panel.set_title(human)
    for panel in panels[-1]:
        panel.set_xlabel("share human")
    draw_legend(drawing, fullest(panels))
    return Figure(
        name="mixed",
        title="Collisions among human drivers",
        caption="Collisions of the trained drivers (above) and of the human ones (below), by the "
        "kind of these and their share; means over trials with 95% bands.",
        alt="A panel per kind of human drivers and group: collisions against the share of human "
        "drivers, for drivers trained with rules and without.",
        svg=svg(drawing),
        data=data_table(
            "mixed", ("drivers", "human drivers", "group", "share", "mean", "low", "high"), rows
        ),
    )


def _fines(results: Results) -> Figure | None:
    """The front of distance against collisions."""
    run = [at for at in results.by_condition if at == Condition(at.fines)]
    if all(at.fines in (RULES, NO_RULES) for at in run):
        return None
    drawing, panels = new_figure(1, 1, height=3.2)
    panel = panels[0, 0]
    rows: list[Row] = []
    for at, look in zip(run, _looks(run).values(), strict=True):
        numbers: list[float] = []
        for what in ("efficiency", "collisions"):
            values = np.asarray(results.trials(measure.in_traffic(what, USUAL), at).values)
            low, high = interval_of_mean(values)
            numbers += [float(values.mean()), float(low), float(high)]
        e, e_low, e_high, c, c_low, c_high = numbers
        panel.errorbar(
            e,
            c,
            xerr=[[max(0.0, e - e_low)], [max(0.0, e_high - e)]],
            yerr=[[max(0.0, c - c_low)], [max(0.0, c_high - c)]],
            color=look.colour,
            marker=look.marker,
            linestyle="",
            label=at.fines.description,
        )
        rows.append((at.fines.description, *numbers))
    panel.set(xlabel="efficiency E", ylabel="collisions C")
    draw_legend(drawing, panel, columns=2)
    return Figure(
        name="fines",
        title="Distance against collisions, by the fines",
        caption=f"After training, in traffic of {USUAL} cars: means over trials with 95% "
        "intervals. Drivers want to be on the right, others want them below.",
        alt="Collisions against efficiency, a point for each set of fines.",
        svg=svg(drawing),
        data=data_table("fines", ("fines", "E", "E low", "E high", "C", "C low", "C high"), rows),
    )


def _looks(run: list[Condition]) -> Mapping[Condition, Series]:
    """A look of its own for each set of fines: markers repeat in other colours."""
    count = len(SERIES)
    return {
        at: Series(
            SERIES[number % count].colour, "", SERIES[(number + number // count) % count].marker
        )
        for number, at in enumerate(run)
    }


def _both(results: Results, collided: Collided) -> list[Condition]:
    """With rules and without, as far as they were run."""
    every = (Condition(fines, collided, DEFAULT) for fines in (RULES, NO_RULES))
    return [at for at in every if at in results.by_condition]
