"""Recorded scenes packed for the player: numbers as 16-bit steps, compressed, inside the page.

The player (`templates/replay.js`, with a stage for the plane and one for space) draws what it is
given and knows no world.  Positions and sizes
are rounded to one of 65 535 steps between the smallest and the largest; every number but those of
the first frame is stored as its difference from the frame before, which compresses well.
"""

import base64
import gzip
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ethogram.core.scene import Scene

STEPS = 65_534  # between the smallest and the largest number
NO_NUMBER = -32_768  # the one 16-bit number that is no step


@dataclass(frozen=True, kw_only=True)
class Replay:
    """A scene that a page shows, and what it is called there."""

    name: str  # the case's
    scene: Scene | None  # None where what is stored is no scene
    trouble: str = ""  # then: why
    trial: int = 1  # of the case, from 1

    @property
    def solid(self) -> bool:
        """Whether the scene is in space, not in the plane."""
        return self.scene is not None and self.scene.position.shape[2] == 3


def packed(replays: Sequence[Replay]) -> str:
    """All replays of a page as JSON that can stand inside a page's script element."""
    text = json.dumps([_scene(each) for each in replays], allow_nan=False)
    # no text can end the element or begin a comment in it
    for mark in "<>&":
        text = text.replace(mark, f"\\u{ord(mark):04x}")
    return text


def _scene(replay: Replay) -> dict[str, Any]:
    scene = replay.scene
    if scene is None:
        return {"name": replay.name, "trial": replay.trial, "trouble": replay.trouble}
    frames = len(scene.tint)
    series = np.concatenate(
        [np.zeros((frames, 0)), *(lines for lines in scene.series.values())], axis=1
    )
    arrays = {
        "position": _rounded(scene.position),
        "tint": _whole(np.where(np.isfinite(scene.position).all(-1), scene.tint, -1)),  # or hidden
        "said": None if scene.said is None else _whole(scene.said),
        "scale": None if scene.scale is None else _rounded(scene.scale),
        "fresh": None if scene.fresh is None else _whole(scene.fresh),
        "orientation": None if scene.orientation is None else _rounded(scene.orientation),
        "series": _rounded(series),
    }
    return {
        "name": replay.name,
        "trial": replay.trial,
        "title": scene.title,
        "axes": scene.position.shape[2],
        "bounds": list(map(float, scene.bounds)),
        "seconds": scene.frame_seconds,
        "frames": frames,
        "shapes": [[shape.kind, float(shape.size), shape.label] for shape in scene.shapes],
        "links": [list(link) for link in scene.links],
        "palette": list(scene.palette),
        "words": list(scene.words),
        "captions": list(scene.captions),
        "chapters": _beginnings(scene.chapters),
        "lines": [[name, lines.shape[1]] for name, lines in scene.series.items()],
        "arrays": {name: array for name, array in arrays.items() if array is not None},
    }


def _beginnings(chapters: Sequence[str]) -> list[tuple[int, str]]:
    """The first frame of each chapter, and its name."""
    return [
        (frame, name)
        for frame, name in enumerate(chapters)
        if frame == 0 or name != chapters[frame - 1]
    ]


def _rounded(values: np.ndarray) -> dict[str, Any]:
    """Numbers as steps; what is not finite is no number."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    step = (high - low) / STEPS or 1.0
    steps = np.round((np.where(np.isfinite(values), values, low) - low) / step) - STEPS // 2
    steps = np.where(np.isfinite(values), steps, NO_NUMBER)
    return {"low": low, "step": step, "data": _compressed(steps)}


def _whole(values: np.ndarray) -> dict[str, Any]:
    """Whole numbers as they are."""
    return {"low": float(-(STEPS // 2)), "step": 1.0, "data": _compressed(values)}


def _compressed(numbers: np.ndarray) -> str:
    """Differences from frame to frame, in 16 bits that wrap around, as base64 of gzip."""
    short = numbers.astype(np.int16)
    steps = np.diff(short, axis=0, prepend=np.zeros_like(short[:1]))
    content = gzip.compress(steps.astype("<i2").tobytes(), compresslevel=9, mtime=0)
    return base64.b64encode(content).decode()
