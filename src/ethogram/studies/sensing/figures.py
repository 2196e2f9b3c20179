"""Figures 5.1 to 5.6."""

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

from ethogram.campaign.study import Records
from ethogram.core.findings import Figure
from ethogram.core.scene import Scene
from ethogram.studies.plotting import (
    Row,
    data_table,
    draw_legend,
    draw_mean,
    fullest,
    new_figure,
    style,
    svg,
)
from ethogram.studies.sensing.bodies_drawn import STRIP_COLUMNS, draw_bodies, draw_strip
from ethogram.studies.sensing.condition import (
    FITNESS,
    OUTPUTS,
    Condition,
    non_sensing,
    sensing,
)
from ethogram.studies.sensing.looks import look
from ethogram.studies.sensing.maps import behaviour_maps
from ethogram.studies.sensing.published import EVEN_FITNESS
from ethogram.studies.sensing.results import (
    MILLIMETRES,
    Results,
    curve,
)
from ethogram.worlds.softbody.bodies import cells_of

if TYPE_CHECKING:  # slow to load, and only drawing needs it
    from matplotlib.axes import Axes

ACROSS = 3  # panels
MEAN_COLUMNS = ("generation", "mean", "low", "high")
PRINTED_AT = 200  # generations
FRAMES = 8  # of figure 5.3: with a frame every 25 steps, a cycle of 40 Hz


@style()
def figures(records: Records) -> list[Figure]:
    """Every figure that the records have data for."""
    results = Results.of(records)
    if not results.by_condition:
        return []
    drawn = [
        _bodies(results),
        _evolution(results),
        _frames(results),
        _path(results),
        *behaviour_maps(results),
    ]
    return [figure for figure in drawn if figure is not None]


def _bodies(results: Results) -> Figure:
    """Figure 5.1."""
    every = results.by_condition.items()
    bodies = {at.body: cells_of(str(data.attrs["layers"])) for at, data in every}
    rows: list[Row] = [
        (body, *(int(place) for place in cell)) for body, cells in bodies.items() for cell in cells
    ]
    return Figure(
        name="figure-5-1",
        title="Figure 5.1: The bodies",
        caption="Voxels at rest, edges of one voxel; robots are to go to the right, along x.",
        alt="; ".join(f"{body}: {len(cells)} cubes" for body, cells in bodies.items()),
        svg=draw_bodies(bodies),
        data=data_table("figure-5-1", ("morphology", "x", "y", "z"), rows),
    )


def _evolution(results: Results) -> Figure | None:
    """Figure 5.2."""
    curves = {at: curve(results.by_condition[at]) for at in results.on("even")}
    curves = {at: best for at, best in curves.items() if len(best)}
    bodies = list(dict.fromkeys(at.body for at in curves))
    if not bodies:
        return None
    across = min(ACROSS, len(bodies))
    drawing, panels = new_figure(math.ceil(len(bodies) / across), across, share_y=False)
    for panel in panels.flat[len(bodies) :]:
        panel.set_axis_off()
    rows: list[Row] = []
    for body, panel in zip(bodies, panels.flat, strict=False):
        panel.set_title(body)
        for at, best in curves.items():
            if at.body == body:
                generation = results.by_condition[at]["generation"].values
                drawn = draw_mean(panel, generation, best, look(at), at.kind)
                rows += [(body, at.kind, *row) for row in drawn]
        rows += _printed(panel, body)
        _logarithmic(panel)
    for panel in panels[-1]:
        panel.set_xlabel("generation")
    for panel in panels[:, 0]:
        panel.set_ylabel("best fitness (mm)")
    draw_legend(drawing, fullest(panels), columns=3)
    return Figure(
        name="figure-5-2",
        title="Figure 5.2: Best fitness during evolution, even surface",
        caption="Mean over runs with 95% bands; the scale is logarithmic. At the right "
        "edge: the thesis' mean after 200 generations.",
        alt="A panel per body: fitness of the best robot against generations, a line per "
        "controller, and what the thesis prints.",
        svg=svg(drawing),
        data=data_table("figure-5-2", ("morphology", "series", *MEAN_COLUMNS), rows),
    )


def _printed(panel: "Axes", body: str) -> list[Row]:
    """What Table 5.2 says of a body, at the panel's right edge."""
    rows: list[Row] = []
    for at in (non_sensing(body, "even"), sensing(body, OUTPUTS[0], "even")):
        if (body, at.controller) in EVEN_FITNESS:
            mean, _ = EVEN_FITNESS[body, at.controller]
            name = f"thesis, {at.controller}"
            panel.plot(
                1.0,
                mean,
                transform=panel.get_yaxis_transform(),
                color=look(at).colour,
                marker="<",
                markersize=7,
                linestyle="",
                clip_on=False,
                label=name,
            )
            rows.append((body, name, PRINTED_AT, float(mean), None, None))
    return rows


def _logarithmic(panel: "Axes") -> None:
    """A logarithmic scale, unless a fitness is not positive."""
    from matplotlib.ticker import NullFormatter

    if panel.dataLim.y0 > 0:
        panel.set_yscale("log")
        panel.yaxis.set_major_formatter("{x:g}")
        panel.yaxis.set_minor_formatter(NullFormatter())


def _frames(results: Results) -> Figure | None:
    """Figure 5.3."""
    at = _example(results.scenes, "biped")
    if at is None:
        return None
    scene = Scene.from_dataset(results.scenes[at])
    frames = range(len(scene.position))[-FRAMES:]
    drawing, rows = draw_strip(scene, frames)
    return Figure(
        name="figure-5-3",
        title=f"Figure 5.3: Frames of a moving robot: {at.description}",
        caption="The best robot of the first run at the end of its simulation, from the side, "
        "in the same place in all frames; time and distance from the start above. Squares have "
        "the edge that is commanded to their voxel. The line is the floor.",
        alt=f"{len(frames)} frames, side views of a robot of {len(scene.shapes)} voxels on a "
        "floor, some of them contracted or expanded.",
        svg=drawing,
        data=data_table("figure-5-3", STRIP_COLUMNS, rows),
    )


def _path(results: Results) -> Figure | None:
    """Figure 5.4, of all output laws of the worm that were run."""
    example = _example(results.by_condition, "worm")
    if example is None:
        return None
    shown = [
        at
        for at in results.on(example.surface)
        if (at.body, at.controller) == (example.body, example.controller)
    ]
    drawing, panels = new_figure(2, 1, share_y=False)
    rows: list[Row] = []
    for at in shown:
        data = results.by_condition[at].sel(scenario=FITNESS).isel(trial=0)
        path = MILLIMETRES * data["path"].astype(float)
        time, series = data["sample"].values, look(at)
        for panel, axis in zip(panels[:, 0], ("x", "z"), strict=True):
            line = path.sel(axis=axis).values
            panel.plot(time, line, color=series.colour, lw=1.0, label=at.kind)
        rows += [
            (at.kind, *(float(number) for number in point))
            for point in zip(
                time, path.sel(axis="x").values, path.sel(axis="z").values, strict=True
            )
        ]
    panels[0, 0].set_ylabel("x (mm)")
    panels[1, 0].set(xlabel="time (s)", ylabel="z (mm)")
    draw_legend(drawing, panels[0, 0])
    body, controller = example.body, example.controller
    return Figure(
        name="figure-5-4",
        title=f"Figure 5.4: Path of the centre of mass: {body}, {controller}, "
        f"{example.surface} surface",
        caption="The best robot of the first run, during fitness evaluation.",
        alt="Two panels against time: how far the centre of mass is ahead, and how high.",
        svg=svg(drawing),
        data=data_table("figure-5-4", ("controller", "time (s)", "x (mm)", "z (mm)"), rows),
    )


def _example(run: Iterable[Condition], body: str) -> Condition | None:
    """The condition of the thesis' example, or the nearest to it that was run."""
    return min(
        run,
        key=lambda at: (at.controller != "sensing", at.surface != "even", at.body != body),
        default=None,
    )
