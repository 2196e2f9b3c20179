"""The measures of the chapter, one number per trial, taken from stored records."""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from ethogram.campaign.study import Records
from ethogram.studies import chapter
from ethogram.studies.chapter import Measure
from ethogram.studies.sharing.compute import SHOWN, inequality
from ethogram.studies.sharing.earnings import Earnings, earnings
from ethogram.studies.sharing.plan import (
    FILLINGS,
    SCENARIOS,
    STRATEGIES,
    Condition,
    Strategy,
)
from ethogram.studies.sharing.validation import ACTS
from ethogram.studies.statistics import Support, bounded
from ethogram.worlds.sharing.reward import Scenario

END_OF_TRAINING = 0.1  # the last tenth of the episodes
CLOSE = 0.05  # of the agents: a displacement this near to another one counts as the same


class Results(chapter.Results[Condition]):
    """The stored results by condition."""

    @classmethod
    def of(cls, records: Records) -> "Results":
        """Results of the records of known cases; others are passed over."""
        every = {condition.name: condition for condition in conditions()}
        return cls(
            {every[name]: groups["results"] for name, groups in records.items() if name in every}
        )

    def earnings(self, scenario: Scenario) -> Earnings:
        """What agents can earn in a scenario, from random choices to the optimum; 0 if not run."""
        for condition, data in self.by_condition.items():
            if condition.scenario == scenario:
                resources, steps = int(data.attrs["resources"]), data.sizes["step"]
                return earnings(data["payoff"].values.astype(float), resources, steps)
        return Earnings(0.0, 0.0)

    def largest_return(self, scenario: Scenario) -> float:
        """What a single agent can earn at most: in every step but the first."""
        return max(
            (
                _returns(data).high
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


def training_episodes(data: xr.Dataset) -> int:
    """For how long agents were trained."""
    return int(data["point"][-1])


def validation_episodes(data: xr.Dataset) -> int:
    """In how many episodes they were watched afterwards."""
    return data.sizes["episode"]


def episode_steps(data: xr.Dataset) -> int:
    """How long an episode is."""
    return data.sizes["step"]


def _returns(data: xr.Dataset) -> Support:
    """An agent earns the largest reward at most, in every step but the first."""
    return Support(low=0.0, high=(data.sizes["step"] - 1) * data.attrs["largest_reward"])


def _deviations(data: xr.Dataset) -> Support:
    """Half of the agents earn all that can be earned, half nothing."""
    agents = max(2, data.attrs["agents"])
    most = _returns(data).high
    return Support(low=0.0, high=most / 2 * (agents / (agents - 1)) ** 0.5)


def _shares(_: xr.Dataset) -> Support:
    return Support(low=0.0, high=1.0)


def _displacements(data: xr.Dataset) -> Support:
    agents, resources = data.attrs["agents"], data.attrs["resources"]
    return Support(low=0.0, high=best_displacement(agents, resources, "cooperative"))


def _steps_shown(data: xr.Dataset) -> Support:
    """Nobody looks at what comes after the steps shown."""
    return Support(low=2.0, high=2.0 + max(0, min(SHOWN, data.sizes["step"]) - 1), capped=True)


@bounded(_returns)
def training_return(data: xr.Dataset) -> np.ndarray:
    """J at the end of training (eq. 3.10)."""
    return _end_of_training(data["training_return"])


@bounded(_deviations)
def training_inequality(data: xr.Dataset) -> np.ndarray:
    """I at the end of training (eq. 3.11)."""
    return _end_of_training(data["training_inequality"])


@bounded(_returns)
def validation_return(data: xr.Dataset) -> np.ndarray:
    """J in validation."""
    return data["validation_return"].values.mean((1, 2))


@bounded(_deviations)
def validation_inequality(data: xr.Dataset) -> np.ndarray:
    """I in validation, averaged over episodes."""
    return inequality(data["validation_return"].values).mean(1)


@bounded(_returns)
def best_return(data: xr.Dataset) -> np.ndarray:
    """The highest individual return of any agent in any validation episode (Table 3.2)."""
    return data["validation_return"].values.max((1, 2))


@bounded(_displacements)
def unsettled(data: xr.Dataset) -> np.ndarray:
    """How far the displacement at step 10 is from its later mean; undefined without one."""
    displacement = data["displacement"].values
    later = displacement[:, SHOWN:]
    if later.shape[1] == 0:
        return np.full(len(displacement), np.nan)
    return np.abs(displacement[:, SHOWN - 1] - later.mean(1))


def steps_to_optimum(scenario: Scenario) -> Measure:
    """The first step from which, up to step 10, the displacement stays close to the optimum.

    Counted from step 2, since nobody can be active at step 1; 11 where it never is; undefined
    in episodes of one step.  It is 11 as well for whoever comes there later: a cap.
    """

    @bounded(_steps_shown)
    def measure(data: xr.Dataset) -> np.ndarray:
        best = best_displacement(data.attrs["agents"], data.attrs["resources"], scenario)
        shown = data["displacement"].values[:, 1:SHOWN]
        if shown.shape[1] == 0:
            return np.full(len(shown), np.nan)
        close = np.abs(shown - best) <= CLOSE * data.attrs["agents"]
        staying = np.logical_and.accumulate(close[:, ::-1], 1)[:, ::-1]
        return np.where(staying.any(1), 2 + staying.argmax(1), 2 + shown.shape[1])

    return measure


@bounded(_shares)
def early_communication(data: xr.Dataset) -> np.ndarray:
    """Share of agents that speak, in steps 1 and 2 (eq. 3.15)."""
    return data["communication"].values[:, :2].mean(1)


@bounded(_shares)
def middle_communication(data: xr.Dataset) -> np.ndarray:
    """Share of agents that speak, in steps 3 to 8."""
    return _mean_of_steps(data["communication"], 2, SHOWN - 2)


@bounded(_shares)
def late_communication(data: xr.Dataset) -> np.ndarray:
    """Share of agents that speak, in steps 9 and 10."""
    return _mean_of_steps(data["communication"], SHOWN - 2, SHOWN)


def share_of_act(act: str) -> Measure:
    """Share of agents that do one of `ACTS`, over the first ten steps."""

    @bounded(_shares)
    def measure(data: xr.Dataset) -> np.ndarray:
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
