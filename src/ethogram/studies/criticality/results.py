"""The measures of the chapter, one number per body, taken from stored records."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from jaxtyping import Float, Int
from scipy.stats import rankdata

from ethogram.campaign.study import Records
from ethogram.studies import chapter
from ethogram.studies.criticality.condition import WORDS, Condition
from ethogram.studies.criticality.found import BODIES
from ethogram.studies.criticality.tasks import THESIS_TASKS, TaskCondition
from ethogram.studies.statistics import Support, Trials, bounded

SQUARES = Condition("thresholds")
HIGHEST = 2.0  # that a score can be


@dataclass(frozen=True)
class Results(chapter.Results[Condition]):
    """The stored results by condition; the runs of evolution, each a record, together."""

    @classmethod
    def of(cls, records: Records) -> "Results":
        """Results by the condition that they say they are of, in the order of the tables."""
        found: dict[Condition, list[xr.Dataset]] = {}
        for groups in records.values():
            data = groups["results"]
            if "task" in data.attrs:
                continue
            found.setdefault(Condition(str(data.attrs["bodies"])), []).append(data)
        run = [Condition(name) for name in WORDS if Condition(name) in found]
        return cls({at: _together(found[at]) for at in run})

    @property
    def scored(self) -> dict[Condition, xr.Dataset]:
        """All but the threshold test."""
        return {at: data for at, data in self.by_condition.items() if at != SQUARES}

    def bodies(self, condition: Condition) -> dict[str, str]:
        """The bodies of a condition by name, as text: "opt-0"."""
        data = self.by_condition[condition]
        layers = str(data.attrs["layers"]).split()
        named = str(data.attrs["names"]).split()
        prefix = {"evolved": "opt", "minimised": "min"}.get(condition.bodies, condition.bodies)
        return dict(
            zip(named or [f"{prefix}-{i}" for i in range(len(layers))], layers, strict=True)
        )


def _together(parts: list[xr.Dataset]) -> xr.Dataset:
    """The trials of several records, one after the other."""
    parts = sorted(parts, key=lambda data: int(data.attrs["first"]))
    if len(parts) == 1:
        return parts[0]
    most = max(data.sizes["voxel"] for data in parts)
    padded = [data.pad(voxel=(0, most - data.sizes["voxel"]), constant_values=0) for data in parts]
    whole = xr.concat(padded, "trial", combine_attrs="override")
    layers = " ".join(str(data.attrs["layers"]) for data in parts)
    return whole.assign_attrs(layers=layers)


@bounded(lambda _: Support(low=0.0, high=HIGHEST))
def score(data: xr.Dataset) -> np.ndarray:
    """Criticality of each body."""
    found: np.ndarray = data["score"].values
    return found


def sizes(data: xr.Dataset, trial: int) -> Int[np.ndarray, "avalanche"]:
    """Sizes of the avalanches of a body."""
    voxels = int(data["voxels"][trial])
    found: np.ndarray = data["size"].values[trial, :voxels].astype(int)
    return found


class Thresholds:
    """What the threshold test finds (section 6.4.1)."""

    def __init__(self, data: xr.Dataset) -> None:
        """Read the test's results."""
        self.sides = data["side"].values.astype(int)
        self.tried = data["threshold"].values.astype(float)
        self._sizes = data["size"].transpose("trial", "threshold", "voxel").values.astype(int)

    def sizes(self, place: int, number: int) -> Int[np.ndarray, "avalanche"]:
        """Of the avalanches of a square body at a threshold."""
        found: np.ndarray = self._sizes[place, number, : self.sides[place] ** 2]
        return found

    @property
    def chosen(self) -> Float[np.ndarray, "side"]:
        """For each square body the threshold at which sizes vary the most."""
        places = range(len(self.sides))
        most = [
            max(range(len(self.tried)), key=lambda number: self.sizes(place, number).var())
            for place in places
        ]
        return self.tried[most]

    @property
    def coefficients(self) -> Float[np.ndarray, "3"]:
        """lambda_1, lambda_2, lambda_3 of the parabola through them, in the number of voxels."""
        found: np.ndarray = np.polynomial.polynomial.polyfit(self.sides**2, self.chosen, 2)
        return found


@dataclass(frozen=True)
class TaskResults(chapter.Results[TaskCondition]):
    """The stored results of bodies in tasks."""

    @classmethod
    def of(cls, records: Records) -> "TaskResults":
        """Results by the condition that they say they are of, in the order of the bodies."""
        found = {}
        for groups in records.values():
            attrs = groups["results"].attrs
            if "task" in attrs:
                at = (str(attrs[name]) for name in ("body", "task", "controller"))
                found[TaskCondition(*at)] = groups["results"]
        order = list(BODIES)
        return cls(dict(sorted(found.items(), key=lambda item: order.index(item[0].body))))

    @property
    def bodies(self) -> list[str]:
        """Of which anything was run."""
        return list(dict.fromkeys(at.body for at in self.by_condition))

    def of_task(self, body: str, task: str, controller: str = "phase") -> Trials:
        """How well the best controller of each run of a body does: m/s, of a jump m."""
        return self.trials(performance, TaskCondition(body, task, controller))

    def is_complete(self, body: str) -> bool:
        """Whether a body was run in all three tasks."""
        return all(self.of_task(body, task).values is not None for task in THESIS_TASKS)

    def average_ranks(self, bodies: Sequence[str]) -> dict[str, Trials]:
        """For each run the rank of a body among some, the mean over the three tasks; 1 is best.

        The first run of each body is ranked among the first runs of the others, and so on.  Nothing
        where a body was not run in a task, or in fewer runs.
        """
        values = [[self.of_task(body, task).values for body in bodies] for task in THESIS_TASKS]
        missing = Trials("all of these bodies in the three tasks", None)
        if not bodies or any(each is None for row in values for each in row):
            return dict.fromkeys(bodies, missing)
        runs = min(len(each) for row in values for each in row if each is not None)
        table = np.array([[each[:runs] for each in row if each is not None] for row in values])
        ranks = rankdata(-table, axis=1).mean(0)  # body, run
        return {
            body: Trials(f"average rank of {body}", each)
            for body, each in zip(bodies, ranks, strict=True)
        }


def performance(data: xr.Dataset) -> np.ndarray:
    """Velocity of the best controller of each run (m/s); of a jump its height (m)."""
    found: np.ndarray = data["value"].values.astype(float)
    return found if int(data.attrs["rises"]) else found / float(data.attrs["seconds"])


def penalised(data: xr.Dataset) -> np.ndarray:
    """The same made less by the energy that it takes, in thousandths."""
    found: np.ndarray = 1e3 * data["energy_fitness"].values.astype(float)
    return found
