"""A traffic episode as a scene: the roads from above, who drives, who is fined, who is dead."""

from typing import NamedTuple

import numpy as np
from jax import Array
from jaxtyping import Bool, Float, Int

from ethogram.core.scene import COLOURS, BackgroundShape, Point, Scene, Shape, Tint
from ethogram.worlds.traffic.graph import Graph
from ethogram.worlds.traffic.state import State

LANE_WIDTH = 5.0  # m, wider than real ones, so that cars can be seen
MARGIN = 15.0  # m around the roads
FINE = 256.0  # m: up to it 16 bits tell an eighth of a metre apart
MARKED = 1.0  # s for which a collision is marked
ROAD, DRIVER, HUMAN, FINED, DEAD, CRASH = range(6)
PALETTE = (
    Tint("a road", COLOURS["silver"]),
    Tint("a driver", COLOURS["blue"]),
    Tint("a given driver", COLOURS["green"]),
    Tint("fined", COLOURS["ochre"]),
    Tint("dead", COLOURS["grey"]),
    Tint("a collision", COLOURS["vermilion"]),
)
# of half a car's length and 1: a box drives, an arrow is fined, a cross is dead
BOX = ((-1, -0.45), (1, -0.45), (1, 0.45), (-1, 0.45))
ARROW = ((-1, -0.6), (0.2, -0.6), (1, 0), (0.2, 0.6), (-1, 0.6), (-0.5, 0))
CROSS = (
    *((-1, -0.6), (-0.6, -1), (0, -0.4), (0.6, -1), (1, -0.6), (0.4, 0)),
    *((1, 0.6), (0.6, 1), (0, 0.4), (-0.6, 1), (-1, 0.6), (-0.4, 0)),
)


class Layout(NamedTuple):
    """Where the elements are in the plane: each a line, in m."""

    origin: Float[np.ndarray, "element 2"]
    direction: Float[np.ndarray, "element 2"]  # of length 1
    extent: Float[np.ndarray, "element"]  # of the line
    offset: Float[np.ndarray, "element"]  # of the rightmost lane's middle, to the right


def record(
    states: State,
    metrics: dict[str, Array],
    graph: Graph,
    *,
    length: Float[np.ndarray, "element"],
    car_length: float,
    time_step: float,
    drivers: int,
) -> Scene:
    """Draw up an episode from the states it reached.

    Args:
        states: arrays with the steps as leading axis.
        metrics: of these steps.
        graph: of the roads.
        length: of its elements, m.
        car_length: m.
        time_step: s.
        drivers: how many cars, the first ones, are the learners'.

    """
    layout = _layout(graph, length)
    bounds = _bounds(layout)
    position, heading = _placed(states, layout, length, len(graph.sections))
    steps, cars = heading.shape
    present = np.asarray(states.present)
    dead = present & (np.asarray(states.dead) > 0)
    fined = present & ~dead & np.asarray(metrics["breaches"]).any(-1)
    crash = _held(np.asarray(metrics["collision"]), round(MARKED / time_step)) & present
    usual = np.where(np.arange(cars) < drivers, DRIVER, HUMAN)
    tint = [
        np.where(present & ~dead & ~fined, usual, -1),
        np.where(fined, FINED, -1),
        np.where(dead, DEAD, -1),
        np.where(crash, CRASH, -1),
    ]
    size = car_length / 2
    headings = [np.tile(heading, (1, 3)), np.full((steps, cars), np.nan)]
    kind = np.float16 if np.abs(bounds).max() < FINE else np.float32
    forms = [BOX, ARROW, CROSS]
    bodies = [Shape("polygon", size, vertices=form) for form in forms for _ in range(cars)]
    groups = [slice(0, drivers), slice(drivers, None)][: 1 + (cars > drivers)]
    return Scene(
        title="Traffic: one episode",
        bounds=bounds,
        frame_seconds=time_step,
        palette=PALETTE,
        shapes=(*bodies, *(Shape("ring", car_length) for _ in range(cars))),
        background=_roads(graph, layout),
        position=np.tile(position, (1, 4, 1)).astype(kind),
        tint=np.concatenate(tint, 1).astype(np.int8),
        heading=np.concatenate(headings, 1).astype(np.float16),
        captions=tuple(
            f"step {step + 1}: {(present & ~dead)[step].sum()} driving, {dead[step].sum()} dead, "
            f"{fined[step].sum()} fined"
            for step in range(steps)
        ),
        series={
            name: _totals(np.asarray(metrics[part]), groups)
            for name, part in (("distance (m)", "distance"), ("collisions", "collision"))
        },
    )


def _layout(graph: Graph, length: Float[np.ndarray, "element"]) -> Layout:
    """Vertices where the graph has them, or on a circle; sections from edge to edge of these."""
    vertices, count = graph.vertices, len(graph.sections)
    angle = 2 * np.pi * np.arange(vertices) / vertices
    radius = length[:count].mean() * vertices / (2 * np.pi)
    round_ = radius * np.stack([np.cos(angle), np.sin(angle)], -1)
    spots = np.array(graph.places, float) if graph.places else round_
    spots = spots - (spots.min(0) + spots.max(0)) / 2
    ends = np.array([(section.start, section.end) for section in graph.sections])
    way = spots[ends[:, 1]] - spots[ends[:, 0]]
    distance = np.maximum(np.linalg.norm(way, axis=1), 1e-9)
    half = np.minimum(length[-1] / 2, distance / 4)
    direction = way / distance[:, None]
    pairs = {(section.start, section.end) for section in graph.sections}
    offset = [
        (section.lanes - 0.5 if (section.end, section.start) in pairs else section.lanes / 2 - 0.5)
        for section in graph.sections
    ]
    return Layout(
        origin=np.concatenate([spots[ends[:, 0]] + half[:, None] * direction, spots]),
        direction=np.concatenate([direction, np.zeros((vertices, 2))]),
        extent=np.concatenate([distance - 2 * half, np.zeros(vertices)]),
        offset=LANE_WIDTH * np.concatenate([offset, np.zeros(vertices)]),
    )


def _placed(
    states: State, layout: Layout, length: Float[np.ndarray, "element"], sections: int
) -> tuple[Float[np.ndarray, "step car 2"], Float[np.ndarray, "step car"]]:
    """Positions and headings; on a vertex a car is on the way to the section it will take."""
    element, leads = np.asarray(states.element), np.asarray(states.exit)
    on_section = element < sections
    section = np.where(on_section, element, leads)
    fraction = np.clip(np.asarray(states.position) / length[element], 0, 1)
    half = length[-1] / 2
    along = np.where(on_section, fraction * layout.extent[section], (fraction - 1) * 2 * half)
    direction = layout.direction[section]
    right = np.stack([direction[..., 1], -direction[..., 0]], -1)
    aside = layout.offset[section] - LANE_WIDTH * (np.asarray(states.lane) - 1)
    position = layout.origin[section] + along[..., None] * direction + aside[..., None] * right
    heading = np.arctan2(direction[..., 1], direction[..., 0])
    return position, heading


def _roads(graph: Graph, layout: Layout) -> tuple[BackgroundShape, ...]:
    shapes = []
    for number, section in enumerate(graph.sections):
        direction = layout.direction[number]
        right = np.array([direction[1], -direction[0]])
        middle = layout.offset[number] - LANE_WIDTH * (section.lanes - 1) / 2
        start = layout.origin[number] + middle * right
        end = start + layout.extent[number] * direction
        width = LANE_WIDTH * section.lanes
        shapes.append(BackgroundShape("line", (_point(start), _point(end)), ROAD, width))
    reach = LANE_WIDTH * graph.max_lanes
    for spot in layout.origin[len(graph.sections) :]:
        corners = (
            spot + reach * np.array(corner) for corner in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        )
        shapes.append(BackgroundShape("polygon", tuple(map(_point, corners)), ROAD))
    return tuple(shapes)


def _bounds(layout: Layout) -> tuple[float, float, float, float]:
    ends = np.concatenate(
        [layout.origin, layout.origin + layout.extent[:, None] * layout.direction]
    )
    margin = MARGIN + float(np.abs(layout.offset).max()) + LANE_WIDTH
    (left, bottom), (right, top) = ends.min(0) - margin, ends.max(0) + margin
    return float(left), float(bottom), float(right), float(top)


def _held(flags: Bool[np.ndarray, "step car"], steps: int) -> Bool[np.ndarray, "step car"]:
    """Flags that stay up for some steps."""
    last = np.where(flags, np.arange(len(flags))[:, None], -steps - 1)
    since: Int[np.ndarray, "step car"] = np.arange(len(flags))[:, None] - np.maximum.accumulate(
        last
    )
    return since <= steps


def _totals(
    values: Float[np.ndarray, "step car"] | Bool[np.ndarray, "step car"], groups: list[slice]
) -> Float[np.ndarray, "step group"]:
    """Sums so far, of each group of cars."""
    return np.stack([values[:, group].sum(1).cumsum(0) for group in groups], -1).astype(float)


def _point(at: Float[np.ndarray, "2"]) -> Point:
    return float(at[0]), float(at[1])
