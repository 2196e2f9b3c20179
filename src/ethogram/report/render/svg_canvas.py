"""SVG canvas: as `ethogram.report.render.canvas`, for drawings that take the page's ink."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import escape

from ethogram.report.render.canvas import (
    FURTHEST,
    INK,
    MUTED,
    PAPER,
    ROUNDED,
    RULE,
    Point,
    printable,
)

OUTLINE = 0.7  # pixels, around what is filled
THEME = {  # how colours of the page are told: by the text's, and by the system's for paper
    INK: ("currentColor", ""),
    MUTED: ("currentColor", "0.65"),
    RULE: ("currentColor", "0.25"),
    PAPER: ("Canvas", ""),
}


class SvgCanvas:
    """A sheet of paper, and the elements on it from the back to the front."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self._elements: list[str] = []

    def svg(self) -> str:
        """What was drawn as one element; what is beyond the edges is not seen."""
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{self.width}px" '
            f'height="{self.height}px" viewBox="0 0 {self.width} {self.height}" '
            f'font-family="sans-serif" stroke-linejoin="round">{"".join(self._elements)}</svg>'
        )

    def paste(self, other: "SvgCanvas", place: tuple[int, int]) -> None:
        """Put what another canvas drew, within its edges, where its left upper corner is to be."""
        x, y = place
        size = f'width="{other.width}" height="{other.height}"'
        self._elements += [f'<svg x="{x}" y="{y}" {size}>', *other._elements, "</svg>"]

    def line(self, points: Any, colour: str, width: float = 1.0) -> None:
        """Join points (rows of x and y)."""
        wide = _number(min(width, FURTHEST)) if width > ROUNDED else f"{width}"
        ends = ' stroke-linecap="round"' if width > ROUNDED else ""
        path = f'path d="M{_path(points)}" fill="none" stroke-width="{wide}"{ends}'
        self._add(path, stroke=colour)

    def polygon(self, points: Any, fill: str, outline: str | None = None) -> None:
        """Fill what is between points (rows of x and y), and draw its border."""
        self._add(f'path d="M{_path(points)}Z"', fill=fill, stroke=outline)

    def rectangle(
        self, corners: Sequence[Point], fill: str | None, outline: str | None = None
    ) -> None:
        """Fill a rectangle from its left upper to its right lower corner, and draw its border."""
        (left, top), (right, bottom) = np.clip(np.asarray(corners, float), -FURTHEST, FURTHEST)
        size = f'width="{_number(right - left)}" height="{_number(bottom - top)}"'
        self._add(f'rect x="{_number(left)}" y="{_number(top)}" {size}', fill=fill, stroke=outline)

    def circle(
        self, centre: Point, radius: float, fill: str | None, outline: str | None = None
    ) -> None:
        """Fill a circle, and draw its border."""
        x, y = map(_number, np.clip(centre, -FURTHEST, FURTHEST))
        size = _number(min(max(radius, 0.0), FURTHEST))
        self._add(f'circle cx="{x}" cy="{y}" r="{size}"', fill=fill, stroke=outline)

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
        """Write on one line; of the anchors those in the middle of the height."""
        x, y = map(_number, np.clip(place, -FURTHEST, FURTHEST))
        side = {"l": "start", "m": "middle", "r": "end"}[anchor[0]]
        look = 'paint-order="stroke" stroke="Canvas" stroke-width="2" ' if halo else ""
        ink, opacity = THEME.get(colour, (colour, ""))
        faint = f' fill-opacity="{opacity}"' if opacity else ""
        shown = escape(printable(text))
        self._elements.append(
            f'<text x="{x}" y="{y}" font-size="{size}" text-anchor="{side}" '
            f'dominant-baseline="central" {look}fill="{ink}"{faint}>{shown}</text>'
        )

    def _add(self, element: str, *, fill: str | None = "", stroke: str | None = None) -> None:
        """An element with its colours; "" where it says itself how it is filled."""
        for name, colour in (("fill", fill), ("stroke", stroke)):
            if colour == "" or (colour is None and name == "stroke"):
                continue
            ink, opacity = ("none", "") if colour is None else THEME.get(colour, (colour, ""))
            element += f' {name}="{ink}"' + (f' {name}-opacity="{opacity}"' if opacity else "")
        if stroke is not None and "stroke-width" not in element:
            element += f' stroke-width="{OUTLINE}"'
        self._elements.append(f"<{element}/>")


def _path(points: Any) -> str:
    places = np.clip(np.asarray(points, float), -FURTHEST, FURTHEST).reshape(-1, 2)
    return "L".join(f"{_number(x)} {_number(y)}" for x, y in places)


def _number(value: float) -> str:
    """To a tenth of a pixel."""
    return f"{round(value, 1) or 0.0:.1f}".removesuffix(".0")
