"""What the chapters share: the stored results by condition, and a measure's trials in each."""

from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np
import xarray as xr

from ethogram.studies.statistics import Trials, support_of

Measure = Callable[[xr.Dataset], np.ndarray]  # results of a condition -> a number per trial


class Described(Hashable, Protocol):
    """A cell of the campaign."""

    @property
    def description(self) -> str:
        """The condition in words, for tables and notes."""


C = TypeVar("C", bound=Described)


@dataclass(frozen=True)
class Results(Generic[C]):
    """The stored results by condition, in the order of the tables."""

    by_condition: Mapping[C, xr.Dataset]

    def trials(self, measure: Measure, condition: C) -> Trials:
        """One number per trial of a condition, or word that it was not run."""
        data = self.by_condition.get(condition)
        if data is None:
            return Trials(self.missing(condition), None)
        values = measure(data).astype(float)
        return Trials(condition.description, values, support_of(measure, data))

    def missing(self, condition: C) -> str:
        """How notes name a condition that was not run."""
        return condition.description

    def least(
        self, size: Callable[[xr.Dataset], int], conditions: Iterable[C] | None = None
    ) -> int | None:
        """The least of something with which any condition was run, or any of some.

        Returns:
            None where none of them was run.

        """
        wanted = self.by_condition if conditions is None else conditions
        run = [self.by_condition[at] for at in wanted if at in self.by_condition]
        return min(map(size, run), default=None)


def attribute(name: str) -> Callable[[xr.Dataset], int]:
    """A size that results say of themselves: `least(attribute("steps"))`."""
    return lambda data: int(data.attrs[name])
