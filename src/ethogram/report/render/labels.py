"""Labels of shapes: within a shape where there is room, else beside it."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ethogram.core.scene import Scene, Shape
from ethogram.report.render.canvas import INK, Canvas, letter_colour, text_width, truncate
from ethogram.report.render.speech import Box
from ethogram.report.render.svg_canvas import SvgCanvas

SMALLEST, LARGEST, RELATIVE = 10.0, 13.0, 1 / 50  # sizes of letters; of the canvas' width
CLEAR = 9  # pixels from a shape's edge to the middle of the letters


class Label(NamedTuple):
    """A text on one line, and the middle of it (pixels)."""

    text: str
    x: float
    y: float
    size: float
    inside: bool  # on the shape's colour

    @property
    def box(self) -> Box:
        """What it takes."""
        wide, high = text_width(self.text, self.size) / 2, self.size / 2
        return Box(self.x - wide, self.y - high, self.x + wide, self.y + high)


def label_of(shape: Shape, place: Float[np.ndarray, "4"], width: int) -> Label | None:
    """Where the label of a shape stands; None where it has none.

    A square's is below it: above are words, and what stands on the square.

    Args:
        shape: whose label it is.
        place: x, y, radius and inner radius of the shape (pixels).
        width: of the canvas.

    """
    if not shape.label:
        return None
    x, y, radius, inner = place.tolist()
    size = max(SMALLEST, min(LARGEST, width * RELATIVE))
    room = 2 * inner if shape.kind == "circle" or 2 * inner > size else 0.0
    inside = shape.kind in ("circle", "polygon") and text_width(shape.label, size) < room
    if not inside and shape.kind != "text":
        y += radius + CLEAR if shape.kind == "square" else -radius - CLEAR
    return Label(truncate(shape.label, size, width), x, y, size, inside)


def draw_label(
    canvas: Canvas | SvgCanvas, scene: Scene, frame: int, shape: int, place: Float[np.ndarray, "4"]
) -> None:
    """Write a shape's label, if it has one."""
    label = label_of(scene.shapes[shape], place, canvas.width)
    if label is None:
        return
    fill = scene.palette[scene.tint[frame, shape]].colour
    colour = letter_colour(fill) if label.inside else INK
    canvas.text((label.x, label.y), label.text, label.size, colour, halo=not label.inside)
