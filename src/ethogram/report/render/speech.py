"""Where words stand that shapes say: beside who says them, and on nobody and nothing said.

The player does the same (`templates/plane.js`).  Places are in pixels, from the left upper corner.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

HIGH = 16.0  # of a box with words
LEVELS = 6  # rows above each other, at most
GAP = 1.0  # between boxes at least


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
    """A shape: where it is, how large, and how wide the box with its words is; 0 if silent."""

    x: float
    y: float
    radius: float
    wide: float

    @property
    def box(self) -> Box:
        """What it takes itself."""
        x, y, radius = self.x, self.y, self.radius
        return Box(x - radius, y - radius, x + radius, y + radius)


def boxes(speakers: Sequence[Speaker], width: float, height: float) -> list[Box | None]:
    """The box for what each says; None where it is silent, or where there is no room for it.

    Above, to the right, to the left, below or further up, whichever is free first.
    """
    taken: list[tuple[Box, int]] = [(each.box, at) for at, each in enumerate(speakers)]
    found: list[Box | None] = [None] * len(speakers)
    for at in sorted(range(len(speakers)), key=lambda at: (speakers[at].y, speakers[at].x)):
        if not speakers[at].wide:
            continue
        for box in _places(speakers[at], width, height):
            if not any(box.meets(other) for other, who in taken if who != at):
                found[at] = box
                taken.append((box, -1))
                break
    return found


def _places(speaker: Speaker, width: float, height: float) -> Iterator[Box]:
    """Where its box could be on the paper."""
    x, y, radius, wide = speaker
    wide, clear, half = min(wide, width), radius + 3, HIGH / 2
    above = [(x - wide / 2, y - clear - half - level * (HIGH + 2)) for level in range(LEVELS + 1)]
    beside = [(x + clear, y), (x - clear - wide, y), (x - wide / 2, y + clear + half)]
    for left, middle in (above[0], *beside, *above[1:]):
        at = min(max(left, 0.0), width - wide)
        box = Box(at, middle - half, at + wide, middle + half)
        if box.top >= 0 and box.bottom <= height and not box.meets(speaker.box):
            yield box
