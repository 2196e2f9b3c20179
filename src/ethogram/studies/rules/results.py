"""The measures of the chapter, one number per trial, taken from stored records."""

import numpy as np
import xarray as xr

from ethogram.campaign.study import Records
from ethogram.studies import chapter
from ethogram.studies.chapter import Measure
from ethogram.studies.rules.condition import COLLIDED, Condition, Fines
from ethogram.studies.rules.validation import Acting, Group
from ethogram.studies.statistics import Support, bounded

END_OF_TRAINING = 0.1  # the last tenth of the updates


class Results(chapter.Results[Condition]):
    """The stored results by condition, in the order of the plan."""

    @classmethod
    def of(cls, records: Records) -> "Results":
        """Results of the records, by what they say of themselves."""
        return cls(
            {condition_in(groups["results"]): groups["results"] for groups in records.values()}
        )

    def having(self, variable: str) -> "Results":
        """Those that hold a number: not every case is validated in every way."""
        return Results({at: data for at, data in self.by_condition.items() if variable in data})


def condition_in(data: xr.Dataset) -> Condition:
    """The condition that results are of."""
    said = data.attrs
    fines = Fines(*(float(said[f"fine_{rule}"]) for rule in Fines._fields))
    collided = COLLIDED[COLLIDED.index(str(said["collided"]))]
    return Condition(fines, collided, str(said["reading"]))


def _at_least_zero(_: xr.Dataset) -> Support:
    return Support(low=0.0)


def _shares(_: xr.Dataset) -> Support:
    return Support(low=0.0, high=1.0)


@bounded(_at_least_zero)
def training_efficiency(data: xr.Dataset) -> np.ndarray:
    """E at the end of training, mean over cars (eq. 4.16)."""
    return _end_of_training(data["training_E"])


@bounded(_at_least_zero)
def training_collisions(data: xr.Dataset) -> np.ndarray:
    """C at the end of training, mean over cars (eq. 4.17)."""
    return _end_of_training(data["training_C"])


@bounded(_at_least_zero)
def training_deviation(data: xr.Dataset) -> np.ndarray:
    """Standard deviation of E among cars, at the end of training."""
    return _end_of_training(data["training_E_deviation"])


def training_return(data: xr.Dataset) -> np.ndarray:
    """R at the end of training, mean over cars (eq. 4.15)."""
    return _end_of_training(data["training_R"])


def in_traffic(variable: str, level: int, acting: Acting = "drawn") -> Measure:
    """A number per car, of drivers at a level of traffic, after training."""

    def measure(data: xr.Dataset) -> np.ndarray:
        return _at_level(data[f"traffic_{variable}"].sel(acting=acting), level)

    return measure if variable == "return" else bounded(_at_least_zero)(measure)


def alive_efficiency(level: int, acting: Acting = "drawn") -> Measure:
    """E without what the dead drive under their impact: what is earned, less what is paid."""

    @bounded(_at_least_zero)
    def measure(data: xr.Dataset) -> np.ndarray:
        fines = [data.attrs[f"fine_{rule}"] for rule in Fines._fields]
        paid = (data["traffic_breaches"] * xr.DataArray(fines, dims="rule")).sum("rule")
        driven = (data["traffic_return"] + paid) * data.attrs["top_speed"]
        return _at_level(driven.sel(acting=acting), level)

    return measure


def overall(variable: str, level: int, acting: Acting = "drawn") -> Measure:
    """Of all cars together at a level of traffic: "collisions", or "distance" in m (figure 4.6)."""

    @bounded(_at_least_zero)
    def measure(data: xr.Dataset) -> np.ndarray:
        if variable == "distance":
            per_car = data["traffic_efficiency"] * data.attrs["time_step"]
        else:
            per_car = data[f"traffic_{variable}"]
        return level * _at_level(per_car.sel(acting=acting), level)

    return measure


def breaches(rule: str, level: int, acting: Acting = "drawn") -> Measure:
    """Share of the steps of an episode in which a car breaks a rule, mean over cars."""

    @bounded(_shares)
    def measure(data: xr.Dataset) -> np.ndarray:
        broken = data["traffic_breaches"].sel(acting=acting, rule=rule)
        return _at_level(broken, level) / data.attrs["steps"]

    return measure


def mixed(variable: str, human: str, share: float, group: Group) -> Measure:
    """A number per car of a group, where a share of the drivers are human ones of a kind."""

    @bounded(_at_least_zero)
    def measure(data: xr.Dataset) -> np.ndarray:
        found = data[f"mixed_{variable}"].sel(human=human, share=share, group=group)
        return found.transpose("trial").values

    return measure


def approach(variable: str, road: str) -> Measure:
    """A share of the approaches to the place where a car stands ("blocked"), or none ("clear")."""

    @bounded(_shares)
    def measure(data: xr.Dataset) -> np.ndarray:
        return data[f"approach_{variable}"].sel(road=road).values

    return measure


def _at_level(values: xr.DataArray, level: int) -> np.ndarray:
    return values.sel(level=level).transpose("trial").values


def _end_of_training(curve: xr.DataArray) -> np.ndarray:
    points = max(1, round(curve.sizes["point"] * END_OF_TRAINING))
    return curve.values[:, -points:].mean(1)
