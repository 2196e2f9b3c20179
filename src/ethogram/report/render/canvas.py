"""Smooth drawing: on a sheet larger than the picture, reduced in the end.

Places and sizes are in pixels of the picture, from its left upper corner.
"""

from bisect import bisect_right
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

FINE = 3  # pixels of the sheet across a pixel of the picture
FURTHEST = 10_000  # pixels; what is further away is drawn as if it were there
LONGEST = 400  # letters that are looked at
FONT = "fonts/ttf/DejaVuSans.ttf"  # of matplotlib's data
PAPER, INK, MUTED, RULE = "#ffffff", "#1d1d1b", "#5c5a54", "#d9d5cb"
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#a87400", "#7d7d7d")  # of tints

Point = tuple[float, float]


class Pen:
    """A sheet of paper and what draws on it."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self._sheet = Image.new("RGB", (FINE * width, FINE * height), PAPER)
        self._draw = ImageDraw.Draw(self._sheet, "RGBA")  # so that colours may be transparent

    def picture(self) -> Image.Image:
        """What was drawn, in its final size."""
        return self._sheet.reduce(FINE)

    def paste(self, other: "Pen", place: tuple[int, int]) -> None:
        """Put what another canvas drew where its left upper corner is to be."""
        self._sheet.paste(other._sheet, (FINE * place[0], FINE * place[1]))

    def line(self, points: Any, colour: str, width: float = 1.0) -> None:
        """Join points (rows of x and y)."""
        self._draw.line(_fine(points), fill=colour, width=max(1, round(FINE * width)))

    def polygon(self, points: Any, fill: str, outline: str | None = None) -> None:
        """Fill what is between points (rows of x and y), and draw its border."""
        self._draw.polygon(_fine(points), fill=fill, outline=outline, width=FINE)

    def box(self, corners: Sequence[Point], fill: str | None, outline: str | None = None) -> None:
        """Fill a rectangle from its left upper to its right lower corner, and draw its border."""
        self._draw.rectangle(_bounding(*corners), fill=fill, outline=outline, width=FINE)

    def disc(self, centre: Point, radius: float, colour: str) -> None:
        """Fill a circle."""
        self._draw.ellipse(_around(centre, radius), fill=colour)

    def ring(self, centre: Point, radius: float, colour: str) -> None:
        """Draw a circle's border."""
        self._draw.ellipse(_around(centre, radius), outline=colour, width=FINE)

    def text(
        self,
        place: Point,
        words: str,
        size: float,
        colour: str,
        *,
        anchor: str = "mm",
        halo: bool = False,
    ) -> None:
        """Write on one line.

        Args:
            place: the point that the anchor is at.
            words: what to write.
            size: of the letters.
            colour: of the letters.
            anchor: where in the text, as Pillow has it.
            halo: whether paper is to be seen around the letters, whatever is below them.

        """
        x, y = _fine(place)
        self._draw.text(
            (x, y),
            plain(words),
            fill=colour,
            font=_font(size),
            anchor=anchor,
            stroke_width=FINE if halo else 0,
            stroke_fill=PAPER,
        )


def colour(tint: int) -> str:
    """Of an entry of the palette, as in the player on pages."""
    return COLOURS[tint % len(COLOURS)]


@lru_cache(maxsize=4096)
def plain(words: str) -> str:
    """Text on one line, without what has no look of its own: controls, lone surrogates."""
    seen = "".join(letter if letter.isprintable() else " " for letter in words[:LONGEST])
    return " ".join(seen.split()) + ("…" if len(words) > LONGEST else "")


@lru_cache(maxsize=4096)
def measure(words: str, size: float) -> float:
    """How wide a text is."""
    return _font(size).getlength(plain(words)) / FINE


@lru_cache(maxsize=4096)
def fitted(words: str, size: float, room: float) -> str:
    """A text, cut where it would be wider than the room."""
    shown = plain(words)
    if measure(shown, size) <= room:
        return shown

    def width(letters: int) -> float:
        return measure(shown[:letters].rstrip() + "…", size)

    letters = bisect_right(range(len(shown)), room, key=width) - 1
    return shown[: max(letters, 0)].rstrip() + "…"


@lru_cache(maxsize=32)
def _font(size: float) -> ImageFont.FreeTypeFont:
    import matplotlib  # slow to load, and only its font is needed

    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / FONT), FINE * size)


def _fine(points: Any) -> list[float]:
    """Places on the sheet: x, y, x, y, ..."""
    places = FINE * np.clip(np.asarray(points, float), -FURTHEST, FURTHEST)
    return places.ravel().tolist()


def _bounding(upper: Point, lower: Point) -> list[float]:
    """A rectangle on the sheet, of a pixel at least; its last row and column belong to it."""
    left, top, right, bottom = map(round, _fine((upper, lower)))
    return [left, top, max(left, right - 1), max(top, bottom - 1)]


def _around(centre: Point, radius: float) -> list[float]:
    """A square on the sheet: its sides are rounded together, or circles would not be round."""
    x, y, half = _fine((*centre, radius))
    left, top, side = round(x - half), round(y - half), max(0, round(2 * half) - 1)
    return [left, top, left + side, top + side]
