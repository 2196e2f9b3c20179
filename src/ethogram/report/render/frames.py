"""Frames of a scene as images and as SVG: what the player on pages shows, on white paper.

From top to bottom: the title, the scene, the frame's caption, the numbers of all frames with a mark
at this one, and what the colours mean.  What a single frame has no room to say, a chart, is left
out where there is only one.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple, TypeVar

import numpy as np
from PIL import Image

from ethogram.core.errors import EthogramError
from ethogram.core.scene import Scene
from ethogram.report.render import plane, space3d
from ethogram.report.render.canvas import INK, MUTED, RULE, Canvas, text_width, truncate
from ethogram.report.render.svg_canvas import SvgCanvas

WIDTH, NARROWEST = 640, 100  # pixels of an image
SVG_WIDTH = 480  # of a drawing that a page scales: its letters are to be read on a phone
MARGIN = 8
LINE = 18  # height of a line of text
CHART = 92
TEXT, SMALL = 12.0, 10.0  # sizes of letters
SWATCH, INDENT, APART = 10, 15, 14  # pixels, of the legend's entries
MOST_HEIGHT = 0.75  # of a scene, of its width
IN_SPACE = 16 / 9  # width over height of a scene in space
AXIS = 52  # room for numbers left of the chart
UNLIKE = 20  # a series so many times flatter than another has a scale of its own
EVERY = 70  # between marks on the axis below it, at least
LINES = ("#7b57c4", "#c2405a", "#6f8000", "#2b8ca3", "#96603a", "#64748b")  # none is a tint's

AnyCanvas = TypeVar("AnyCanvas", Canvas, SvgCanvas)


class LegendEntry(NamedTuple):
    """An entry of the palette in a row of the legend."""

    left: float  # pixels
    colour: str
    label: str


def render_frame(scene: Scene, frame: int, *, width: int = WIDTH) -> Image.Image:
    """An image of one frame; all frames of a scene have the same size, and its numbers are even.

    Args:
        scene: in the plane or in space.
        frame: which, from 0.
        width: of the image (pixels), made even.

    Raises:
        EthogramError: there is no such frame, or no room to draw it.

    """
    _check_frame(scene, frame)
    if width < NARROWEST:
        raise EthogramError(f"A frame {width} pixels wide is too narrow: {NARROWEST} or more.")
    width -= width % 2
    room = width - 2 * MARGIN
    stage = _stage(scene, frame, room, Canvas)
    legend = _legend(scene, room)
    plotted = any(lines.shape[1] for lines in scene.series.values()) and len(scene.tint) > 1
    chart = CHART if plotted else 0
    height = MARGIN + LINE + stage.height + LINE + 4 + chart + LINE * len(legend) + MARGIN
    sheet = Canvas(width, height + height % 2)
    sheet.text((MARGIN, MARGIN + 7), truncate(scene.title, TEXT, room), TEXT, INK, anchor="lm")
    y = MARGIN + LINE
    sheet.paste(stage, (MARGIN, y))
    y += stage.height
    _write_caption(sheet, scene, frame, y + 12)
    y += LINE + 4
    if chart:
        plot = Canvas(room, chart)
        _plot(plot, scene, frame)
        sheet.paste(plot, (MARGIN, y))
    _write_legend(sheet, legend, y + chart + LINE // 2)
    return sheet.image()


def render_svg(scene: Scene, frame: int, *, width: int = SVG_WIDTH) -> str:
    """One frame and what its colours mean as an SVG element, without title, caption and chart.

    Args:
        scene: in the plane or in space.
        frame: which, from 0.
        width: of the drawing (pixels).

    Raises:
        EthogramError: there is no such frame.

    """
    _check_frame(scene, frame)
    stage = _stage(scene, frame, width - 2 * MARGIN, SvgCanvas)
    legend = _legend(scene, width - 2 * MARGIN)
    sheet = SvgCanvas(width, MARGIN + stage.height + LINE * len(legend) + MARGIN)
    sheet.paste(stage, (MARGIN, MARGIN))
    _write_legend(sheet, legend, MARGIN + stage.height + LINE // 2 + 2)
    return sheet.svg()


def _check_frame(scene: Scene, frame: int) -> None:
    if not 0 <= frame < len(scene.tint):
        raise EthogramError(f"Scene {scene.title!r} has no frame {frame}.")


def _write_legend(sheet: Canvas | SvgCanvas, legend: list[list[LegendEntry]], y: float) -> None:
    for at, row in enumerate(legend):
        middle = y + LINE * at
        for x, colour, label in row:
            left, half = MARGIN + x, SWATCH / 2
            sheet.rectangle(((left, middle - half), (left + SWATCH, middle + half)), colour)
            sheet.text((left + INDENT, middle), label, SMALL, INK, anchor="lm")


def _write_caption(sheet: Canvas, scene: Scene, frame: int, y: float) -> None:
    """The caption, and at the right for how long of how many seconds the scene has been shown."""
    last, seconds = len(scene.tint) - 1, scene.frame_seconds
    clock = f"{frame * seconds:.1f} of {last * seconds:.1f} s" if last else ""
    room = sheet.width - 3 * MARGIN - text_width(clock, SMALL)
    sheet.text((sheet.width - MARGIN, y), clock, SMALL, MUTED, anchor="rm")
    caption = truncate(scene.captions[frame], TEXT, max(room, 0.0))
    sheet.text((MARGIN, y), caption, TEXT, INK, anchor="lm")


def _stage(scene: Scene, frame: int, width: int, canvas: type[AnyCanvas]) -> AnyCanvas:
    """The scene itself, framed."""
    if scene.axes == 3:
        stage = canvas(width, round(width / IN_SPACE))
        space3d.draw(stage, scene, frame)
    else:
        left, bottom, right, top = scene.bounds
        ratio = (right - left) / max(top - bottom, 1e-9)
        stage = canvas(width, round(width * min(MOST_HEIGHT, 1 / min(4.0, max(1.0, ratio)))))
        plane.draw(stage, scene, frame)
    stage.rectangle(((0, 0), (stage.width, stage.height)), None, RULE)
    return stage


def _plot(chart: Canvas, scene: Scene, frame: int) -> None:
    """All lines of all series over the frames, on one or two scales, and a mark at the frame."""
    lines = np.concatenate(list(scene.series.values()), 1).astype(float)
    known, on_right = np.isfinite(lines), _on_right(scene)
    right_axis = AXIS if on_right.any() else 6
    left, right = AXIS + 4, chart.width - right_axis
    x = left + (right - left) * np.arange(len(lines)) / max(1, len(lines) - 1)
    top, bottom = 20, chart.height - 26
    y = np.empty_like(lines)
    for some, at, anchor in ((~on_right, AXIS, "rm"), (on_right, right + 4, "lm")):
        if some.any():
            low, high = _range(lines[:, some])
            y[:, some] = bottom - (bottom - top) * (lines[:, some] - low) / (high - low)
            for number, place in ((high, top), (low, bottom)):
                digits = f"{0 if abs(number) < (high - low) / 1000 else number:.3g}"
                shown = truncate(digits, SMALL, AXIS)
                chart.text((at, place - 1), shown, SMALL, MUTED, anchor=anchor)
    chart.line([(left, bottom), (right, bottom)], MUTED)
    for mark in _marks(len(lines), right - left):
        chart.line([(x[mark], bottom), (x[mark], bottom + 4)], MUTED)
        words = str(mark) if mark else "frame 0"
        chart.text((x[mark], bottom + 12), words, SMALL, MUTED)
    for away, name, look in _series_names(scene, chart.width - AXIS - 8):
        chart.text((AXIS + 4 + away, 8), name, SMALL, look, anchor="lm")
    for line in range(lines.shape[1]):
        at = known[:, line]
        if at.sum() > 1:
            chart.line(np.column_stack([x[at], y[at, line]]), _line_colour(line), 1.4)
    chart.line([(x[frame], top - 4), (x[frame], bottom + 4)], INK)


def _range(lines: np.ndarray) -> tuple[float, float]:
    """What an axis reaches from and to."""
    known = lines[np.isfinite(lines)]
    low, high = (known.min(), known.max()) if known.size else (0.0, 1.0)
    return float(low), float(high if high > low else low + 1)


def _on_right(scene: Scene) -> np.ndarray:
    """Of each line, whether its series would be flat beside another, and has a scale of its own."""
    known = [lines[np.isfinite(lines)] for lines in scene.series.values()]
    spans = np.array([float(np.ptp(values)) if values.size else 0.0 for values in known])
    counts = [lines.shape[1] for lines in scene.series.values()]
    return np.repeat((spans > 0) & (spans * UNLIKE < spans.max(initial=0.0)), counts)


def _marks(frames: int, room: float) -> range:
    """Round numbers of frames, not too near to each other."""
    least = max(1.0, (frames - 1) * EVERY / room)
    ten = int(10.0 ** math.floor(math.log10(least)))
    step = next(ten * each for each in (1, 2, 5, 10) if ten * each >= least)
    return range(0, frames, step)


def _line_colour(line: int) -> str:
    return LINES[line % len(LINES)]


def _series_names(scene: Scene, room: float) -> Iterator[tuple[float, str, str]]:
    """Where names of lines are, and in which colours; of a series with many, one for all."""
    left, line, on_right = 0.0, 0, _on_right(scene)
    for name, lines in scene.series.items():
        count = lines.shape[1]
        side = " (right)" if on_right[line : line + 1].any() else ""
        named = [f"{name} {at + 1}{side}" if count > 1 else name + side for at in range(count)]
        wide = sum(text_width(each, SMALL) + 12 for each in named)
        if count > len(LINES) or wide > room - left:
            named = [f"{name}, {count} lines{side}"]
        for at, each in enumerate(named):
            shown = truncate(each, SMALL, max(room - left, 0.0))
            look = _line_colour(line + at) if len(named) == count else MUTED
            yield left, shown, look
            left += text_width(shown, SMALL) + 12
        line += count


def _legend(scene: Scene, room: float) -> list[list[LegendEntry]]:
    """Rows of entries of the palette."""
    rows: list[list[LegendEntry]] = [[]]
    left = 0.0
    for tint in scene.palette:
        label = truncate(tint.label, SMALL, room - INDENT)
        width = INDENT + text_width(label, SMALL)
        if rows[-1] and left + width > room:
            rows.append([])
            left = 0.0
        rows[-1].append(LegendEntry(left, tint.colour, label))
        left += width + APART
    return [row for row in rows if row]
