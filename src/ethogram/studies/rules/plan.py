"""Settings, conditions and plans of the study: what is run, and at what price."""

import dataclasses
from dataclasses import field, replace
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from ethogram.campaign.case import Case
from ethogram.campaign.plan import Grid, Plan
from ethogram.campaign.settings_json import flatten, to_json
from ethogram.core.recorded import RECORDED
from ethogram.core.settings import Count, Positive, Seed, settings_class, settings_of
from ethogram.core.world import World
from ethogram.learners.ppo import PPO, PRESETS
from ethogram.learners.schedules import Constant, Schedule
from ethogram.studies.readings import reading_of
from ethogram.studies.rules.condition import Condition, Fines
from ethogram.studies.rules.readings import READINGS
from ethogram.worlds.traffic import Traffic

NAME = "rules"
VERSION = "1"  # goes up whenever the same settings would give other numbers

# What is asked of drivers after training: how they fare in more and in less traffic, among drivers
# of other kinds, and before a stopped car.
Validation = Literal["traffic", "mixed", "greater_good", "all"]
Weight = Annotated[float, Field(ge=0, le=1000)]

if TYPE_CHECKING:

    class WorldSettings(Traffic):
        """Those of the world."""

    class LearnerSettings(PPO):
        """Those of the learner, without its world and its schedules."""

        world: World = field(init=False)
        learning_rate: Schedule = field(init=False)
        entropy_coefficient: Schedule = field(init=False)
        track: tuple[str, ...] = field(init=False)

else:
    WorldSettings = settings_of(Traffic, omit=("max_cars", "humans"))
    LearnerSettings = settings_of(PPO)


def _learner(preset: str, **changes: float) -> LearnerSettings:
    values = {**PRESETS[preset], **changes}
    values.pop("learning_rate", None)
    return LearnerSettings(**values)


@settings_class
class Settings:
    """Everything that fixes a case's numbers."""

    world: WorldSettings = Field(default_factory=WorldSettings)
    enforcement: Weight = 1.0  # of all fines: 1 with rules, 0 without
    learner: LearnerSettings = Field(default_factory=lambda: _learner("thesis"))
    learning_rate: Positive = PRESETS["thesis"]["learning_rate"]
    entropy_coefficient: Annotated[float, Field(ge=0)] = 0.0
    updates: Count = 500
    record_every: Count = 10  # updates per point of the learning curves
    validation: Validation = "traffic"
    validation_episodes: Annotated[int, Field(ge=1, le=10_000)] = 5  # of each situation
    scenes: Annotated[int, Field(ge=0, le=RECORDED)] = RECORDED  # trials that have one
    trials: Annotated[int, Field(ge=1, le=10_000)] = 20
    seed: Seed = 0


WEIGHTS = (0.0, 2.0)  # of one rule, while the others are fined by 1
_ENFORCEMENT: Grid = {"enforcement": (1.0, 0.0)}
_BOTH: Grid = {"world.collided": ("restored", "removed"), **_ENFORCEMENT}
_TUNED = Settings(
    learner=_learner(
        "modern",
        discount=0.999,
        episodes_per_update=1,
        minibatch_size=1000,
        normalize_observations=True,
        normalize_returns=True,
    ),
    learning_rate=3e-4,
)
_RULES = ("intersection", "distance", "right_lane")

PLANS = {
    "smoke": Plan(
        name="smoke",
        description="Both kinds of drivers for a moment, to see that everything works.",
        settings=Settings(
            world=WorldSettings(cars=6, steps=20),
            learner=_learner("thesis", hidden_size=8, minibatch_size=60, epochs=2),
            updates=4,
            record_every=2,
            validation="all",
            validation_episodes=1,
            trials=2,
        ),
        grid=_ENFORCEMENT,
    ),
    "quick": Plan(
        name="quick",
        description="Drivers with and without rules, cars restored: fewer trials and updates.",
        settings=Settings(trials=5, updates=60, record_every=2, validation_episodes=2),
        grid=_ENFORCEMENT,
    ),
    "excerpt": Plan(
        name="excerpt",
        description="Section 4.4 with five of its twenty trials.",
        settings=Settings(trials=5, validation="all"),
        grid=_BOTH,
    ),
    "thesis": Plan(
        name="thesis",
        description="Section 4.4: with and without rules, cars that collided removed or restored, "
        "twenty trials of 500 updates, then traffic of 10 to 80 cars; and, beyond the thesis, "
        "among drivers of other kinds and before a stopped car.",
        settings=Settings(validation="all"),
        grid=_BOTH,
    ),
    "tuned": Plan(
        name="tuned",
        description="The same in five trials with PPO as implementations have come to agree on, "
        "which scales what it observes and earns by what it has seen.",
        settings=replace(_TUNED, trials=5, validation="all"),
        grid=_BOTH,
    ),
    "mixed": Plan(
        name="mixed",
        description="Trained drivers among drivers of other kinds: shares from none to all.",
        settings=replace(_TUNED, trials=10, validation="mixed"),
        grid=_ENFORCEMENT,
    ),
    "greater_good": Plan(
        name="greater_good",
        description="Trained drivers before a stopped car: do they leave the right lane then, and "
        "only then?",
        settings=replace(_TUNED, trials=10, validation="greater_good"),
        grid=_ENFORCEMENT,
    ),
    "fines": Plan(
        name="fines",
        description="Each rule's fine nothing or twice as much: distance against collisions.",
        settings=replace(_TUNED, trials=5, updates=200, scenes=0),
        grid=_ENFORCEMENT,
        further=tuple({f"world.{rule}_weight": WEIGHTS} for rule in _RULES),
    ),
    "readings": Plan(
        name="readings",
        description="Drivers with and without rules under every other reading of the text.",
        settings=replace(_TUNED, trials=5, updates=100, scenes=0),
        grid=_ENFORCEMENT,
        further=tuple(
            {**{key: (value,) for key, value in changes.items()}, **_ENFORCEMENT}
            for changes in READINGS.values()
            if changes
        ),
    ),
}


def condition_of(settings: Settings) -> Condition:
    """The cell of the campaign that settings belong to."""
    world = settings.world
    flat, default = (dict(flatten(to_json(each))) for each in (settings, Settings()))
    return Condition(
        Fines(*(settings.enforcement * getattr(world, f"{rule}_weight") for rule in _RULES)),
        world.collided,
        reading_of(flat, default, READINGS),
    )


def cases(plan: Plan[Settings]) -> list[Case]:
    """One case per condition, with all its trials."""
    found = {condition_of(settings): settings for settings in plan.points()}
    return [
        Case.of(study=NAME, version=VERSION, name=condition.name, settings=settings)
        for condition, settings in found.items()
    ]


def cars_of(settings: Settings) -> int:
    """n_car, in training."""
    return int(settings.world.cars)


def world_of(settings: Settings, cars: int | None = None, humans: int = 0) -> Traffic:
    """The world of a case, with as many cars as it says or as are asked for."""
    values = dataclasses.asdict(settings.world)
    values.pop("cars")
    cars = cars_of(settings) if cars is None else cars
    for rule in _RULES:
        values[f"{rule}_weight"] *= settings.enforcement
    return Traffic(**values, cars=cars, max_cars=max(1, cars), humans=humans)


def learner_of(settings: Settings, world: World) -> PPO:
    """The learner of a case, in its world or in another one with the same roles."""
    return PPO(
        world,
        Constant(settings.learning_rate),
        Constant(settings.entropy_coefficient),
        **dataclasses.asdict(settings.learner),
        track=("speed", "collision"),
    )
