"""Scenes in the plane: background, lines, shapes and what they say, as in `templates/plane.js`."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ethogram.core.scene import Scene
from ethogram.report.render.canvas import MUTED, PAPER, Canvas
from ethogram.report.render.labels import draw_label, label_of
from ethogram.report.render.speech import draw_bubbles, draw_leaders, speech_bubbles
from ethogram.report.render.svg_canvas import SvgCanvas

RIMMED = 3  # pixels: larger circles have a rim
MARK = 0.5  # of the radius: how far the mark of a heading reaches beyond the edge
LEAST_MARK = 4.0  # pixels


class View(NamedTuple):
    """How points in the plane come onto the canvas: the same scale on both axes, y upwards."""

    scale: float  # pixels per unit of the positions
    left: float  # pixels, of the point (0, 0)
    top: float

    def project(self, points: Float[np.ndarray, "*any 2"]) -> Float[np.ndarray, "*any 2"]:
        """Where points are on the canvas (pixels)."""
        x, y = np.moveaxis(np.asarray(points, float), -1, 0)
        return np.stack([self.left + self.scale * x, self.top - self.scale * y], -1)


def draw(canvas: Canvas | SvgCanvas, scene: Scene, frame: int) -> None:
    """Draw a frame; lines to words lie under those who can say some."""
    view = _view(canvas, scene)
    places = _places(view, scene, frame)
    shown = np.flatnonzero(scene.visible(frame)).tolist()
    _draw_background(canvas, view, scene)
    for link in scene.links:
        if set(link) <= set(shown):
            canvas.line(places[list(link), :2], MUTED)
    labels = [label_of(scene.shapes[shape], places[shape], canvas.width) for shape in shown]
    outside = [label.box for label in labels if label is not None and not label.inside]
    bubbles = speech_bubbles(canvas, scene, frame, places, outside)
    speakers = [shape for shape in shown if scene.shapes[shape].kind not in ("square", "text")]
    for shape in shown:
        if shape in speakers[:1]:
            draw_leaders(canvas, bubbles)
        _draw_shape(canvas, view, scene, frame, shape, places[shape])
        draw_label(canvas, scene, frame, shape, places[shape])
    if not speakers:
        draw_leaders(canvas, bubbles)
    draw_bubbles(canvas, bubbles)


def _view(canvas: Canvas | SvgCanvas, scene: Scene) -> View:
    """All that is within bounds, in the middle of the canvas."""
    left, bottom, right, top = scene.bounds
    across, up = max(right - left, 1e-9), max(top - bottom, 1e-9)
    scale = min(canvas.width / across, canvas.height / up)
    return View(
        scale,
        (canvas.width - scale * across) / 2 - scale * left,
        (canvas.height - scale * up) / 2 + scale * top,
    )


def _places(view: View, scene: Scene, frame: int) -> Float[np.ndarray, "shape 4"]:
    """X, y, radius and inner radius of the shapes (pixels).

    A polygon's radius is that of its furthest vertex; its inner one half of its lesser extent.
    """
    sizes = np.array([_radii(scene, frame, shape) for shape in range(len(scene.shapes))], float)
    sizes = view.scale * sizes.reshape(-1, 2)
    if scene.scale is not None:
        sizes = sizes * scene.scale[frame, :, None]
    return np.column_stack([view.project(scene.position[frame]), sizes])


def _radii(scene: Scene, frame: int, shape: int) -> tuple[float, float]:
    """Before they are scaled, in units of the positions."""
    size = scene.shapes[shape].size
    if scene.shapes[shape].kind != "polygon":
        return size, size
    vertices = size * _vertices(scene, frame, shape)
    extents = np.abs(vertices).max(0, initial=0.0)
    return float(np.linalg.norm(vertices, axis=1).max(initial=0.0)), float(extents.min())


def _vertices(scene: Scene, frame: int, shape: int) -> Float[np.ndarray, "vertex 2"]:
    """A polygon's own, or those that it has in the frame."""
    own = scene.shapes[shape].vertices
    if own or scene.vertices is None:
        return np.array(own, float).reshape(-1, 2)
    found = scene.vertices[frame, shape].astype(float)
    return found[np.isfinite(found).all(1)]


def _outline(scene: Scene, frame: int, shape: int) -> Float[np.ndarray, "vertex 2"]:
    """A polygon's vertices where they are, in units of the positions."""
    size = scene.shapes[shape].size
    if scene.scale is not None:
        size = size * float(scene.scale[frame, shape])
    angle = 0.0 if scene.heading is None else float(scene.heading[frame, shape])
    cos, sin = math.cos(angle), math.sin(angle)
    turned = _vertices(scene, frame, shape) @ np.array([(cos, sin), (-sin, cos)])
    return scene.position[frame, shape].astype(float) + size * turned


def _draw_background(canvas: Canvas | SvgCanvas, view: View, scene: Scene) -> None:
    for each in scene.background:
        colour = scene.palette[each.tint].colour
        points = view.project(np.array(each.vertices, float))
        if each.kind == "polygon":
            canvas.polygon(points, colour)
        else:
            canvas.line(points, colour, max(1.0, view.scale * each.width))


def _draw_shape(
    canvas: Canvas | SvgCanvas,
    view: View,
    scene: Scene,
    frame: int,
    shape: int,
    place: Float[np.ndarray, "4"],
) -> None:
    """A rim of paper lets circles and polygons be seen beside others of their colour."""
    x, y, radius, _ = place.tolist()
    colour = scene.palette[scene.tint[frame, shape]].colour
    kind = scene.shapes[shape].kind
    if kind == "polygon":
        canvas.polygon(view.project(_outline(scene, frame, shape)), colour, PAPER)
    elif kind == "square":
        canvas.rectangle(((x - radius, y - radius), (x + radius, y + radius)), colour)
    elif kind == "ring":
        canvas.circle((x, y), max(radius, 1), None, colour)
    elif kind != "text":
        if radius > RIMMED:
            canvas.circle((x, y), radius + 1, PAPER)
        canvas.circle((x, y), max(radius, 1), colour)
    if scene.heading is not None and kind not in ("polygon", "text"):
        angle = float(scene.heading[frame, shape])
        if math.isfinite(angle):
            canvas.line(_heading_mark(place, angle, square=kind == "square"), colour, 2.0)


def _heading_mark(
    place: Float[np.ndarray, "4"], angle: float, *, square: bool
) -> Float[np.ndarray, "end 2"]:
    """The ends of a mark that begins at the edge of a circle or of a square (pixels)."""
    ahead = np.array([math.cos(angle), -math.sin(angle)])
    radius = float(place[2])
    edge = radius / float(np.abs(ahead).max()) if square else radius
    ends = np.array([edge, edge + max(LEAST_MARK, MARK * radius)])
    found: Float[np.ndarray, "end 2"] = place[:2] + ends[:, None] * ahead
    return found
