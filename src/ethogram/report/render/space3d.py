"""Scenes in space, as seen from their side and a bit from above, with the floor they are on.

The eye goes along with the shapes' centre in x, so that the floor is seen to move.  Every shape
is drawn as a cube; the nearer ones are painted over those further away.  Units are metres.
"""

import math
from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from PIL import ImageColor

from ethogram.core.scene import GRADED_RANGE, Scene
from ethogram.report.render.canvas import MUTED, Canvas, text_width
from ethogram.report.render.labels import draw_label
from ethogram.report.render.speech import draw_bubbles, draw_leaders, speech_bubbles
from ethogram.report.render.svg_canvas import SvgCanvas

AROUND, ABOVE = math.radians(-18), math.radians(20)  # where the eye is: to the left, upwards
AWAY = 6.0  # how far, in the largest distance of a shape from the centre
SHARE = 0.23  # of the canvas' width that this distance has
NEAR = 0.2  # of the eye's distance: nothing nearer is drawn
LIGHT = np.array((-0.3, -0.6, 1.0))  # where it comes from; as much as can be falls from above
DARKEST = 0.6  # of a face that gets no light
SHADOW = "#dedbd3"
LINES, MARKS = 0.1, 0.01  # m between the lines on the floor, between marks on the track
MOST_LINES, MOST_NAMES = 12, 3  # across all shapes; twice as many places have their x written
TRACK, MARK = "#f6f4ee", "#d0ccc2"
FAR, BESIDE = 16.0, 0.7  # how far the floor and the track reach, in the same unit as `AWAY`
LETTERS, MILLIMETRES = 10.0, 1000.0

CORNERS = np.array(list(product((-1, 1), repeat=3)))  # of a cube, in half edges
FACES = np.array(  # four corners each
    ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
)
NORMALS = CORNERS[FACES].mean(1)


class View(NamedTuple):
    """How points in space come onto the canvas."""

    target: Float[np.ndarray, "3"]  # m, what is in the middle of the canvas
    axes: Float[np.ndarray, "3 3"]  # unit vectors to the right, up and ahead
    distance: float  # m, of the eye from the target
    reach: float  # m, the largest distance of a shape from the target
    scale: float  # pixels per metre at the target
    middle: tuple[float, float]  # pixels

    @property
    def eye(self) -> Float[np.ndarray, "3"]:
        """Where it is."""
        return self.target - self.distance * self.axes[2]

    def project(self, points: Float[np.ndarray, "*any 3"]) -> Float[np.ndarray, "*any 3"]:
        """Where points are on the canvas (x and y in pixels), and how far ahead (m)."""
        right, up, ahead = np.moveaxis((points - self.target) @ self.axes.T, -1, 0)
        depth = ahead + self.distance
        zoom = self.scale * self.distance / np.maximum(depth, NEAR * self.distance)
        x, y = self.middle
        return np.stack([x + zoom * right, y - zoom * up, depth], -1)


def draw(canvas: Canvas | SvgCanvas, scene: Scene, frame: int) -> None:
    """Draw a frame, and above all shapes their labels and what they say."""
    view = _view(scene, frame, canvas.width, canvas.height)
    _draw_floor(canvas, view)
    half = np.array([shape.size for shape in scene.shapes], float)
    if scene.scale is not None:
        half = half * scene.scale[frame]
    turn = _turns(scene, frame)
    position = scene.position[frame].astype(float)
    corners = position[:, None] + half[:, None, None] * (CORNERS @ turn.swapaxes(1, 2))
    shown = np.flatnonzero(scene.visible(frame) & np.isfinite(corners).all((1, 2))).tolist()
    fallen = view.project(corners * (1, 1, 0))
    for shape in shown:
        for face in FACES:
            canvas.polygon(fallen[shape, face, :2], SHADOW)
    away = np.linalg.norm(position - view.eye, axis=1)
    colours = _colours(scene, frame)
    for shape in sorted(shown, key=lambda shape: -away[shape]):
        _draw_cube(canvas, view, corners[shape], NORMALS @ turn[shape].T, colours[shape])
    radius = view.scale * half
    places = np.column_stack([view.project(position)[:, :2], radius, radius])
    for shape in shown:
        draw_label(canvas, scene, frame, shape, places[shape])
    bubbles = speech_bubbles(canvas, scene, frame, places)
    draw_leaders(canvas, bubbles)
    draw_bubbles(canvas, bubbles)


def _view(scene: Scene, frame: int, width: int, height: int) -> View:
    """The same in all frames but for x, so that all of every frame is seen."""
    shown = scene.visible()
    size = max((shape.size for shape in scene.shapes), default=0.0)
    place = np.where(shown[..., None], scene.position, 0.0).astype(float)
    ahead = place[..., 0].sum(1) / np.maximum(shown.sum(1), 1)
    _, aside, up = place[shown].mean(0) if shown.any() else np.zeros(3)
    target = np.stack(np.broadcast_arrays(ahead, aside, up), -1)
    offset = np.linalg.norm(place - target[:, None], axis=2)[shown]
    reach = (float(offset.max(initial=0.0)) + 2 * size) or 1.0
    cos, sin = math.cos(ABOVE), math.sin(ABOVE)
    right = (math.cos(AROUND), math.sin(AROUND))
    back = (-math.sin(AROUND), math.cos(AROUND))
    return View(
        target=target[frame],
        axes=np.array(
            [(*right, 0), (sin * back[0], sin * back[1], cos), (cos * back[0], cos * back[1], -sin)]
        ),
        distance=AWAY * reach,
        reach=reach,
        scale=SHARE * min(width, height * 16 / 9) / reach,
        middle=(width / 2, height / 2),
    )


def _turns(scene: Scene, frame: int) -> Float[np.ndarray, "shape 3 3"]:
    """Rotation matrices of the shapes' unit quaternions."""
    if scene.orientation is None:
        return np.broadcast_to(np.eye(3), (len(scene.shapes), 3, 3))
    w, x, y, z = scene.orientation[frame].T.astype(float)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def _colours(scene: Scene, frame: int) -> Float[np.ndarray, "shape 3"]:
    """Of their tints or, of a graded scene, by how far shapes are contracted or expanded."""
    palette = np.array([ImageColor.getrgb(tint.colour) for tint in scene.palette], float)
    if scene.scale is None or not scene.graded:
        return palette.reshape(-1, 3)[scene.tint[frame]] if len(palette) else np.zeros((0, 3))
    contracted, resting, expanded = palette
    change = np.clip((scene.scale[frame].astype(float) - 1) / GRADED_RANGE, -1, 1)[:, None]
    found: np.ndarray = resting + np.abs(change) * (
        np.where(change < 0, contracted, expanded) - resting
    )
    return found


def _draw_cube(
    canvas: Canvas | SvgCanvas,
    view: View,
    corners: Float[np.ndarray, "8 3"],
    normals: Float[np.ndarray, "6 3"],
    colour: Float[np.ndarray, "3"],
) -> None:
    """The faces that look at the eye, the darker the further they are turned from the light."""
    faces = corners[FACES]
    light = DARKEST + (1 - DARKEST) * np.clip(normals @ LIGHT, 0, 1)
    facing = ((view.eye - faces.mean(1)) * normals).sum(1) > 0
    on_canvas = view.project(faces)
    before = (on_canvas[..., 2] > NEAR * view.distance).all(1)
    for face in np.flatnonzero(facing & before):
        canvas.polygon(on_canvas[face, :, :2], _hex(light[face] * colour), _hex(0.5 * colour))


def _hex(rgb: Float[np.ndarray, "3"]) -> str:
    return "#" + bytes(np.clip(rgb, 0, 255).astype(np.uint8)).hex()


def _draw_floor(canvas: Canvas | SvgCanvas, view: View) -> None:
    """Lines every `LINES` metres both ways, and below the shapes a track with marks and their x.

    On a larger floor the lines are further apart by a power of ten.
    """
    if view.eye[2] <= 0:
        return  # it is above the eye
    step = _apart(view, LINES, MOST_LINES)
    beside = BESIDE * view.reach
    near, far = _lines(view, 1, view.target[1] + np.array((-beside, beside)), FAR * view.reach)
    canvas.polygon([*near, *far[::-1]], TRACK)
    for line in _lines(view, 0, _places(view, 0, _apart(view, MARKS, MOST_LINES)), beside):
        canvas.line(line, MARK)
    for axis in (0, 1):
        for line in _lines(view, axis, _places(view, axis, step), FAR * view.reach):
            canvas.line(line, MARK, 1.5)
    for place in _places(view, 0, _apart(view, LINES, MOST_NAMES) / 2):
        x, y, ahead = view.project(np.array((place, view.target[1] - beside, 0.0))).tolist()
        name = f"{MILLIMETRES * place:.6g} mm"
        half = text_width(name, LETTERS) / 2 + 2
        if half < x < canvas.width - half and ahead > NEAR * view.distance:
            canvas.text((x, y + LETTERS), name, LETTERS, MUTED, halo=True)


def _apart(view: View, least: float, most: int) -> float:
    """How far apart lines are (m): the least, or by powers of ten more, lest there be too many."""
    tenfold = math.ceil(math.log10(2 * view.reach / (least * most)))
    return least * 10.0 ** max(0, tenfold)


def _places(view: View, axis: int, apart: float) -> Float[np.ndarray, "line"]:
    """Where there are lines along an axis (m), as far as the floor is seen."""
    middle, far = view.target[axis], FAR * view.reach
    return apart * np.arange(math.ceil((middle - far) / apart), (middle + far) / apart)


def _lines(
    view: View, axis: int, places: Float[np.ndarray, "line"], far: float
) -> Float[np.ndarray, "line 2 2"]:
    """The ends on the canvas of lines across an axis, so far both ways but not nearer the eye."""
    ends = np.zeros((len(places), 2, 3))
    ends[..., axis] = places[:, None]
    ends[..., 1 - axis] = view.target[1 - axis] + far * np.array((-1, 1))
    depth = view.project(ends)[..., 2] - NEAR * view.distance
    before = (depth > 0).any(1)
    ends, depth = ends[before], depth[before]
    other = depth[:, ::-1]  # of a line's other end, which is far enough where this one is not
    share = np.where(depth < 0, depth / np.where(depth < 0, depth - other, 1.0), 0.0)
    return view.project(ends + share[..., None] * (ends[:, ::-1] - ends))[..., :2]
