"""A study that takes no time: a random walk for each letter, which goes wrong on demand.

A file "<letter>.<anything>.<mishap>" in the folder that `TOY_MISHAPS` names is taken away by the
case of that letter, which then comes to grief; so each mishap happens once.  One called
"<letter><chunk>.<anything>.<mishap>" waits for a chunk, counted from 0.
"""

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import xarray as xr
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from ethogram.campaign import interrupts
from ethogram.campaign.arrays import Record
from ethogram.campaign.case import Case, Cost
from ethogram.campaign.context import Context
from ethogram.campaign.plan import Plan
from ethogram.campaign.study import Records
from ethogram.core.errors import EthogramError
from ethogram.core.findings import Claim, Figure, Measured, Table

NAME = "toy"
VERSION = "1"
TITLE = "A toy"
QUESTION = "Where does a random walk end?"

_STRICT = ConfigDict(extra="forbid", strict=True)


@dataclass(frozen=True, kw_only=True, config=_STRICT)
class Walk:
    """How the walk goes."""

    steps: Annotated[int, Field(ge=1, le=1000)] = 20
    stride: Annotated[float, Field(gt=0)] = 1.0
    style: Literal["straight", "winding"] = "winding"


@dataclass(frozen=True, kw_only=True, config=_STRICT)
class Settings:
    """Everything that fixes a case's numbers."""

    walk: Walk = Walk()
    letter: Literal["a", "b", "c", "d"] = "a"
    chunks: Annotated[int, Field(ge=1, le=10)] = 3
    pauses: tuple[int, ...] = (1, 2)
    label: str = "walk"
    detour: Walk | None = None
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0


PLANS = {
    "smoke": Plan("smoke", "Three walks.", Settings(), {"letter": ("a", "b", "c")}),
    "single": Plan("single", "One walk, no axis.", Settings()),
}


def cases(plan: Plan[Settings]) -> list[Case]:
    """One case per letter."""
    return [
        Case.of(study=NAME, version=VERSION, name=point.letter, settings=point)
        for point in plan.points()
    ]


def cost(case: Case) -> Cost:
    """Next to nothing."""
    return Cost(seconds=0.01 * case.parsed(Settings).chunks, bytes=1000)


def run(case: Case, context: Context) -> Record:
    """Walk in chunks, with a checkpoint after each."""
    settings = case.parsed(Settings)
    state = context.restore() or {"place": np.zeros(settings.walk.steps), "done": np.array(0)}
    place = state["place"]
    for chunk in range(int(state["done"]), settings.chunks):
        _note(f"{case.name}{chunk}")
        _come_to_grief(case.name)
        _come_to_grief(f"{case.name}{chunk}")
        key = (settings.seed, ord(settings.letter), chunk)
        walk = np.random.default_rng(key).normal(size=settings.walk.steps).cumsum()
        place = place + settings.walk.stride * walk
        context.progress(chunk + 1, settings.chunks)
        context.checkpoint(_maker(place, chunk + 1))
    results = xr.Dataset(
        {"place": ("step", place), "end": ((), place[-1])},
        coords={"step": np.arange(settings.walk.steps)},
        attrs={"letter": settings.letter},
    )
    return {"results": results, "scene-1": xr.Dataset({"x": ("step", place.astype(np.float32))})}


def _maker(place: np.ndarray, done: int) -> Any:
    return lambda: {"place": place, "done": np.array(done)}


def _note(what: str) -> None:
    """Leave a trace of each chunk that is computed, for tests that count them."""
    if "TOY_LOG" in os.environ:
        with Path(os.environ["TOY_LOG"]).open("a") as log:
            log.write(f"{what}\n")


def _mishaps(name: str) -> Iterator[str]:
    """The mishaps that wait for a case, each taken away by whoever comes first."""
    if "TOY_MISHAPS" in os.environ:
        for path in sorted(Path(os.environ["TOY_MISHAPS"]).glob(f"{name}.*")):
            try:
                path.unlink()
            except FileNotFoundError:
                continue
            yield path.suffix


def _come_to_grief(name: str) -> None:
    for mishap in _mishaps(name):
        match mishap:
            case ".raise":
                raise ValueError("a toy broke\nin two")
            case ".refuse":
                raise EthogramError("The toy is too large.")
            case ".die":
                os.kill(os.getpid(), signal.SIGKILL)
            case ".SIGINT" | ".SIGTERM" | ".SIGHUP":
                signal.raise_signal(signal.Signals[mishap[1:]])
            case ".linger":  # a long chunk, which ends when it should
                while not interrupts.stop_wanted():
                    time.sleep(0.01)
            case ".exit":
                os._exit(3)
            case ".hang":
                while True:
                    time.sleep(0.01)


def tables(records: Records) -> list[Table]:
    """Where the walks ended."""
    rows = tuple(
        (name, Measured(value=float(record["results"].end), published=0.0))
        for name, record in records.items()
    )
    return [Table(name="table-1", title="Ends", caption="", columns=("letter", "end"), rows=rows)]


def figures(records: Records) -> list[Figure]:
    """A line for no reason."""
    svg = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><path d="M0 0 9 9"/></svg>'
    return [
        Figure(
            name="figure-1",
            title="A line",
            caption="",
            alt="A line.",
            svg=svg,
            data=Table(name="figure-1", title="", caption="", columns=("x",), rows=((1,),)),
        )
        for _ in records
    ][:1]


def claims(records: Records) -> list[Claim]:
    """A claim with its evidence, and one without."""
    ends = [float(record["results"].end) for record in records.values()]
    return [
        Claim(
            number=1,
            statement="Walks end somewhere.",
            source="nowhere",
            test="mean end above -1000",
            effect=float(np.mean(ends)) if ends else None,
            low=-1.0 if ends else None,
            high=float("inf") if ends else None,
            unit="steps",
            p_value=0.01 if ends else None,
            verdict="confirmed" if ends else "not run",
            note="",
        ),
        Claim(
            number=2,
            statement="Walks return.",
            source="nowhere",
            test="none",
            effect=None,
            low=None,
            high=None,
            unit="steps",
            p_value=None,
            verdict="not run",
            note="no walk was long enough",
        ),
    ]


_come_to_grief("start")  # in a worker's process, before it has a case
