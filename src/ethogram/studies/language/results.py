"""The measures of the chapter, one number per trial, taken from stored records."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from jaxtyping import Float

from ethogram.campaign.study import Records
from ethogram.studies import chapter
from ethogram.studies.chapter import Measure
from ethogram.studies.language.plan import CURVE, SELECTED, Condition, vocabulary_size_of
from ethogram.studies.statistics import Support, Trials, bounded

Metric = Callable[[np.ndarray], np.ndarray | float]  # of one trial's `meaning`: see `metrics`

CLOSE = 0.05  # of the final learning reward: "95%"
END_OF_TRAINING = 0.1  # the last tenth of the recorded points


class Setting(NamedTuple):
    """A size of the game."""

    robots: int  # n_r
    targets: int  # n_t

    @property
    def associations(self) -> int:
        """n_r n_t."""
        return self.robots * self.targets

    @property
    def description(self) -> str:
        """For labels."""
        return f"{self.robots} robots, {self.targets} targets"

    def learned(self, expressiveness: float) -> Condition:
        """Learned talkers with |W| = floor(e n_r n_t)."""
        return Condition(*self, "learned", vocabulary_size_of(expressiveness, self.associations))

    @property
    def optimal(self) -> Condition:
        """The baseline Opt (eq. 2.8): a symbol for every association."""
        return Condition(*self, "optimal", self.associations)

    @property
    def no_communication(self) -> Condition:
        """The baseline NoComm (eq. 2.7)."""
        return Condition(*self, "no-communication", 0)

    def selected(self) -> dict[str, Condition]:
        """What Table 2.3 and figure 2.4 set side by side."""
        learned = {f"e = {e:g}": self.learned(e) for e in SELECTED}
        return {"NoComm": self.no_communication, "Opt": self.optimal, **learned}

    def curve(self) -> list[Condition]:
        """Learned talkers with every |W| from 0 to 4 n_r n_t."""
        return list(dict.fromkeys(self.learned(e) for e in CURVE))


SETTINGS = tuple(Setting(robots, targets) for robots in (2, 3, 4) for targets in (2, 3, 4))


class Results(chapter.Results[Condition]):
    """The stored results by condition."""

    @classmethod
    def of(cls, records: Records) -> "Results":
        """Results by the condition that they say they are of, smallest first."""
        every = (groups["results"] for groups in records.values())
        found = {_condition(data.attrs): data for data in every}
        return cls({condition: found[condition] for condition in sorted(found, key=_place)})

    @property
    def settings(self) -> list[Setting]:
        """The sizes of the game of which anything was run, smallest first."""
        return list(dict.fromkeys(Setting(at.robots, at.targets) for at in self.by_condition))

    @property
    def training_episodes(self) -> int:
        """For how long policies were trained, at least."""
        return min((int(data["point"][-1]) for data in self.by_condition.values()), default=0)

    def settings_with(self, expressiveness: Sequence[float]) -> list[Setting]:
        """The settings of which learned talkers with each of these e were run.

        With `CURVE` those that were run whole.  A setting with fewer than three |W| is never one:
        normalised, two values are -1 and 1, whatever they were.
        """
        return [
            one
            for one in self.settings
            if self.by_condition.keys() >= {one.learned(e) for e in expressiveness}
            and len(self.run_of(one)) > 2
        ]

    def run_of(self, setting: Setting) -> list[Condition]:
        """The part of the setting's curve that was run."""
        return [condition for condition in setting.curve() if condition in self.by_condition]

    def normalised(
        self, settings: Sequence[Setting], expressiveness: Sequence[float]
    ) -> Float[np.ndarray, "setting trial e"]:
        """R_val scaled, in each trial of a setting, to mean 0 and deviation 1 over |W|.

        Over all |W| that were run, which in the thesis is the whole curve; returned for those of
        some e, which must be among them, and for the trials that all settings have.
        """
        found = [self._normalised(one, expressiveness) for one in settings]
        trials = min(map(len, found))
        return np.stack([one[:trials] for one in found])

    def _normalised(
        self, setting: Setting, expressiveness: Sequence[float]
    ) -> Float[np.ndarray, "trial e"]:
        run = self.run_of(setting)
        curve = np.stack([validation_return(self.by_condition[at]) for at in run], 1)
        chosen = curve[:, [run.index(setting.learned(e)) for e in expressiveness]]
        return (chosen - curve.mean(1, keepdims=True)) / curve.std(1, keepdims=True)

    def best_learned(self, setting: Setting) -> Trials:
        """R_val of the alphabet that is best on average over trials."""
        if setting not in self.settings_with(CURVE):
            return Trials(f"{setting.description}, every |W|", None)
        curve = setting.curve()
        mean = [validation_return(self.by_condition[condition]).mean() for condition in curve]
        return self.trials(validation_return, curve[int(np.argmax(mean))])


def mean_of(variable: str) -> Measure:
    """The mean over validation episodes of a return."""

    def measure(data: xr.Dataset) -> np.ndarray:
        return data[variable].values.mean(1)

    return measure


validation_return = mean_of("validation_return")  # R_val


def lost(variable: str) -> Measure:
    """How much of R_val goes when the channel is tampered with: "silenced" or "scrambled"."""

    def measure(data: xr.Dataset) -> np.ndarray:
        return validation_return(data) - data[f"{variable}_return"].values.mean(1)

    return measure


def _points(data: xr.Dataset) -> Support:
    """The final value is reached at some recorded point, the last of all at the latest."""
    first, last = (data["point"].values[[0, -1]] / 1000).tolist()
    return Support(low=first, high=last)


@bounded(_points)
def thousand_episodes(data: xr.Dataset) -> np.ndarray:
    """After how many episodes, in thousands, R_learn first came to 95% of its final value.

    R_learn is negative and nears its final value from below, so this is read as: no lower than
    the final value by more than 5% of it.  The final value is the mean over the last tenth of
    training, as the last recorded points are few episodes each.
    """
    point, reward = data["point"].values, data["training_return"].values
    covered = np.diff(point, prepend=0)
    last = slice(-max(1, round(len(point) * END_OF_TRAINING)), None)
    final = np.average(reward[:, last], axis=1, weights=covered[last])
    reached = reward >= (final - CLOSE * np.abs(final))[:, None]
    return point[reached.argmax(1)] / 1000


def of_speech(metric: Metric) -> Measure:
    """A metric of what talkers say, averaged over talkers."""

    def measure(data: xr.Dataset) -> np.ndarray:
        return np.array([np.mean(metric(meaning)) for meaning in data["meaning"].values])

    return measure


def influence(data: xr.Dataset) -> np.ndarray:
    """Causal influence of a talker's words on how another robot moves, averaged over pairs."""
    values = data["influence"].values
    return values[:, ~np.eye(values.shape[1], dtype=bool)].mean(1)


def _condition(attrs: Mapping[str, Any]) -> Condition:
    """What results say that they are of, in plain numbers however they were written down."""
    robots, targets, talkers, vocabulary_size, silence = (attrs[name] for name in Condition._fields)
    return Condition(int(robots), int(targets), talkers, int(vocabulary_size), bool(silence))


def _place(condition: Condition) -> tuple[int, int, bool, bool, int]:
    """Where a condition stands in a table: baselines before the learned, by size."""
    robots, targets, talkers, vocabulary_size, silence = condition
    return robots, targets, silence, talkers == "learned", vocabulary_size
