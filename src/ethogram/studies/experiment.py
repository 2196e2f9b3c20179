"""The simplest experiment: a learner in a world, trained under each of some conditions.

It has all that a study needs beside its question and its claims: settings, plans, cases, the run,
a table and a figure.  A study that asks for more has a function of its own in the place of any of
them; `ethogram.studies.sharing` and its neighbours have all of them.
"""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jax import Array
from jaxtyping import Key

from ethogram.campaign.case import Case, Cost
from ethogram.campaign.context import Context
from ethogram.campaign.plan import Plan, Scalar
from ethogram.campaign.study import Records
from ethogram.core.findings import Figure, Side, Table
from ethogram.core.keys import fold_in, trial_keys
from ethogram.core.settings import Count, Seed, settings_class, settings_of
from ethogram.core.world import World
from ethogram.learners.base import Learner, Metrics, Trials
from ethogram.learners.episodes import episode_returns, play_episodes
from ethogram.studies.chapter import Results
from ethogram.studies.plotting import (
    SERIES,
    Row,
    data_table,
    draw_legend,
    draw_mean,
    new_figure,
    style,
    svg,
)
from ethogram.studies.statistics import Need, Part, difference, measured
from ethogram.studies.training import Arrays, train_case, use_kernels

EPISODES = 20  # in which each trial is watched after its training
COMPILE_SECONDS = 4.0
PROCESS_BYTES = 500_000_000  # Python, JAX and compiled programs
SECONDS = 2e-4  # of an update of a trial, at a guess
RETURN, CURVE = "return", "training_return"  # arrays of a record


class Condition(str):
    """A condition by its name, which says all of it."""

    __slots__ = ()

    @property
    def description(self) -> str:
        """The name."""
        return str(self)


@dataclass(frozen=True)
class Experiment:
    """A learner trained in a world under each of some conditions, then watched acting greedily.

    Attributes:
        study: the NAME of the study.
        version: its VERSION.
        world: a class of worlds.
        learner: a class of learners whose first field is their world.
        varied: the setting in which the conditions differ, "world.agents" or "learner.discount".
        conditions: the values of that setting, by the names of the conditions.

    """

    study: str
    version: str
    world: type[World]
    learner: Callable[..., Learner]
    varied: str
    conditions: Mapping[str, Scalar]

    @cached_property
    def settings(self) -> type[Any]:
        """The class of a case's settings: those of the world, of the learner, and its sizes."""
        parts = {"world": settings_of(self.world), "learner": settings_of(self.learner)}
        sizes = {"updates": 300, "trials": 10}
        fields: list[Any] = [
            *(
                (name, kind, dataclasses.field(default_factory=kind))
                for name, kind in parts.items()
            ),
            *((name, Count, size) for name, size in sizes.items()),
            ("seed", Seed, 0),
        ]
        made = dataclasses.make_dataclass("Settings", fields, kw_only=True, frozen=True)
        made.__doc__ = f"Everything that fixes the numbers of a case of {self.study!r}."
        return settings_class(made)

    def plans(self, **sizes: Mapping[str, int]) -> dict[str, Plan[Any]]:
        """Plans of all conditions, by name, with their numbers of `updates` and `trials`."""
        grid = {self.varied: tuple(self.conditions.values())}
        found = {}
        for name, size in sizes.items():
            settings = self.settings(**size)
            words = f"{settings.trials} trials of {settings.updates} updates in each condition."
            found[name] = Plan(name, words, settings, grid)
        return found

    def cases(self, plan: Plan[Any]) -> list[Case]:
        """A case for each condition, with all its trials."""
        names = {value: name for name, value in self.conditions.items()}
        found = []
        for settings in plan.points():
            part, _, field = self.varied.partition(".")
            value = getattr(getattr(settings, part), field) if field else getattr(settings, part)
            name = names.get(value, f"{self.varied}={value}")
            found.append(
                Case.of(study=self.study, version=self.version, name=name, settings=settings)
            )
        return found

    def cost(self, case: Case) -> Cost:
        """About what a case takes."""
        settings = case.parsed(self.settings)
        seconds = COMPILE_SECONDS + SECONDS * settings.updates * settings.trials
        return Cost(seconds=seconds, bytes=PROCESS_BYTES)

    def run(self, case: Case, context: Context) -> dict[str, xr.Dataset]:
        """Train all trials side by side, then watch each for `EPISODES` episodes.

        Returns:
            `results`, with `training_return` (dimensions trial, update) and, of the episodes
            afterwards, `return` and those metrics of the world that are a number per step (trial).
            A return is the mean over agents and episodes.

        """
        settings = case.parsed(self.settings)
        world = self.world(**dataclasses.asdict(settings.world))
        use_kernels(context, world)
        learner = self.learner(world, **dataclasses.asdict(settings.learner))
        keys = trial_keys(settings.seed, case.name, settings.trials)
        for_training, for_watching = fold_in(keys, 0), fold_in(keys, 1)
        state, curves = train_case(
            Trials(learner), for_training, for_training, settings.updates, context, _curves
        )
        watched = {
            name: ("trial", np.asarray(values))
            for name, values in _watch(world, learner, state, for_watching).items()
        }
        curve = (("trial", "update"), curves[CURVE].T)
        update = np.arange(1, settings.updates + 1)
        return {"results": xr.Dataset({CURVE: curve, **watched}, {"update": update})}

    def results(self, records: Records) -> Results[Condition]:
        """The stored results by condition."""
        return Results({Condition(name): groups["results"] for name, groups in records.items()})

    def tables(self, records: Records) -> list[Table]:
        """All that was measured after training, with intervals."""
        results = self.results(records)
        names = list(
            dict.fromkeys(
                str(name)
                for data in results.by_condition.values()
                for name, values in data.data_vars.items()
                if values.dims == ("trial",)
            )
        )
        rows = tuple(
            (str(at), *(measured(results.trials(_values(name), at)) for name in names))
            for at in results.by_condition
        )
        return [
            Table(
                name="table-1",
                title="After training",
                caption="Means over trials with 95% intervals, of agents that act greedily.",
                columns=("condition", *names),
                rows=rows,
            )
        ]

    @style()
    def figures(self, records: Records) -> list[Figure]:
        """The learning curves."""
        drawing, panels = new_figure()
        panel = panels[0, 0]
        rows: list[Row] = []
        results = self.results(records).by_condition
        for series, (at, data) in zip(SERIES, results.items(), strict=False):
            drawn = draw_mean(panel, data["update"], data[CURVE].values, series, at)
            rows += [(str(at), *row) for row in drawn]
        panel.set(xlabel="updates", ylabel="return")
        draw_legend(drawing, panel)
        return [
            Figure(
                name="figure-1",
                title="Learning curves",
                caption="Return in training: means over agents and trials, with 95% bands.",
                alt=f"Return against updates, a line for each of {len(results)} conditions.",
                svg=svg(drawing),
                data=data_table("figure-1", ("condition", "update", "return", "low", "high"), rows),
            )
        ]

    def difference(
        self, records: Records, measure: str, a: str, b: str, side: Side, margin: float
    ) -> Part:
        """A part of a claim: on which side of a margin the mean of a, less that of b, lies.

        Args:
            records: those stored.
            measure: a column of the table.
            a: name of a condition.
            b: name of another one.
            side: where the claim puts the difference.
            margin: in the unit of the measure.

        """
        results = self.results(records)
        of_a, of_b = (results.trials(_values(measure), Condition(at)) for at in (a, b))
        label = f"{measure}({a}) - {measure}({b})"
        return Part(
            label=label, terms=difference(of_a, of_b), side=side, margin=margin, unit=measure
        )

    def need(self, records: Records, updates: int) -> Need:
        """That a claim speaks of agents that were trained for so many updates."""
        run = self.results(records).least(lambda data: data.sizes["update"])
        return Need(verb="trained for", unit="updates", needed=updates, run=run)


def _values(name: str) -> Callable[[xr.Dataset], np.ndarray]:
    return lambda data: data[name].values


def _curves(metrics: Metrics) -> Arrays:
    return {CURVE: np.asarray(_mean_return(metrics["episode_return"], 2))}


def _mean_return(returns: dict[str, Any], axes: int) -> Any:
    """The mean over all agents of all roles, and over all axes but the first ones."""
    every = jnp.concatenate(list(returns.values()), -1)
    return every.mean(tuple(range(axes, every.ndim)))


@eqx.filter_jit
def _watch(
    world: World, learner: Learner, state: Any, keys: Key[Array, "trial"]
) -> dict[str, Array]:
    def one(state: Any, key: Key[Array, ""]) -> dict[str, Array]:
        played = play_episodes(world, learner.policy(state), key, EPISODES)
        numbers = {
            name: values.mean()
            for name, values in played.outcome.metrics.items()
            if values.ndim == 2
        }
        return {RETURN: _mean_return(episode_returns(played), 0), **numbers}

    return jax.vmap(one)(state, keys)
