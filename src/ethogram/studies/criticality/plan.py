"""Settings, conditions and plans of the study: what is run, and at what price."""

import dataclasses
from dataclasses import field
from typing import TYPE_CHECKING, Annotated, Any, Literal

import jax.numpy as jnp
from pydantic import Field

from ethogram.campaign.case import Case
from ethogram.campaign.plan import Plan
from ethogram.core.search_space import SearchSpace
from ethogram.core.settings import settings_class, settings_of
from ethogram.learners.evolution import Genetic
from ethogram.learners.evolution.base import Fitness
from ethogram.studies.criticality.condition import Condition
from ethogram.studies.criticality.found import BODIES
from ethogram.studies.criticality.tasks import THESIS_TASKS, TaskSettings, task_condition
from ethogram.worlds.softbody.growth import require_room

NAME = "criticality"
VERSION = "1"  # goes up whenever the same settings would give other numbers

Bodies = Literal["thresholds", "hand_made", "psrnd", "rnd", "evolved", "minimised"]
EVOLVED: tuple[Bodies, ...] = ("evolved", "minimised")

if TYPE_CHECKING:

    class LearnerSettings(Genetic):
        """Those of the evolution, without what it searches."""

        search_space: SearchSpace = field(init=False)
        fitness: Fitness = field(init=False)

else:
    LearnerSettings = settings_of(Genetic)


@settings_class
class Settings:
    """Everything that fixes a case's numbers."""

    bodies: Bodies = "evolved"
    voxels: Annotated[int, Field(ge=1, le=1000)] = 20  # of a body, at least
    grid: Annotated[int, Field(ge=1, le=200)] = 20  # side of the grid of genes, cells
    learner: LearnerSettings = Field(default_factory=LearnerSettings)
    generations: Annotated[int, Field(ge=0, le=1_000_000)] = 200
    trials: Annotated[int, Field(ge=1, le=100_000)] = 10  # runs, or bodies that are drawn
    first: Annotated[int, Field(ge=0, le=100_000)] = 0  # of those trials, among all of a plan
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0


_BASELINES: tuple[Bodies, ...] = ("thresholds", "hand_made", "psrnd", "rnd")

PLANS: dict[str, Plan[Any]] = {
    "smoke": Plan(
        name="smoke",
        description="Small bodies, for a moment, to see that everything works.",
        settings=Settings(
            voxels=5,
            grid=5,
            learner=LearnerSettings(population_size=6, children=6, tournament_size=2),
            generations=2,
            trials=2,
        ),
        grid={"bodies": ("psrnd", "rnd", "evolved")},
    ),
    "quick": Plan(
        name="quick",
        description="Bodies drawn, made by hand, and evolved in five runs of thirty generations of "
        "two hundred.",
        settings=Settings(
            learner=LearnerSettings(population_size=200, children=200), generations=30, trials=5
        ),
        grid={"bodies": ("evolved", *_BASELINES)},
    ),
    "thesis": Plan(
        name="thesis",
        description="Section 6.5.1: ten runs of two hundred generations of a thousand bodies, and "
        "the baselines. The tasks of section 6.5.2 are plan `tasks`.",
        settings=Settings(),
        grid={"bodies": ("evolved", *_BASELINES)},
    ),
    "tuned": Plan(
        name="tuned",
        description="Section 6.5.1 with more variation: four of five children are mutants, which "
        "move ten times as far. The first run was looked at before, for sixty generations.",
        settings=Settings(learner=LearnerSettings(mutation_scale=0.1, crossover_probability=0.2)),
        grid={"bodies": ("evolved", *_BASELINES)},
    ),
    "tasks": Plan(
        name="tasks",
        description="Section 6.5.2 with the phase controller: all 34 bodies in locomotion, jump "
        "and escape, five runs of 1000 births each in place of ten of 10 000.",
        settings=TaskSettings(births=1000, trials=5),
        grid={"body": tuple(BODIES), "task": THESIS_TASKS},
    ),
    "tasks-smoke": Plan(
        name="tasks-smoke",
        description="Two bodies in two tasks, for a moment.",
        settings=TaskSettings(births=20, trials=2),
        grid={"body": ("box", "opt-0"), "task": THESIS_TASKS[:2]},
    ),
    "controls": Plan(
        name="controls",
        description="Beyond the thesis: bodies evolved for the least criticality, in ten runs of "
        "fifty generations, beside bodies evolved for the greatest.",
        settings=Settings(generations=50),
        grid={"bodies": (*EVOLVED, "rnd")},
    ),
}


def condition_of(settings: Settings) -> Condition:
    """The cell of the campaign that settings belong to."""
    return Condition(settings.bodies)


def cases(plan: Plan[Any]) -> list[Case]:
    """One case per way to come by bodies, of evolution one per run; or one per body and task.

    Raises:
        InvalidSettings: the grid cannot hold a body.

    """
    if isinstance(plan.settings, TaskSettings):
        named = [(task_condition(point).name, point) for point in plan.points()]
    else:
        points: list[Settings] = []
        for point in plan.points():
            require_room(point.grid**2, point.voxels)
            trials = range(point.first, point.first + point.trials)
            runs = trials if point.bodies in EVOLVED else ()
            points += [dataclasses.replace(point, trials=1, first=run) for run in runs] or [point]
        named = [(name_of(point), point) for point in points]
    return [Case.of(study=NAME, version=VERSION, name=name, settings=at) for name, at in named]


def name_of(settings: Settings) -> str:
    """The name of a case: of evolution each run is one."""
    name = condition_of(settings).name
    return f"{name}-{settings.first}" if settings.bodies in EVOLVED else name


def learner_of(settings: Settings, fitness: Fitness) -> Genetic:
    """The genetic algorithm of a case: a gene for each cell, drawn from 0 to 1, without limits."""
    cells = settings.grid**2
    limit = jnp.full(cells, jnp.inf)
    space = SearchSpace(jnp.zeros(cells), jnp.ones(cells), -limit, limit)
    return Genetic(space, fitness, **dataclasses.asdict(settings.learner))
