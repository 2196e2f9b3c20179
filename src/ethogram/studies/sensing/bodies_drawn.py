"""Robots drawn: their bodies as cubes, and one that moves, seen from its side."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

from ethogram.core.scene import Scene
from ethogram.studies.plotting import INK, PAGE_WIDTH, Row, new_figure, svg

if TYPE_CHECKING:  # slow to load, and only drawing needs it
    from matplotlib.axes import Axes

DEPTH = (0.42, 0.26)  # how far right and up on paper a unit of depth goes
FACES = (  # of a cube: the neighbour that would hide it, its colour in light from above, corners
    ((0, 0, 1), "#b9d9ee", ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))),
    ((1, 0, 0), "#4a8fbd", ((1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1))),
    ((0, -1, 0), "#7fb8dc", ((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1))),
)
CORNERS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])  # of a square, in half edges
MILLIMETRES = 1000.0  # in a metre, the unit of scenes
ACROSS = 4  # frames in a row
MARGIN = 3.0  # mm around the robot
STRIP_COLUMNS = ("frame", "voxel", "x (mm)", "z (mm)", "angle (degrees)", "edge (mm)", "state")


def draw_bodies(bodies: Mapping[str, Int[np.ndarray, "voxel 3"]]) -> str:
    """Bodies by name, as cubes, seen from the front (low y), from above and from the right."""
    across = min(ACROSS, len(bodies))
    sizes = {body: _size(cells) for body, cells in bodies.items()}
    right, up = np.max(list(sizes.values()), 0)
    tall = PAGE_WIDTH / ACROSS * up / right
    down = math.ceil(len(bodies) / across)
    drawing, panels = new_figure(
        down, across, width=PAGE_WIDTH * across / ACROSS, height=down * (tall + 0.45)
    )
    for panel in panels.flat:
        panel.set_axis_off()
    for panel, (body, cells) in zip(panels.flat, bodies.items(), strict=False):
        panel.set_title(f"{body}, {len(cells)} voxels")
        _draw_body(panel, cells)
        panel.set(xlim=(-0.1, right + 0.1), ylim=(-0.1, up + 0.1), aspect="equal")
    return svg(drawing)


def _draw_body(panel: "Axes", cells: Int[np.ndarray, "voxel 3"]) -> None:
    """What is further away, lower and further left first."""
    from matplotlib.patches import Polygon

    filled = {tuple(cell) for cell in cells.tolist()}
    for x, y, z in sorted(filled, key=lambda cell: (-cell[1], cell[2], cell[0])):
        for (right, back, up), colour, corners in FACES:
            if (x + right, y + back, z + up) not in filled:
                face = [_on_paper(x + i, y + j, z + k) for i, j, k in corners]
                panel.add_patch(Polygon(face, facecolor=colour, edgecolor=INK, lw=0.7))


def _on_paper(x: float, y: float, z: float) -> tuple[float, float]:
    return x + DEPTH[0] * y, z + DEPTH[1] * y


def _size(cells: Int[np.ndarray, "voxel 3"]) -> tuple[float, float]:
    """Width and height on paper, in edges."""
    return _on_paper(*(float(size) for size in cells.max(0) + 1))


def draw_strip(scene: Scene, frames: Sequence[int]) -> tuple[str, list[Row]]:
    """Frames of a scene side by side, as a drawing and as rows of `STRIP_COLUMNS`.

    A cube is a square of the edge that is commanded to it, turned as far as it is turned about y.
    All frames show the same place, so that a robot is seen to get ahead.
    """
    from matplotlib.patches import Patch

    squares = {frame: _squares(scene, frame) for frame in frames}
    left, bottom = np.min([each.min((0, 1)) for each in squares.values()], 0) - MARGIN
    right, top = np.max([each.max((0, 1)) for each in squares.values()], 0) + MARGIN
    bottom = min(bottom, -MARGIN)
    across = min(ACROSS, len(frames))
    down = math.ceil(len(frames) / across)
    tall = PAGE_WIDTH / ACROSS * (top - bottom) / (right - left)
    wide = PAGE_WIDTH * max(across, 2) / ACROSS  # the legend has room
    drawing, panels = new_figure(down, across, width=wide, height=0.75 + down * (tall + 0.25))
    for panel in panels.flat[len(frames) :]:
        panel.set_axis_off()
    for panel, (frame, corners) in zip(panels.flat, squares.items(), strict=False):
        _draw_frame(panel, scene, frame, corners)
        panel.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", yticks=[])
        panel.spines["left"].set_visible(False)
        panel.spines["bottom"].set_position(("data", 0.0))  # the floor
        panel.grid(visible=False)
    for panel in panels[-1]:
        panel.set_xlabel("x (mm)")
    drawing.legend(
        handles=[
            Patch(facecolor=tint.colour, edgecolor=INK, lw=0.5, label=tint.label)
            for tint in scene.palette
        ],
        loc="outside upper left",
        ncols=len(scene.palette),
        borderaxespad=0.2,
    )
    return svg(drawing), [row for frame in frames for row in _rows(scene, frame)]


def _draw_frame(
    panel: "Axes", scene: Scene, frame: int, corners: Float[np.ndarray, "shape 4 2"]
) -> None:
    """One frame, what is further away (high y) first."""
    from matplotlib.patches import Polygon

    for shape in np.argsort(-scene.position[frame, :, 1], kind="stable"):
        tint = int(scene.tint[frame, shape])
        if tint >= 0:
            colour = scene.palette[tint].colour
            panel.add_patch(Polygon(corners[shape], facecolor=colour, edgecolor=INK, lw=0.6))
    panel.set_title(scene.captions[frame] if scene.captions else "", fontweight="normal")


def _squares(scene: Scene, frame: int) -> Float[np.ndarray, "shape 4 2"]:
    """Corners (mm) of each cube's side."""
    angle, half = _angles(scene, frame), _edges(scene, frame) / 2
    cos, sin = np.cos(angle), np.sin(angle)
    turned = np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], 1)
    centre = MILLIMETRES * scene.position[frame][:, None, ::2]
    found: np.ndarray = centre + half[:, None, None] * (CORNERS @ turned)
    return found


def _angles(scene: Scene, frame: int) -> Float[np.ndarray, "shape"]:
    """How far up (radians) the axis that is +x at rest points, seen from the front."""
    if scene.orientation is None:
        return np.zeros(len(scene.shapes))
    w, x, y, z = scene.orientation[frame].T.astype(float)
    ahead, up = 1 - 2 * (y**2 + z**2), 2 * (x * z - w * y)
    found: np.ndarray = np.arctan2(up, ahead)
    return found


def _edges(scene: Scene, frame: int) -> Float[np.ndarray, "shape"]:
    """Edges (mm), as commanded."""
    half = np.array([shape.size for shape in scene.shapes])
    scale = np.ones(len(half)) if scene.scale is None else scene.scale[frame].astype(float)
    return 2 * MILLIMETRES * half * scale


def _rows(scene: Scene, frame: int) -> list[Row]:
    place = MILLIMETRES * scene.position[frame].astype(float)
    angle, edge = np.degrees(_angles(scene, frame)), _edges(scene, frame)
    return [
        (
            frame,
            shape,
            float(place[shape, 0]),
            float(place[shape, 2]),
            float(angle[shape]),
            float(edge[shape]),
            scene.palette[int(scene.tint[frame, shape])].label,
        )
        for shape in range(len(scene.shapes))
    ]
