"""A canvas of SVG: as `ethogram.report.render.canvas`, for pictures that take the page's ink."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import escape

from ethogram.report.render.canvas import FURTHEST, INK, MUTED, PAPER, RULE, Point, plain

OUTLINE = 0.7  # pixels, around what is filled
INKS = {  # how colours of the page are told: by the text's, and by the system's for paper
    INK: ("currentColor", ""),
    MUTED: ("currentColor", "0.65"),
    RULE: ("currentColor", "0.25"),
    PAPER: ("Canvas", ""),
}


class SvgCanvas:
    """A sheet of paper, and the elements on it from the back to the front."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self._drawn: list[str] = []

    def svg(self) -> str:
        """What was drawn as one element; what is beyond the edges is not seen."""
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{self.width}px" '
            f'height="{self.height}px" viewBox="0 0 {self.width} {self.height}" '
            f'font-family="sans-serif" stroke-linejoin="round">{"".join(self._drawn)}</svg>'
        )

    def paste(self, other: "SvgCanvas", place: tuple[int, int]) -> None:
        """Put what another canvas drew, within its edges, where its left upper corner is to be."""
        x, y = place
        size = f'width="{other.width}" height="{other.height}"'
        self._drawn += [f'<svg x="{x}" y="{y}" {size}>', *other._drawn, "</svg>"]

    def line(self, points: Any, colour: str, width: float = 1.0) -> None:
        """Join points (rows of x and y)."""
        path = f"M{_path(points)}"
        self._add(f'path d="{path}" fill="none" stroke-width="{width}"', stroke=colour)

    def polygon(self, points: Any, fill: str, outline: str | None = None) -> None:
        """Fill what is between points (rows of x and y), and draw its border."""
        self._add(f'path d="M{_path(points)}Z"', fill=fill, stroke=outline)

    def box(self, corners: Sequence[Point], fill: str | None, outline: str | None = None) -> None:
        """Fill a rectangle from its left upper to its right lower corner, and draw its border."""
        (left, top), (right, bottom) = np.clip(np.asarray(corners, float), -FURTHEST, FURTHEST)
        size = f'width="{_number(right - left)}" height="{_number(bottom - top)}"'
        self._add(f'rect x="{_number(left)}" y="{_number(top)}" {size}', fill=fill, stroke=outline)

    def disc(self, centre: Point, radius: float, colour: str) -> None:
        """Fill a circle."""
        self._add(_circle(centre, radius), fill=colour)

    def ring(self, centre: Point, radius: float, colour: str) -> None:
        """Draw a circle's border."""
        self._add(_circle(centre, radius), fill=None, stroke=colour)

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
        """Write on one line; of the anchors those in the middle of the height."""
        x, y = map(_number, np.clip(place, -FURTHEST, FURTHEST))
        side = {"l": "start", "m": "middle", "r": "end"}[anchor[0]]
        look = 'paint-order="stroke" stroke="Canvas" stroke-width="2" ' if halo else ""
        # white on a colour is white in the dark as well
        ink, seen = ("#ffffff", "") if colour == PAPER else INKS.get(colour, (colour, ""))
        opacity = f' fill-opacity="{seen}"' if seen else ""
        self._drawn.append(
            f'<text x="{x}" y="{y}" font-size="{size}" text-anchor="{side}" '
            f'dominant-baseline="central" {look}fill="{ink}"{opacity}>{escape(plain(words))}</text>'
        )

    def _add(self, element: str, *, fill: str | None = "", stroke: str | None = None) -> None:
        """An element with its colours; "" where it says itself how it is filled."""
        for name, colour in (("fill", fill), ("stroke", stroke)):
            if colour == "" or (colour is None and name == "stroke"):
                continue
            ink, seen = ("none", "") if colour is None else INKS.get(colour, (colour, ""))
            element += f' {name}="{ink}"' + (f' {name}-opacity="{seen}"' if seen else "")
        if stroke is not None and "stroke-width" not in element:
            element += f' stroke-width="{OUTLINE}"'
        self._drawn.append(f"<{element}/>")


def _path(points: Any) -> str:
    places = np.clip(np.asarray(points, float), -FURTHEST, FURTHEST).reshape(-1, 2)
    return "L".join(f"{_number(x)} {_number(y)}" for x, y in places)


def _circle(centre: Point, radius: float) -> str:
    x, y = map(_number, np.clip(centre, -FURTHEST, FURTHEST))
    return f'circle cx="{x}" cy="{y}" r="{_number(min(max(radius, 0.0), FURTHEST))}"'


def _number(value: float) -> str:
    """To a tenth of a pixel."""
    return f"{round(value, 1) or 0.0:.1f}".removesuffix(".0")
