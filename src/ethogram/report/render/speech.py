"""Speech bubbles: words beside the shapes that say them, on nobody and on nothing else said.

The player does the same (`templates/plane.js`).  Places are in pixels, from the left upper corner.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ethogram.core.scene import Scene
from ethogram.report.render.canvas import INK, PAPER, Canvas, text_width, truncate
from ethogram.report.render.svg_canvas import SvgCanvas

HEIGHT = 16.0  # of a bubble
LETTERS = 11.0
PADDING = 4.0  # left and right of the words
LEVELS = 6  # rows above each other, at most
GAP = 1.0  # between bubbles at least
DOT = 3  # radius of what stands for words for which there is no room


class Box(NamedTuple):
    """A rectangle."""

    left: float
    top: float
    right: float
    bottom: float

    def meets(self, other: "Box") -> bool:
        """Whether they are nearer than the gap."""
        return (
            self.left < other.right + GAP
            and other.left < self.right + GAP
            and self.top < other.bottom + GAP
            and other.top < self.bottom + GAP
        )


class Speaker(NamedTuple):
    """A shape: where it is, how large, and how wide its bubble is; 0 if silent."""

    x: float
    y: float
    radius: float
    width: float

    @property
    def box(self) -> Box:
        """What it takes itself."""
        x, y, radius = self.x, self.y, self.radius
        return Box(x - radius, y - radius, x + radius, y + radius)


class Bubble(NamedTuple):
    """What a shape says, and where that stands; nowhere, if there is no room."""

    words: str
    speaker: Speaker
    box: Box | None


def speech_bubbles(
    canvas: Canvas | SvgCanvas,
    scene: Scene,
    frame: int,
    places: Float[np.ndarray, "shape 4"],
    labels: Sequence[Box] = (),
) -> list[Bubble]:
    """The bubbles of a frame.

    Args:
        canvas: on which they are to be drawn.
        scene: what is said, and by whom.
        frame: which.
        places: x, y, radius and inner radius of every shape.
        labels: which may not be hidden.

    """
    if scene.said is None:
        return []
    heard = [
        shape
        for shape in np.flatnonzero(scene.visible(frame) & np.isfinite(places).all(1)).tolist()
        if scene.axes == 3
        or scene.shapes[shape].kind not in ("square", "text")
        or scene.said[frame, shape] >= 0
    ]
    words = [_words(scene, frame, shape, canvas.width) for shape in heard]
    speakers = [
        Speaker._make((*places[shape, :3].tolist(), _width(text)))
        for shape, text in zip(heard, words, strict=True)
    ]
    found = place_bubbles(speakers, canvas.width, canvas.height, labels)
    bubbles = map(Bubble, words, speakers, found)
    return [bubble for bubble in bubbles if bubble.words]


def draw_leaders(canvas: Canvas | SvgCanvas, bubbles: Sequence[Bubble]) -> None:
    """Lines from those who speak to bubbles that are not right beside them."""
    for _, (x, y, radius, _), box in bubbles:
        if box is not None and box.bottom < y - radius - HEIGHT:
            canvas.line([(x, y - radius), (min(max(x, box.left), box.right), box.bottom)], INK)


def draw_bubbles(canvas: Canvas | SvgCanvas, bubbles: Sequence[Bubble]) -> None:
    """The words; where there is no room, a dot tells that something is said."""
    for words, speaker, box in bubbles:
        if box is None:
            canvas.circle((speaker.x, speaker.y - speaker.radius), DOT, INK)
            continue
        canvas.rectangle((box[:2], box[2:]), PAPER, INK)
        middle = (box.left + box.right) / 2, (box.top + box.bottom) / 2
        canvas.text(middle, words, LETTERS, INK)


def place_bubbles(
    speakers: Sequence[Speaker], width: float, height: float, obstacles: Sequence[Box] = ()
) -> list[Box | None]:
    """The box for what each says; None where it is silent, or where there is no room for it.

    Above, to the right, to the left, below or further up, whichever is free first.
    """
    taken = [(each.box, at) for at, each in enumerate(speakers)]
    taken += [(box, -1) for box in obstacles]
    found: list[Box | None] = [None] * len(speakers)
    for at in sorted(range(len(speakers)), key=lambda at: (speakers[at].y, speakers[at].x)):
        if not speakers[at].width:
            continue
        for box in _candidates(speakers[at], width, height):
            if not any(box.meets(other) for other, who in taken if who != at):
                found[at] = box
                taken.append((box, -1))
                break
    return found


def _candidates(speaker: Speaker, width: float, height: float) -> Iterator[Box]:
    """Where its box could be on the canvas."""
    x, y, radius, wide = speaker
    wide, clear, half = min(wide, width), radius + 3, HEIGHT / 2
    above = [(x - wide / 2, y - clear - half - level * (HEIGHT + 2)) for level in range(LEVELS + 1)]
    beside = [(x + clear, y), (x - clear - wide, y), (x - wide / 2, y + clear + half)]
    for left, middle in (above[0], *beside, *above[1:]):
        at = min(max(left, 0.0), width - wide)
        box = Box(at, middle - half, at + wide, middle + half)
        if box.top >= 0 and box.bottom <= height and not box.meets(speaker.box):
            yield box


def _words(scene: Scene, frame: int, shape: int, room: float) -> str:
    """What a shape says, cut to the room there is; nothing if it is silent."""
    said = -1 if scene.said is None else int(scene.said[frame, shape])
    known = 0 <= said < len(scene.words)
    return truncate(scene.words[said], LETTERS, room - 2 * PADDING) if known else ""


def _width(words: str) -> float:
    return text_width(words, LETTERS) + 2 * PADDING if words else 0.0
