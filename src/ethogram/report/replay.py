"""Recorded scenes encoded for the player: numbers as 16-bit steps, compressed, inside the page.

The player (`templates/replay.js`, with a stage for the plane and one for space) draws what it is
given and knows no world.  Every number that a frame has (a shape's x, that of a vertex) is rounded
to one of 65 535 steps between its own smallest and largest in all frames, so that none takes the
others' precision; all but those of the first frame are stored as differences from the frame before,
which compress well.  A background stands there as it is.  A scene that would take more room than
there is loses frames, evenly, and says so.
"""

import base64
import gzip
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ethogram.core.scene import GRADED_RANGE, OPTIONAL, Point, Scene, Shape
from ethogram.report.render.canvas import letter_colour

STEPS = 65_534  # between the smallest and the largest number
NAN_CODE = -32_768  # the one 16-bit number that is no step


@dataclass(frozen=True, kw_only=True)
class Replay:
    """A scene that a page shows, and what it is called there."""

    name: str  # the case's
    scene: Scene | None  # None where what is stored is no scene
    error: str = ""  # then: why
    trial: int = 1  # of the case, from 1

    @property
    def in_space(self) -> bool:
        """Whether the scene is in space, not in the plane."""
        return self.scene is not None and self.scene.axes == 3


def encode_replays(replays: Sequence[Replay], room: float = math.inf) -> str:
    """All replays of a page as JSON that can stand inside a page's script element.

    Args:
        replays: what to show.
        room: how long the text may be; scenes that need more than their share of it are thinned.

    """
    texts = [_encode(replay) for replay in replays]
    limit = _fair_share([len(text) for text in texts], room)
    fitting = [
        text if len(text) <= limit else _encode_subsampled(replay, len(text), limit)
        for replay, text in zip(replays, texts, strict=True)
    ]
    return f"[{', '.join(fitting)}]"


def _fair_share(sizes: Sequence[int], room: float) -> float:
    """How long a text may be so that all together have room: what short ones leave is shared."""
    left, room = len(sizes), room - 2 * len(sizes)  # brackets and commas
    limit = room
    for size in sorted(sizes):
        limit = room / left
        if size > limit:
            return limit
        room, left = room - size, left - 1
    return math.inf


def _encode_subsampled(replay: Replay, size: int, limit: float) -> str:
    """With as many frames as there is room for, or with the reason why there is none."""
    scene = replay.scene
    if scene is None:
        return _encode(replay)
    frames, step = len(scene.tint), 1
    while limit > 0 and step < frames:
        step = min(frames, max(step + 1, math.ceil(step * size / limit)))
        text = _encode(replace(replay, scene=subsample(scene, step)), thinned=(frames, step))
        size = len(text)
        if size <= limit:
            return text
    error = "even a single frame needs more room than this page has for it"
    return _encode(replace(replay, scene=None, error=error))


def subsample(scene: Scene, step: int) -> Scene:
    """Every so-many-th frame of a scene, each shown for as much longer: it takes the same time."""
    arrays = {name: getattr(scene, name) for name in OPTIONAL}
    optional: dict[str, Any] = {
        name: array[::step] for name, array in arrays.items() if array is not None
    }
    if scene.fresh is not None:  # what was there anew in between did not move to where it is
        groups = np.pad(scene.fresh, ((step - 1, 0), (0, 0)))[: step * len(scene.tint[::step])]
        optional["fresh"] = groups.reshape(-1, step, groups.shape[1]).any(1)
    return replace(
        scene,
        frame_seconds=scene.frame_seconds * step,
        position=scene.position[::step],
        tint=scene.tint[::step],
        captions=scene.captions[::step],
        chapters=scene.chapters[::step],
        series={name: lines[::step] for name, lines in scene.series.items()},
        **optional,
    )


def _encode(replay: Replay, thinned: tuple[int, int] | None = None) -> str:
    """A replay as JSON, with how many frames there were and every which of them is left."""
    plain = _replay_json(replay) | ({"thinned": thinned} if thinned else {})
    text = json.dumps(plain, allow_nan=False, default=float)
    # no text can end the element or begin a comment in it
    for mark in "<>&":
        text = text.replace(mark, f"\\u{ord(mark):04x}")
    return text


def _replay_json(replay: Replay) -> dict[str, Any]:
    scene = replay.scene
    if scene is None:
        return {"name": replay.name, "trial": replay.trial, "error": replay.error}
    frames = len(scene.tint)
    series = np.concatenate(
        [np.zeros((frames, 0)), *(lines for lines in scene.series.values())], axis=1
    )
    arrays = {
        "position": _quantize(scene.position),
        "tint": _encode_integers(np.where(scene.visible(), scene.tint, -1)),
        "said": None if scene.said is None else _encode_integers(scene.said),
        "scale": None if scene.scale is None else _quantize(scene.scale),
        "fresh": None if scene.fresh is None else _encode_integers(scene.fresh),
        "orientation": None if scene.orientation is None else _quantize(scene.orientation),
        "heading": None if scene.heading is None else _quantize(scene.heading),
        "vertices": None if scene.vertices is None else _quantize(scene.vertices),
        "series": _quantize(series),
    }
    return {
        "name": replay.name,
        "trial": replay.trial,
        "title": scene.title,
        "axes": scene.axes,
        "bounds": list(map(float, scene.bounds)),
        "seconds": scene.frame_seconds,
        "frames": frames,
        "shapes": [_shape(shape) for shape in scene.shapes],
        "vertices": 0 if scene.vertices is None else scene.vertices.shape[2],
        "background": [
            [each.kind, _points(each.vertices), each.tint, float(each.width)]
            for each in scene.background
        ],
        "links": [list(link) for link in scene.links],
        "palette": [[*tint, letter_colour(tint.colour)] for tint in scene.palette],
        "graded": GRADED_RANGE if scene.graded else 0,
        "words": list(scene.words),
        "captions": list(scene.captions),
        "chapters": _chapter_starts(scene.chapters),
        "lines": [[name, lines.shape[1]] for name, lines in scene.series.items()],
        "arrays": {name: array for name, array in arrays.items() if array is not None},
    }


def _shape(shape: Shape) -> list[Any]:
    plain = [shape.kind, float(shape.size), shape.label]
    return [*plain, _points(shape.vertices)] if shape.vertices else plain


def _points(vertices: Sequence[Point]) -> list[list[float]]:
    return [[float(x), float(y)] for x, y in vertices]


def _chapter_starts(chapters: Sequence[str]) -> list[tuple[int, str]]:
    """The first frame of each chapter, and its name."""
    return [
        (frame, name)
        for frame, name in enumerate(chapters)
        if frame == 0 or name != chapters[frame - 1]
    ]


def _quantize(values: np.ndarray) -> dict[str, Any]:
    """Numbers as steps of their own range over the frames; what is not finite is no number.

    The ranges, all lows and then all steps, are in 32 bits, as is what the player makes of them.
    """
    numbers = values.reshape(len(values), -1).astype(float)
    finite = np.isfinite(numbers)
    low = np.where(finite, numbers, np.inf).min(0, initial=np.inf)
    high = np.where(finite, numbers, -np.inf).max(0, initial=-np.inf)
    low = np.where(np.isfinite(low), low, 0.0).astype("<f4").astype(float)
    high = np.where(np.isfinite(high), high, low)
    step = ((high - low) / STEPS).astype("<f4").astype(float)
    step = np.where(step > 0, step, 1.0)
    steps = np.clip(np.round((np.where(finite, numbers, low) - low) / step), 0, STEPS) - STEPS // 2
    ranges = np.concatenate([low, step]).astype("<f4").tobytes()
    return {
        "ranges": base64.b64encode(ranges).decode(),
        "data": _compress(np.where(finite, steps, NAN_CODE)),
    }


def _encode_integers(values: np.ndarray) -> dict[str, Any]:
    """Whole numbers as they are."""
    return {"data": _compress(values)}


def _compress(numbers: np.ndarray) -> str:
    """Differences from frame to frame, in 16 bits that wrap around, as base64 of gzip."""
    short = numbers.astype(np.int16)
    steps = np.diff(short, axis=0, prepend=np.zeros_like(short[:1]))
    content = gzip.compress(steps.astype("<i2").tobytes(), compresslevel=9, mtime=0)
    return base64.b64encode(content).decode()
