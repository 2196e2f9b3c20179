"""Settings, conditions and plans of the study: what is run, and at what price."""

import dataclasses
from dataclasses import field
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple, cast, get_args

from pydantic import Field

from ethogram.campaign.case import Case
from ethogram.campaign.plan import Plan
from ethogram.core.settings import settings_class, settings_of
from ethogram.core.world import World
from ethogram.learners.qlearning import QLearning
from ethogram.learners.schedules import Constant, ExponentialDecay
from ethogram.worlds.sharing import Sharing
from ethogram.worlds.sharing.reward import Scenario

NAME = "sharing"
VERSION = "1"  # goes up whenever the same settings would give other numbers

Strategy = Literal["always", "optional", "none", "random"]
Count = Annotated[int, Field(ge=1, le=100_000_000)]

if TYPE_CHECKING:

    class WorldSettings(Sharing):
        """Those of the world."""

    class ExplorationSettings(ExponentialDecay):
        """Those of the schedule."""

    class LearnerSettings(QLearning):
        """Those of the learner, without its world."""

        world: World = field(init=False)

else:
    WorldSettings = settings_of(Sharing, omit=("communication", "encoding"))
    ExplorationSettings = settings_of(ExponentialDecay)
    LearnerSettings = settings_of(QLearning)


@settings_class
class Settings:
    """Everything that fixes a case's numbers."""

    world: WorldSettings = Field(default_factory=WorldSettings)
    strategy: Strategy = "always"
    learner: LearnerSettings = Field(default_factory=LearnerSettings)
    exploration: ExplorationSettings = Field(default_factory=ExplorationSettings)
    episodes: Count = 20_000  # of training
    validation_episodes: Annotated[int, Field(ge=1, le=1_000_000)] = 100  # greedy
    record_every: Count = 100  # training episodes per recorded point
    trials: Annotated[int, Field(ge=1, le=10_000)] = 20
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0


class Condition(NamedTuple):
    """A cell of the campaign."""

    scenario: Scenario
    strategy: Strategy
    observed: bool  # whether agents see the filling

    @property
    def name(self) -> str:
        """The case's name: it goes into its random keys."""
        return f"{self.scenario}-{self.strategy}-{'observed' if self.observed else 'hidden'}"

    @property
    def description(self) -> str:
        """The condition in words, for tables and notes."""
        return f"{self.strategy}, {self.scenario}, filling {filling_word(self.observed)}"


SCENARIOS: tuple[Scenario, ...] = ("cooperative", "competitive", "mixed")
STRATEGIES: tuple[Strategy, ...] = get_args(Strategy)
FILLINGS = (False, True)
SETTINGS = tuple((scenario, observed) for scenario in SCENARIOS for observed in FILLINGS)

_GRID = {
    "world.scenario": SCENARIOS,
    "strategy": STRATEGIES,
    "world.observe_filling": FILLINGS,
}

PLANS = {
    "smoke": Plan(
        name="smoke",
        description="Every condition for a moment, to see that everything works.",
        settings=Settings(trials=2, episodes=60, validation_episodes=5, record_every=20),
        grid=_GRID,
    ),
    "quick": Plan(
        name="quick",
        description="Fewer trials and episodes than the thesis, enough to show the direction.",
        settings=Settings(trials=8, episodes=12_000, validation_episodes=50),
        grid=_GRID,
    ),
    "thesis": Plan(
        name="thesis",
        description="Table 3.1: 24 conditions, 20 trials, 20 000 episodes of 100 steps.",
        settings=Settings(),
        grid=_GRID,
    ),
}


def filling_word(observed: bool) -> str:
    """How a table names whether agents see the filling."""
    return "observed" if observed else "hidden"


def condition_of(settings: Settings) -> Condition:
    """The cell of the campaign that settings belong to."""
    scenario = cast(Scenario, settings.world.scenario)  # a name, of which worlds make a number
    return Condition(scenario, settings.strategy, settings.world.observe_filling)


def cases(plan: Plan[Settings]) -> list[Case]:
    """One case per condition, with all its trials."""
    return [
        Case.of(study=NAME, version=VERSION, name=condition_of(settings).name, settings=settings)
        for settings in plan.points()
    ]


def world_of(settings: Settings) -> Sharing:
    """The world of a case; the random strategy may speak, as any action is possible."""
    communication = "optional" if settings.strategy == "random" else settings.strategy
    return Sharing(**dataclasses.asdict(settings.world), communication=communication)


def learner_of(settings: Settings) -> QLearning:
    """The learners of a case.

    The random strategy explores always and learns nothing; what it observes makes no difference,
    so it is given the smaller table.
    """
    if settings.strategy == "random":
        unseeing = dataclasses.replace(settings.world, observe_filling=False)
        world = world_of(dataclasses.replace(settings, world=unseeing))
        return QLearning(world, Constant(1.0), learning_rate=0.0)
    return QLearning(
        world_of(settings),
        ExponentialDecay(**dataclasses.asdict(settings.exploration)),
        **dataclasses.asdict(settings.learner),
    )
