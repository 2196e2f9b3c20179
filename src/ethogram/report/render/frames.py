"""Frames of a scene as pictures: what the player on pages shows, on white paper.

From top to bottom: the title, the scene, the frame's caption, the numbers of all frames with a mark
at this one, and what the colours mean.  Scenes in the plane look as in `templates/plane.js`; those
in space are drawn by `bodies`.
"""

import math
from collections.abc import Iterator
from typing import TypeVar

import numpy as np
from jaxtyping import Float
from PIL import Image

from ethogram.core.errors import EthogramError
from ethogram.core.scene import Scene
from ethogram.report.render import space3d
from ethogram.report.render.canvas import INK, MUTED, PAPER, RULE, Canvas, colour, fitted, measure
from ethogram.report.render.speech import HIGH, Speaker, boxes
from ethogram.report.render.svg_canvas import SvgCanvas

WIDTH, NARROWEST = 640, 100  # pixels of a picture
STILL = 480  # of one that a page scales: its letters are to be read on a phone
MARGIN = 8
LINE = 18  # height of a line of text
CHART = 92
TEXT, SMALL, WORD = 12.0, 10.0, 11.0  # sizes of letters
MOST_HEIGHT = 0.75  # of a scene, of its width
IN_SPACE = 16 / 9  # width over height of a scene in space
AXIS = 52  # room for numbers left of the chart
EVERY = 70  # between marks on the axis below it, at least
LINES = ("#7b57c4", "#c2405a", "#6f8000", "#2b8ca3", "#96603a", "#64748b")  # none is a tint's


AnyPen = TypeVar("AnyPen", Canvas, SvgCanvas)


def picture(scene: Scene, frame: int, *, width: int = WIDTH) -> Image.Image:
    """Draw one frame; all frames of a scene have the same size, and its numbers are even.

    Args:
        scene: in the plane or in space.
        frame: which, from 0.
        width: of the picture (pixels), made even.

    Raises:
        EthogramError: there is no such frame, or no room to draw it.

    """
    if not 0 <= frame < len(scene.tint):
        raise EthogramError(f"Scene {scene.title!r} has no frame {frame}.")
    if width < NARROWEST:
        raise EthogramError(f"A picture {width} pixels wide is too narrow: {NARROWEST} or more.")
    width -= width % 2
    room = width - 2 * MARGIN
    stage = _stage(scene, frame, room, Canvas)
    legend = _legend(scene, room)
    chart = CHART if any(lines.shape[1] for lines in scene.series.values()) else 0
    height = MARGIN + LINE + stage.height + LINE + 4 + chart + LINE * len(legend) + MARGIN
    sheet = Canvas(width, height + height % 2)
    sheet.text((MARGIN, MARGIN + 7), fitted(scene.title, TEXT, room), TEXT, INK, anchor="lm")
    y = MARGIN + LINE
    sheet.paste(stage, (MARGIN, y))
    y += stage.height
    _write_moment(sheet, scene, frame, y + 12)
    y += LINE + 4
    if chart:
        plot = Canvas(room, chart)
        _plot(plot, scene, frame)
        sheet.paste(plot, (MARGIN, y))
    _write_legend(sheet, legend, y + chart + LINE // 2)
    return sheet.picture()


def still(scene: Scene, frame: int, *, width: int = STILL) -> str:
    """One frame and what its colours mean as an SVG element, without title, caption and chart.

    Args:
        scene: in the plane or in space.
        frame: which, from 0.
        width: of the drawing (pixels).

    Raises:
        EthogramError: there is no such frame.

    """
    if not 0 <= frame < len(scene.tint):
        raise EthogramError(f"Scene {scene.title!r} has no frame {frame}.")
    stage = _stage(scene, frame, width - 2 * MARGIN, SvgCanvas)
    legend = _legend(scene, width - 2 * MARGIN)
    sheet = SvgCanvas(width, MARGIN + stage.height + LINE * len(legend) + MARGIN)
    sheet.paste(stage, (MARGIN, MARGIN))
    _write_legend(sheet, legend, MARGIN + stage.height + LINE // 2 + 2)
    return sheet.svg()


def _write_legend(
    sheet: Canvas | SvgCanvas, legend: list[list[tuple[float, str, str]]], y: float
) -> None:
    for at, row in enumerate(legend):
        middle = y + LINE * at
        for x, look, meaning in row:
            left = MARGIN + x
            sheet.box(((left, middle - 5), (left + 10, middle + 5)), look)
            sheet.text((left + 15, middle), meaning, SMALL, INK, anchor="lm")


def _write_moment(sheet: Canvas, scene: Scene, frame: int, y: float) -> None:
    """The caption, and at the right for how long of how many seconds the scene has been shown."""
    last, seconds = len(scene.tint) - 1, scene.frame_seconds
    clock = f"{frame * seconds:.1f} of {last * seconds:.1f} s"
    room = sheet.width - 3 * MARGIN - measure(clock, SMALL)
    sheet.text((sheet.width - MARGIN, y), clock, SMALL, MUTED, anchor="rm")
    caption = fitted(scene.captions[frame], TEXT, max(room, 0.0))
    sheet.text((MARGIN, y), caption, TEXT, INK, anchor="lm")


def _stage(scene: Scene, frame: int, width: int, canvas: type[AnyPen]) -> AnyPen:
    """The scene itself, framed."""
    if scene.position.shape[2] == 3:
        stage = canvas(width, round(width / IN_SPACE))
        places = space3d.draw(stage, scene, frame)
        for shape in _visible(scene, frame, places):
            _draw_label(stage, scene, shape, places[shape])
    else:
        left, bottom, right, top = scene.bounds
        ratio = (right - left) / max(top - bottom, 1e-9)
        stage = canvas(width, round(width * min(MOST_HEIGHT, 1 / min(4.0, max(1.0, ratio)))))
        places = _places(stage, scene, frame)
        _draw_plane(stage, scene, frame, places)
    _draw_words(stage, scene, frame, places)
    stage.box(((0, 0), (stage.width, stage.height)), None, RULE)
    return stage


def _places(stage: Canvas | SvgCanvas, scene: Scene, frame: int) -> Float[np.ndarray, "shape 3"]:
    """Where the shapes are: x, y and radius in pixels, the same scale on both axes."""
    left, bottom, right, top = scene.bounds
    across, up = max(right - left, 1e-9), max(top - bottom, 1e-9)
    unit = min(stage.width / across, stage.height / up)
    x, y = scene.position[frame].T.astype(float)
    size = np.array([shape.size for shape in scene.shapes], float)
    if scene.scale is not None:
        size = size * scene.scale[frame]
    return np.column_stack(
        [
            (stage.width - unit * across) / 2 + unit * (x - left),
            (stage.height - unit * up) / 2 + unit * (top - y),
            unit * size,
        ]
    )


def _visible(scene: Scene, frame: int, places: Float[np.ndarray, "shape 3"]) -> list[int]:
    return np.flatnonzero((scene.tint[frame] >= 0) & np.isfinite(places).all(1)).tolist()


def _draw_plane(
    stage: Canvas | SvgCanvas, scene: Scene, frame: int, places: Float[np.ndarray, "shape 3"]
) -> None:
    visible = _visible(scene, frame, places)
    for link in scene.links:
        if set(link) <= set(visible):
            stage.line(places[list(link), :2], MUTED)
    for shape in visible:
        x, y, radius = places[shape].tolist()
        look = colour(int(scene.tint[frame, shape]))
        kind = scene.shapes[shape].kind
        if kind == "square":
            corners = (x - radius, y - radius), (x + radius, y + radius)
            stage.box(corners, look)
        elif kind == "ring":
            stage.ring((x, y), max(radius, 1), look)
        elif kind != "text":
            if radius > 3:  # a rim, so that it is seen on a square and beside others of its tint
                stage.disc((x, y), radius + 1, PAPER)
            stage.disc((x, y), max(radius, 1), look)
        _draw_label(stage, scene, shape, places[shape])


def _draw_label(
    stage: Canvas | SvgCanvas, scene: Scene, shape: int, place: Float[np.ndarray, "3"]
) -> None:
    """Within a circle where there is room, else above it.

    A square's is below it: above are words, and what stands on the square.
    """
    kind, label = scene.shapes[shape].kind, scene.shapes[shape].label
    if not label:
        return
    x, y, radius = place.tolist()
    size = max(10.0, min(13.0, stage.width / 50))
    inside = kind == "circle" and measure(label, size) < 2 * radius
    if not inside and kind != "text":
        y += radius + 9 if kind == "square" else -radius - 9
    shown = fitted(label, size, stage.width)
    stage.text((x, y), shown, size, PAPER if inside else INK, halo=not inside)


def _draw_words(
    stage: Canvas | SvgCanvas, scene: Scene, frame: int, places: Float[np.ndarray, "shape 3"]
) -> None:
    """What shapes say, beside them; where there is no room, a dot tells that they say something."""
    if scene.said is None:
        return
    solid = scene.position.shape[2] == 3
    heard = [
        shape
        for shape in _visible(scene, frame, places)
        if solid or scene.shapes[shape].kind in ("circle", "ring") or scene.said[frame, shape] >= 0
    ]
    words = [_word(scene, frame, shape, stage.width) for shape in heard]
    speakers = [
        Speaker._make((*places[shape].tolist(), measure(word, WORD) + 8 if word else 0.0))
        for shape, word in zip(heard, words, strict=True)
    ]
    found = boxes(speakers, stage.width, stage.height)
    for word, (x, y, radius, wide), box in zip(words, speakers, found, strict=True):
        if box is None:
            if wide:
                stage.disc((x, y - radius), 3, INK)
            continue
        if box.bottom < y - radius - HIGH:
            stage.line([(x, y - radius), (min(max(x, box.left), box.right), box.bottom)], INK)
        stage.box((box[:2], box[2:]), PAPER, INK)
        middle = (box.left + box.right) / 2, (box.top + box.bottom) / 2
        stage.text(middle, word, WORD, INK)


def _word(scene: Scene, frame: int, shape: int, room: float) -> str:
    """What a shape says, cut to the room there is; nothing if it is silent."""
    said = -1 if scene.said is None else int(scene.said[frame, shape])
    return fitted(scene.words[said], WORD, room - 8) if 0 <= said < len(scene.words) else ""


def _plot(chart: Canvas, scene: Scene, frame: int) -> None:
    """All lines of all series over the frames, on one scale, and a mark at the frame."""
    lines = np.concatenate(list(scene.series.values()), 1).astype(float)
    known = np.isfinite(lines)
    low, high = (lines[known].min(), lines[known].max()) if known.any() else (0.0, 1.0)
    high = high if high > low else low + 1
    left, right = AXIS + 4, chart.width - 6
    x = left + (right - left) * np.arange(len(lines)) / max(1, len(lines) - 1)
    top, bottom = 20, chart.height - 26
    y = bottom - (bottom - top) * (lines - low) / (high - low)
    for number, place in ((high, top), (low, bottom)):
        shown = fitted(f"{number:.3g}", SMALL, AXIS)
        chart.text((AXIS, place - 1), shown, SMALL, MUTED, anchor="rm")
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
    left, line = 0.0, 0
    for name, lines in scene.series.items():
        count = lines.shape[1]
        named = [f"{name} {at + 1}" if count > 1 else name for at in range(count)]
        wide = sum(measure(each, SMALL) + 12 for each in named)
        if count > len(LINES) or wide > room - left:
            named = [f"{name}, {count} lines"]
        for at, each in enumerate(named):
            shown = fitted(each, SMALL, max(room - left, 0.0))
            look = _line_colour(line + at) if len(named) == count else MUTED
            yield left, shown, look
            left += measure(shown, SMALL) + 12
        line += count


def _legend(scene: Scene, room: float) -> list[list[tuple[float, str, str]]]:
    """Rows of entries of the palette: where each is, its colour, its meaning."""
    graded = scene.position.shape[2] == 3 and scene.scale is not None
    rows: list[list[tuple[float, str, str]]] = [[]]
    left = 0.0
    for tint, meaning in enumerate(scene.palette):
        shown = fitted(meaning, SMALL, room - 15)
        wide = 15 + measure(shown, SMALL)
        if rows[-1] and left + wide > room:
            rows.append([])
            left = 0.0
        look = space3d.TINTS[tint] if graded and tint < len(bodies.TINTS) else colour(tint)
        rows[-1].append((left, look, shown))
        left += wide + 14
    return [row for row in rows if row]
