"""Antialiased raster canvas: drawn on a sheet larger than the image, reduced in the end.

Places and sizes are in pixels of the image, from its left upper corner.
"""

from bisect import bisect_right
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageColor, ImageDraw, ImageFont

SUPERSAMPLING = 3  # pixels of the sheet across a pixel of the image
FURTHEST = 10_000  # pixels; what is further away is drawn as if it were there
LONGEST = 400  # letters that are looked at
FONT = "fonts/ttf/DejaVuSans.ttf"  # of matplotlib's data
INK, MUTED, PAPER, RULE = "ink", "muted", "paper", "rule"  # colours that a page has its own for
THEME = {INK: "#1d1d1b", MUTED: "#5c5a54", PAPER: "#ffffff", RULE: "#d9d5cb"}
DARK, LIGHT = "#1d1d1b", "#ffffff"  # letters on a colour
BRIGHT = 0.4  # relative luminance of a colour on which letters are dark
ROUNDED = 2  # pixels: the ends and corners of wider lines are round

Point = tuple[float, float]


class Canvas:
    """A sheet of paper and what draws on it."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        fine = SUPERSAMPLING * width, SUPERSAMPLING * height
        self._sheet = Image.new("RGB", fine, THEME[PAPER])
        self._draw = ImageDraw.Draw(self._sheet, "RGBA")  # so that colours may be transparent

    def image(self) -> Image.Image:
        """What was drawn, in its final size."""
        return self._sheet.reduce(SUPERSAMPLING)

    def paste(self, other: "Canvas", place: tuple[int, int]) -> None:
        """Put what another canvas drew where its left upper corner is to be."""
        x, y = place
        self._sheet.paste(other._sheet, (SUPERSAMPLING * x, SUPERSAMPLING * y))

    def line(self, points: Any, colour: str, width: float = 1.0) -> None:
        """Join points (rows of x and y)."""
        wide = max(1, round(SUPERSAMPLING * min(width, FURTHEST)))
        joint = "curve" if width > ROUNDED else None
        self._draw.line(_fine(points), fill=_hex(colour), width=wide, joint=joint)
        if width > ROUNDED:
            for end in (points[0], points[-1]):
                self.circle(end, width / 2, colour)

    def polygon(self, points: Any, fill: str, outline: str | None = None) -> None:
        """Fill what is between points (rows of x and y), and draw its border."""
        border = _hex(outline)
        self._draw.polygon(_fine(points), fill=_hex(fill), outline=border, width=SUPERSAMPLING)

    def rectangle(
        self, corners: Sequence[Point], fill: str | None, outline: str | None = None
    ) -> None:
        """Fill a rectangle from its left upper to its right lower corner, and draw its border."""
        box, border = _bounding(*corners), _hex(outline)
        self._draw.rectangle(box, fill=_hex(fill), outline=border, width=SUPERSAMPLING)

    def circle(
        self, centre: Point, radius: float, fill: str | None, outline: str | None = None
    ) -> None:
        """Fill a circle, and draw its border."""
        box, border = _around(centre, radius), _hex(outline)
        self._draw.ellipse(box, fill=_hex(fill), outline=border, width=SUPERSAMPLING)

    def text(
        self,
        place: Point,
        text: str,
        size: float,
        colour: str,
        *,
        anchor: str = "mm",
        halo: bool = False,
    ) -> None:
        """Write on one line.

        Args:
            place: the point that the anchor is at.
            text: what to write.
            size: of the letters.
            colour: of the letters.
            anchor: where in the text, as Pillow has it.
            halo: whether paper is to be seen around the letters, whatever is below them.

        """
        x, y = _fine(place)
        self._draw.text(
            (x, y),
            printable(text),
            fill=_hex(colour),
            font=_font(size),
            anchor=anchor,
            stroke_width=SUPERSAMPLING if halo else 0,
            stroke_fill=THEME[PAPER],
        )


@lru_cache(maxsize=256)
def letter_colour(fill: str) -> str:
    """Of letters on a colour, so that they can be read."""
    channels = np.array(ImageColor.getrgb(fill)[:3]) / 255
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return DARK if linear @ (0.2126, 0.7152, 0.0722) > BRIGHT else LIGHT  # WCAG 2, luminance


@lru_cache(maxsize=4096)
def printable(text: str) -> str:
    """Text on one line, without what has no look of its own: controls, lone surrogates."""
    seen = "".join(letter if letter.isprintable() else " " for letter in text[:LONGEST])
    return " ".join(seen.split()) + ("…" if len(text) > LONGEST else "")


@lru_cache(maxsize=4096)
def text_width(text: str, size: float) -> float:
    """How wide a text is."""
    return _font(size).getlength(printable(text)) / SUPERSAMPLING


@lru_cache(maxsize=4096)
def truncate(text: str, size: float, room: float) -> str:
    """A text, cut where it would be wider than the room."""
    shown = printable(text)
    if text_width(shown, size) <= room:
        return shown

    def width(letters: int) -> float:
        return text_width(shown[:letters].rstrip() + "…", size)

    letters = bisect_right(range(len(shown)), room, key=width) - 1
    return shown[: max(letters, 0)].rstrip() + "…"


@lru_cache(maxsize=32)
def _font(size: float) -> ImageFont.FreeTypeFont:
    import matplotlib  # slow to load, and only its font is needed

    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / FONT), SUPERSAMPLING * size)


def _hex(colour: str | None) -> str | None:
    return None if colour is None else THEME.get(colour, colour)


def _fine(points: Any) -> list[float]:
    """Places on the sheet: x, y, x, y, ..."""
    places = SUPERSAMPLING * np.clip(np.asarray(points, float), -FURTHEST, FURTHEST)
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
