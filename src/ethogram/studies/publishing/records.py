"""What is kept of a case: as little as tables and figures read, and a scene within a budget.

Of the figures' scenarios every year is kept.  Of other readings, of which tables alone are made,
the papers of some years are added up: of each span of years that a measure tells apart (`spans`).
Indicators are kept where they are read: those of authors, who are many, in the years that the
figures show, and those of journals in every year; of other readings both in the last year alone.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from jaxtyping import Float, Int, Num

from ethogram.core.recorded import grouped
from ethogram.core.scene import Scene
from ethogram.studies.publishing.condition import SNAPSHOTS, Condition
from ethogram.studies.readings import DEFAULT
from ethogram.worlds.publishing.indicators import INDICATORS

LAST_YEARS = 5  # whose papers are looked at in the end: one year may have too few
COUNTED_YEARS = 2  # before the last: those whose papers its impact factors count
PAPERS = "papers"  # the indicator that is no array of its own: the sum of the papers so far
SCENE_BYTES = 100_000  # of all scenes of a case
FRAMES_PER_STEP = 2  # of scenes


class Kept(NamedTuple):
    """Years, counted from 0, that of the initial state."""

    papers: list[int]  # the last of each span whose papers are kept together
    authors: list[int]  # at whose end the indicators of authors are kept
    journals: list[int]


def kept(condition: Condition, years: int) -> Kept:
    """What is kept of a condition."""
    if condition.reading != DEFAULT:
        return Kept(spans(years), [years], [years])
    every = list(range(years + 1))
    return Kept(every, [year for year in every if year in {0, years, *SNAPSHOTS}], every)


def spans(years: int) -> list[int]:
    """The last year of each span: initial years, the first, the middle, and then those of the end.

    The last five, the two that the last impact factors count, and the last can be told apart.
    """
    ends = years - np.array([LAST_YEARS, COUNTED_YEARS + 1, 1, 0])
    return sorted({0, min(1, years), *(int(end) for end in ends if end > 0)})


def results(
    condition: Condition,
    flows: Mapping[str, Num[np.ndarray, "trial year *of"]],
    indicators: Mapping[str, Float[np.ndarray, "trial year agent"]],
    author_quality: Float[np.ndarray, "trial author"],
    stuck: Float[np.ndarray, "trial year"],
) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """The arrays of a record with their dimensions.

    Args:
        condition: what was run.
        flows: `papers` and `quality` (the sum of theirs) by journal, and the `histogram` of their
            qualities, of what was published in every year.
        indicators: at the end of every year, by name.
        author_quality: of all authors.
        stuck: the share of the authors whose draft was rejected more than ten times.

    """
    years = kept(condition, stuck.shape[1] - 1)
    first = [0, *(end + 1 for end in years.papers[:-1])]
    found: dict[str, tuple[tuple[str, ...], np.ndarray]] = {
        "author_quality": (("trial", "author"), author_quality.astype(np.float32)),
        "stuck": (("trial", "author_year"), stuck[:, years.authors].astype(np.float32)),
    }
    for name, flow in flows.items():
        of = "bin" if name == "histogram" else "journal"
        found[name] = (("trial", "year", of), compact(np.add.reduceat(flow, first, axis=1)))
    for name, values in indicators.items():
        of = INDICATORS[name].of
        if name != PAPERS:
            at = years.authors if of == "author" else years.journals
            found[f"indicator.{name}"] = (("trial", f"{of}_year", of), compact(values[:, at]))
    return found


def coordinates(condition: Condition, years: int, edges: np.ndarray) -> dict[str, Any]:
    """Which years, and which qualities, stand along the axes."""
    at = kept(condition, years)
    return {
        "year": ("year", np.array(at.papers)),
        "author_year": ("author_year", np.array(at.authors)),
        "journal_year": ("journal_year", np.array(at.journals)),
        "bin": ("bin", (edges[1:] + edges[:-1]) / 2),
    }


def compact(values: np.ndarray) -> np.ndarray:
    """Numbers for a record: whole ones in the smallest type that holds them, others in 32 bits.

    Types have a sign, so that differences of what is stored are right.
    """
    if not (np.isfinite(values).all() and (values == np.round(values)).all()):
        return values.astype(np.float32)
    most = np.abs(values).max(initial=0)
    for bits, whole in ((8, np.int8), (16, np.int16), (32, np.int32)):
        if most < 2 ** (bits - 1):
            return values.astype(whole)
    return values.astype(np.float32)


def scenes(trials: Iterable[Scene], per_year: int) -> dict[str, xr.Dataset]:
    """The scenes of a case's first trials as groups of its record, of `SCENE_BYTES` or less.

    All years are shown if they fit, then those that the figures show, and of these as many whole
    steps as fit; further trials follow while there is room.

    Args:
        trials: the scenes of all years, two frames a step; no more are taken than fit.
        per_year: steps of a year.

    """
    found: list[Scene] = []
    room = SCENE_BYTES
    for scene in trials:
        steps = np.arange(len(scene.position) // FRAMES_PER_STEP)
        whole = excerpt(scene, steps)
        each = whole.to_dataset().nbytes / max(1, len(steps))  # bytes of a step
        if each * len(steps) > room:
            steps = steps[np.isin(1 + steps // per_year, SNAPSHOTS)]
        if each * len(steps) > room:
            steps = steps[: 0 if found else int(room / each)]
        if not len(steps):
            break
        found.append(excerpt(scene, steps))
        room -= found[-1].to_dataset().nbytes
    return grouped(found)


def excerpt(scene: Scene, steps: Int[np.ndarray, "step"]) -> Scene:
    """Some steps of a scene, in the types that its numbers need on a screen.

    In a step that does not follow the one before it, everything is there anew.
    """
    frames = (FRAMES_PER_STEP * steps[:, None] + np.arange(FRAMES_PER_STEP)).ravel()
    assert scene.scale is not None
    assert scene.fresh is not None
    anew = np.diff(frames, prepend=frames[:1] - 1) != 1
    return replace(
        scene,
        position=scene.position[frames].astype(np.float16),
        tint=scene.tint[frames].astype(np.int8),
        scale=scene.scale[frames].astype(np.float16),
        fresh=scene.fresh[frames] | anew[:, None],
        captions=tuple(scene.captions[frame] for frame in frames),
        chapters=tuple(scene.chapters[frame] for frame in frames),
        series={name: lines[frames] for name, lines in scene.series.items()},
    )
