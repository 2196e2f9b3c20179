"""Settings, conditions and plans of the study: what is run, and at what price."""

import dataclasses
from dataclasses import field
from typing import TYPE_CHECKING, Annotated, Literal, cast, get_args

import jax
from pydantic import Field

from ethogram.campaign.case import Case
from ethogram.campaign.plan import Plan
from ethogram.core.errors import InvalidSettings
from ethogram.core.search_space import SearchSpace
from ethogram.core.settings import settings_class, settings_of
from ethogram.learners.evolution import AgeFitness
from ethogram.learners.evolution.base import Fitness
from ethogram.physics.beams3d import Material
from ethogram.studies.sensing.condition import MORPHOLOGIES, NON_SENSING_LAWS, OUTPUTS, Condition
from ethogram.worlds.softbody import SoftBody3D
from ethogram.worlds.softbody.controllers import (
    Actuation,
    Controller,
    NonSensing,
    Output,
    Sensing,
)
from ethogram.worlds.softbody.starts import Start, StartDistribution

NAME = "sensing"
# Goes up whenever the same settings would give other numbers: also with the sizes of blocks in
# `worlds.softbody.simulation`, on which the last bits depend.
VERSION = "3"

Law = Literal[Actuation, Output]
Surface = Literal["even", "uneven"]

if TYPE_CHECKING:

    class WorldSettings(SoftBody3D):
        """Those of the world."""

    class MaterialSettings(Material):
        """Those of the voxels and the floor."""

    class StartSettings(StartDistribution):
        """How much starts differ."""

    class LearnerSettings(AgeFitness):
        """Those of the evolution, without what it searches."""

        search_space: SearchSpace = field(init=False)
        fitness: Fitness = field(init=False)

else:
    WorldSettings = settings_of(SoftBody3D, omit=("gravity", "max_voxels", "kernel"))
    MaterialSettings = settings_of(Material)
    StartSettings = settings_of(StartDistribution)
    LearnerSettings = settings_of(AgeFitness)


@settings_class
class Settings:
    """Everything that fixes a case's numbers."""

    world: WorldSettings = Field(default_factory=WorldSettings)
    material: MaterialSettings = Field(default_factory=MaterialSettings)
    law: Law = "tanh"  # the first two do not sense, the others do
    # a and delta s, in edges at rest; what exceeds world.shortest and world.longest is cut off
    amplitude: Annotated[float, Field(ge=0, lt=1)] = 0.1
    surface: Surface = "even"
    # over which fitness is a mean; 1 is the start at rest, of which the thesis speaks
    starts: Annotated[int, Field(ge=1, le=10_000)] = 1
    # others, from which the best of each trial starts again
    validation_starts: Annotated[int, Field(ge=0, le=10_000)] = 0
    start: StartSettings = Field(default_factory=StartSettings)
    learner: LearnerSettings = Field(default_factory=LearnerSettings)
    generations: Annotated[int, Field(ge=1, le=1_000_000)] = 200
    record_every: Annotated[int, Field(ge=1, le=1_000_000)] = 25  # steps; divides world.steps
    trials: Annotated[int, Field(ge=1, le=100_000)] = 30
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0


LAWS = (NON_SENSING_LAWS[0], *OUTPUTS)
SURFACES: tuple[Surface, ...] = get_args(Surface)

TUNED_STARTS = 8  # see docs/results/about_sensing.md
VALIDATION_STARTS = 16
_TRAINING, _VALIDATION = range(2)  # folded into the seed's key, for starts

_ALL = {"world.body": MORPHOLOGIES, "law": LAWS, "surface": SURFACES}

PLANS = {
    "smoke": Plan(
        name="smoke",
        description="The worm under all controllers, for a moment, to see that everything works.",
        settings=Settings(
            world=WorldSettings(steps=200),
            learner=LearnerSettings(population_size=4),
            generations=2,
            trials=2,
        ),
        grid={**_ALL, "world.body": ("worm",)},
    ),
    "quick": Plan(
        name="quick",
        description="All conditions, in six runs of ten generations.",
        settings=Settings(generations=10, trials=6),
        grid=_ALL,
    ),
    "excerpt": Plan(
        name="excerpt",
        description="Section 5.4 with six of its thirty runs: what one machine does in an hour.",
        settings=Settings(trials=6),
        grid=_ALL,
    ),
    "thesis": Plan(
        name="thesis",
        description="Section 5.4: thirty runs of two hundred generations, for either way to read "
        "the outputs of the network; the best robots also start from elsewhere.",
        settings=Settings(validation_starts=VALIDATION_STARTS),
        grid=_ALL,
    ),
    "tuned": Plan(
        name="tuned",
        description="Section 5.4 on even ground with a fitness that is not luck: the mean over "
        "starts that differ slightly, in ten runs. The best robots are validated from starts that "
        "evolution never saw.",
        settings=Settings(starts=TUNED_STARTS, validation_starts=VALIDATION_STARTS, trials=10),
        grid={"world.body": MORPHOLOGIES, "law": LAWS[:2]},
    ),
}


def condition_of(settings: Settings) -> Condition:
    """The cell of the campaign that settings belong to."""
    controller = "non-sensing" if settings.law in get_args(Actuation) else "sensing"
    body = cast(str, settings.world.body)  # a name or text, of which worlds make a lattice
    return Condition(body, controller, settings.law, settings.surface)


def cases(plan: Plan[Settings]) -> list[Case]:
    """One case per condition, with all its trials; those that take longest come first."""
    points = sorted(plan.points(), key=lambda point: -len(world_of(point).cells))
    for point in points:
        if point.world.steps % point.record_every:
            raise InvalidSettings(
                f"record_every = {point.record_every}: it should divide the {point.world.steps} "
                "steps of world.steps."
            )
    return [
        Case.of(study=NAME, version=VERSION, name=condition_of(point).name, settings=point)
        for point in points
    ]


def world_of(settings: Settings) -> SoftBody3D:
    """The world of a case.  Its gravity is left open: simulations are given it step by step."""
    return SoftBody3D(
        material=Material(**dataclasses.asdict(settings.material)),
        **dataclasses.asdict(settings.world),
    )


def training_starts(settings: Settings) -> Start | None:
    """The starts of every evaluation, the same for all robots, generations, trials and cases.

    None is the one at rest.
    """
    if settings.starts == 1:
        return None
    return _sample(settings, _TRAINING, settings.starts)


def validation_starts(settings: Settings) -> Start:
    """Other starts than those of training, drawn alike."""
    return _sample(settings, _VALIDATION, settings.validation_starts)


def _sample(settings: Settings, purpose: int, starts: int) -> Start:
    distribution = StartDistribution(**dataclasses.asdict(settings.start))
    key = jax.random.fold_in(jax.random.key(settings.seed), purpose)
    return distribution.sample(key, starts)


def controller_of(settings: Settings) -> Controller:
    """The law of control of a case."""
    voxels = len(world_of(settings).cells)
    if settings.law == "shrink_limited" or settings.law == "plain":
        return NonSensing(voxels, settings.law, settings.amplitude)
    return Sensing(voxels, settings.law, settings.amplitude)
