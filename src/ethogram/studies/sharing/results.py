"""The measures of the chapter, one number per trial, taken from stored records."""

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from ethogram.studies.sharing.compute import SHOWN, inequality
from ethogram.studies.sharing.plan import (
    FILLINGS,
    SCENARIOS,
    STRATEGIES,
    Condition,
    Strategy,
)
from ethogram.studies.sharing.validation import ACTS
from ethogram.studies.statistics import Trials
from ethogram.worlds.sharing.reward import Scenario

END_OF_TRAINING = 0.1  # the last tenth of the episodes
CLOSE = 0.05  # of the agents: a displacement this near to another one counts as the same

Records = Mapping[str, Mapping[str, xr.Dataset]]
Measure = Callable[[xr.Dataset, Condition], np.ndarray]  # -> [trial]


class Results(NamedTuple):
    """The stored results by condition."""

    by_condition: dict[Condition, xr.Dataset]

    @classmethod
    def of(cls, records: Records) -> "Results":
        """Pick the results out of records keyed by case name; other cases are passed over."""
        every = {condition.name: condition for condition in conditions()}
        return cls(
            {every[name]: groups["results"] for name, groups in records.items() if name in every}
        )

    def trials(self, measure: Measure, condition: Condition) -> Trials:
        """One number per trial of a condition, or word that it was not run."""
        data = self.by_condition.get(condition)
        values = None if data is None else measure(data, condition).astype(float)
        return Trials(condition.words, values)

    def largest_return(self, scenario: Scenario) -> float:
        """What an agent can earn at most: in every step but the first, when nobody is active."""
        return max(
            (
                (data.sizes["step"] - 1) * data.attrs["largest_reward"]
                for condition, data in self.by_condition.items()
                if condition.scenario == scenario
            ),
            default=0.0,
        )

    @property
    def agents(self) -> int:
        """How many agents there are."""
        return max((data.attrs["agents"] for data in self.by_condition.values()), default=0)


def conditions(
    scenarios: tuple[Scenario, ...] = SCENARIOS, strategies: tuple[Strategy, ...] = STRATEGIES
) -> Iterator[Condition]:
    """Cells of the campaign, in the order of its tables."""
    for scenario in scenarios:
        for observed in FILLINGS:
            for strategy in strategies:
                yield Condition(scenario, strategy, observed)


def training_return(data: xr.Dataset, _: Condition) -> np.ndarray:
    """J at the end of training (eq. 3.10)."""
    return _end_of_training(data["training_return"])


def training_inequality(data: xr.Dataset, _: Condition) -> np.ndarray:
    """I at the end of training (eq. 3.11)."""
    return _end_of_training(data["training_inequality"])


def validation_return(data: xr.Dataset, _: Condition) -> np.ndarray:
    """J in validation."""
    return data["validation_return"].values.mean((1, 2))


def validation_inequality(data: xr.Dataset, _: Condition) -> np.ndarray:
    """I in validation, averaged over episodes."""
    return inequality(data["validation_return"].values).mean(1)


def best_return(data: xr.Dataset, _: Condition) -> np.ndarray:
    """The highest individual return of any agent in any validation episode (Table 3.2)."""
    return data["validation_return"].values.max((1, 2))


def unsettled(data: xr.Dataset, _: Condition) -> np.ndarray:
    """How far the displacement at step 10 is from its later mean; undefined without one."""
    displacement = data["displacement"].values
    later = displacement[:, SHOWN:]
    if later.shape[1] == 0:
        return np.full(len(displacement), np.nan)
    return np.abs(displacement[:, SHOWN - 1] - later.mean(1))


def steps_to_optimum(data: xr.Dataset, condition: Condition) -> np.ndarray:
    """The first step from which, up to step 10, the displacement stays close to the optimum.

    Counted from step 2, since nobody can be active at step 1; 11 where it never is; undefined
    in episodes of one step.
    """
    best = best_displacement(data.attrs["agents"], data.attrs["resources"], condition.scenario)
    shown = data["displacement"].values[:, 1:SHOWN]
    if shown.shape[1] == 0:
        return np.full(len(shown), np.nan)
    close = np.abs(shown - best) <= CLOSE * data.attrs["agents"]
    staying = np.logical_and.accumulate(close[:, ::-1], 1)[:, ::-1]
    return np.where(staying.any(1), 2 + staying.argmax(1), 2 + shown.shape[1])


def early_communication(data: xr.Dataset, _: Condition) -> np.ndarray:
    """Share of agents that speak, in steps 1 and 2 (eq. 3.15)."""
    return data["communication"].values[:, :2].mean(1)


def middle_communication(data: xr.Dataset, _: Condition) -> np.ndarray:
    """Share of agents that speak, in steps 3 to 8."""
    return _mean_of_steps(data["communication"], 2, SHOWN - 2)


def late_communication(data: xr.Dataset, _: Condition) -> np.ndarray:
    """Share of agents that speak, in steps 9 and 10."""
    return _mean_of_steps(data["communication"], SHOWN - 2, SHOWN)


def share_of_act(act: str) -> Measure:
    """Share of agents that do one of `ACTS`, over the first ten steps."""

    def measure(data: xr.Dataset, _: Condition) -> np.ndarray:
        return data["acts"].values[:, :SHOWN, ACTS.index(act)].mean(1)

    return measure


def best_displacement(agents: int, resources: int, scenario: Scenario) -> float:
    """Displacement at the collective optimum: all on one resource, or as even as can be."""
    if scenario == "cooperative":
        return 2 * agents * (1 - 1 / resources)
    left = agents % resources
    return 2 * left * (1 - left / resources)


def _end_of_training(curve: xr.DataArray) -> np.ndarray:
    points = max(1, round(curve.sizes["point"] * END_OF_TRAINING))
    return curve.values[:, -points:].mean(1)


def _mean_of_steps(curve: xr.DataArray, first: int, end: int) -> np.ndarray:
    chosen = curve.values[:, first:end]
    if chosen.shape[1] == 0:
        return np.full(len(chosen), np.nan)
    return chosen.mean(1)
