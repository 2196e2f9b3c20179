"""Maps of behaviours: runs that move alike lie near to each other (figures 5.5 and 5.6).

t-SNE makes much of rounding: processors of different kinds draw its maps differently.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float

from ethogram.core.findings import Figure
from ethogram.studies.plotting import Row, data_table, draw_legend, fullest, new_figure, svg
from ethogram.studies.sensing.behaviour import (
    LEAST_MAPPED,
    Behaviours,
    embedded,
    maps_available,
    scaled,
)
from ethogram.studies.sensing.condition import (
    FITNESS,
    VALIDATION,
    Condition,
)
from ethogram.studies.sensing.looks import look
from ethogram.studies.sensing.results import (
    Results,
)

if TYPE_CHECKING:  # slow to load, and only drawing needs it
    from matplotlib.axes import Axes

METHODS: dict[str, Callable[[Behaviours], Float[np.ndarray, "run 2"]]] = {
    "MDS": scaled,
    "t-SNE": embedded,
}
PANEL_HEIGHT = 2.1  # inches
ROOM = 0.08  # of a map's width, around it
VECTOR = (
    "A point is the best robot of a run; behaviour: magnitudes of the Fourier transforms of its "
    "path, x and z, compared by Euclidean distance; robots that diverged are left out. "
)


class Moved(NamedTuple):
    """The behaviour of a run's best robot."""

    condition: Condition
    scenario: str
    run: int  # from 1
    behaviour: Float[np.ndarray, "coefficient"]


Map = list[tuple[Moved, float, float]]


def behaviour_maps(results: Results) -> list[Figure]:
    """Figures 5.5 and 5.6, of the bodies with enough runs; none without scikit-learn."""
    if not maps_available():
        return []
    drawn = [_even(results), _uneven(results, "MDS"), _uneven(results, "t-SNE")]
    return [figure for figure in drawn if figure is not None]


def _even(results: Results) -> Figure | None:
    """Figure 5.5: both maps of each body."""
    moved = _moved(results, "even", (FITNESS,))
    if not moved:
        return None
    drawing, panels = new_figure(
        len(moved), len(METHODS), height=_height(moved), share_x=False, share_y=False
    )
    rows: list[Row] = []
    for line, (body, runs) in zip(panels, moved.items(), strict=True):
        for panel, (method, place) in zip(line, METHODS.items(), strict=True):
            points = _map(runs, place)
            panel.set_title(f"{body}, {method}")
            _draw(panel, points, points)
            rows += [(body, method, *_row(point)) for point in points]
    draw_legend(drawing, fullest(panels))
    return Figure(
        name="figure-5-5",
        title="Figure 5.5: Behaviours of the best robots, even surface",
        caption=f"{VECTOR}Left: multidimensional scaling, in which distances are as near as can be "
        "to the true ones. Right: t-SNE, which shows who is near to whom. Axes have no meaning of "
        "their own.",
        alt=f"Two maps for each of {', '.join(moved)}: a point per run, by controller.",
        svg=svg(drawing),
        data=data_table("figure-5-5", ("morphology", "map", *ROW), rows),
    )


def _uneven(results: Results, method: str) -> Figure | None:
    """Figure 5.6: one map of each body, scenario by scenario."""
    moved = _moved(results, "uneven", VALIDATION)
    if not moved:
        return None
    drawing, panels = new_figure(
        len(moved), len(VALIDATION), height=_height(moved), share_x=False, share_y=False
    )
    rows: list[Row] = []
    for line, (body, runs) in zip(panels, moved.items(), strict=True):
        points = _map(runs, METHODS[method])
        for panel, scenario in zip(line, VALIDATION, strict=True):
            own = [point for point in points if point[0].scenario == scenario]
            panel.set_title(f"{body}, {scenario}")
            _draw(panel, own, points)
            rows += [(body, scenario, *_row(point)) for point in own]
    draw_legend(drawing, fullest(panels))
    name = "figure-5-6" if method == "MDS" else "figure-5-6-t-sne"
    what = "multidimensional scaling" if method == "MDS" else "t-SNE"
    return Figure(
        name=name,
        title=f"Figure 5.6: Behaviours of the best robots in validation, uneven surface ({method})",
        caption=f"{VECTOR}By {what}: one map per body, of all scenarios together; a panel shows "
        "those of one, so that places can be compared along a row.",
        alt=f"A map for each of {', '.join(moved)}, in a panel per validation scenario: a point "
        "per run, by controller.",
        svg=svg(drawing),
        data=data_table(name, ("morphology", "scenario", *ROW), rows),
    )


ROW = ("controller", "run", "first", "second")


def _row(point: tuple[Moved, float, float]) -> Row:
    moved, first, second = point
    return moved.condition.kind, moved.run, first, second


def _moved(
    results: Results, surface: str, scenarios: Sequence[str]
) -> Mapping[str, Sequence[Moved]]:
    """The behaviours on a surface by body, where there are enough for a map."""
    found = {
        body: [
            Moved(at, scenario, run, behaviour)
            for at in results.kinds(body, surface)
            for scenario in scenarios
            for run, behaviour in enumerate(results.behaviours(at, scenario), start=1)
            if np.isfinite(behaviour).all()
        ]
        for body in results.bodies
    }
    return {body: runs for body, runs in found.items() if len(runs) >= LEAST_MAPPED}


def _map(runs: Sequence[Moved], place: Callable[[Behaviours], np.ndarray]) -> Map:
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):  # the same to the last bit, however many threads there are
        found = place(np.stack([run.behaviour for run in runs]))
    return [
        (run, float(first), float(second)) for run, (first, second) in zip(runs, found, strict=True)
    ]


def _height(moved: Mapping[str, Sequence[Moved]]) -> float:
    return 0.4 + PANEL_HEIGHT * len(moved)


def _draw(panel: "Axes", points: Map, framed: Map) -> None:
    """Points, in a frame that all of a map's points fit in, with one scale for both axes."""
    for condition in dict.fromkeys(run.condition for run, _, _ in points):
        series = look(condition)
        panel.plot(
            *zip(*((x, y) for run, x, y in points if run.condition == condition), strict=True),
            color=series.colour,
            marker=series.marker,
            linestyle="",
            fillstyle="none",
            label=condition.kind,
        )
    places = np.array([point[1:] for point in framed])
    middle = (places.min(0) + places.max(0)) / 2
    reach = max(float(np.ptp(places, 0).max()) * (0.5 + ROOM), 1e-9)
    panel.set(
        xlim=middle[0] + reach * np.array([-1, 1]), ylim=middle[1] + reach * np.array([-1, 1])
    )
    panel.set(aspect="equal", adjustable="box", xticks=[], yticks=[])
    panel.spines[["top", "right"]].set_visible(True)
    panel.grid(visible=False)
