"""Settings, conditions and plans of the study: what is run, and at what price."""

import dataclasses
import math
from dataclasses import field
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple, get_args

from pydantic import Field

from ethogram.campaign.case import Case
from ethogram.campaign.plan import Plan
from ethogram.core.settings import settings_class, settings_of
from ethogram.core.world import World
from ethogram.core.wrappers import GivenPolicies
from ethogram.learners.maddpg import MADDPG, PRESETS
from ethogram.worlds.language import Language
from ethogram.worlds.language.policies import NoCommunication, Optimal

NAME = "language"
VERSION = "2"  # goes up whenever the same settings would give other numbers

ROUNDING = 1e-9  # of an expressiveness that is a fraction: 1/9 x 9 is one symbol

Talkers = Literal["learned", "no-communication", "optimal"]


class Condition(NamedTuple):
    """A cell of the campaign."""

    robots: int  # n_r
    targets: int  # n_t
    talkers: Talkers  # learned, or one of the baselines of section 2.4.3
    vocabulary_size: int  # |W|
    silence: bool = False  # whether talkers that have symbols may also be silent

    @property
    def associations(self) -> int:
        """n_r n_t, what there is to be named."""
        return self.robots * self.targets

    @property
    def expressiveness(self) -> float:
        """Symbols per association: e = |W| / (n_r n_t)."""
        return self.vocabulary_size / self.associations

    @property
    def name(self) -> str:
        """The case's name: it goes into its random keys."""
        talkers = (
            f"{self.talkers}-{self.vocabulary_size}" if self.talkers == "learned" else self.talkers
        )
        return f"{self.robots}x{self.targets}-{talkers}{'-or-silence' if self.silence else ''}"

    @property
    def description(self) -> str:
        """The condition in words, for tables and notes."""
        return f"{self.robots} robots, {self.targets} targets, {self.policy}"

    @property
    def policy(self) -> str:
        """How tables name the talkers: "learned, e = 0.25", "no communication", "optimal"."""
        if self.talkers != "learned":
            return self.talkers.replace("-", " ")
        silence = " or silence" if self.silence else ""
        return f"learned, e = {self.expressiveness:.4g}{silence}"


if TYPE_CHECKING:

    class WorldSettings(Language):
        """Those of the world."""

    class LearnerSettings(MADDPG):
        """Those of the learner, without its world."""

        world: World = field(init=False)

else:
    WorldSettings = settings_of(Language, omit=("vocabulary_size", "max_vocabulary_size"))
    LearnerSettings = settings_of(MADDPG)


@settings_class
class Settings:
    """Everything that fixes a case's numbers."""

    world: WorldSettings = Field(default_factory=WorldSettings)
    talkers: Talkers = "learned"
    expressiveness: Annotated[float, Field(ge=0, le=1000)] = 1.0  # |W| = floor(e n_r n_t)
    max_expressiveness: Annotated[float, Field(ge=0, le=1000)] = (
        4.0  # languages up to it share a program
    )
    learner: LearnerSettings = Field(default_factory=LearnerSettings)
    episodes: Annotated[int, Field(ge=1, le=100_000_000)] = 20_000  # of training
    validation_episodes: Annotated[int, Field(ge=2, le=1_000_000)] = 1000
    record_every: Annotated[int, Field(ge=1, le=100_000_000)] = 512  # training episodes per point
    trials: Annotated[int, Field(ge=1, le=10_000)] = 5
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0


CURVE = tuple(step / 16 for step in range(65))  # gives every |W| from 0 to 4 n_r n_t
SELECTED = (0.25, 1.0, 3.0)  # expressiveness in tables 2.2 and 2.3, figures 2.3 and 2.4
TALKERS: tuple[Talkers, ...] = get_args(Talkers)

_SIZES = {"world.robots": (2, 3, 4), "world.targets": (2, 3, 4)}
_TWO = {"world.robots": (2,), "world.targets": (2,)}
_THREE = {"world.robots": (3,), "world.targets": (3,)}
_FOUR = {"world.robots": (4,), "world.targets": (4,)}

_TUNED = Settings(
    world=WorldSettings(observe_velocity=True),
    max_expressiveness=1.0,
    learner=LearnerSettings(**PRESETS["tuned"]),
)

PLANS = {
    "smoke": Plan(
        name="smoke",
        description="A few conditions for a moment, to see that everything works.",
        settings=Settings(
            max_expressiveness=1.0,
            learner=LearnerSettings(batch_size=16, learning_starts=32, hidden_size=8),
            episodes=48,
            validation_episodes=8,
            record_every=16,
            trials=2,
        ),
        grid={**_TWO, "talkers": TALKERS, "expressiveness": (0.0, 1.0)},
    ),
    "quick": Plan(
        name="quick",
        description="Two robots and two targets, few words, fewer episodes than the thesis.",
        settings=Settings(max_expressiveness=1.0, episodes=8_000, trials=3),
        grid={**_TWO, "talkers": TALKERS, "expressiveness": (0.0, 0.25, 1.0)},
    ),
    "excerpt": Plan(
        name="excerpt",
        description="The thesis' parameters and three seeds, as far as one machine gets in an "
        "hour: every alphabet at 2x2, four at 3x3.",
        settings=Settings(trials=3),
        grid={**_TWO, "talkers": TALKERS, "expressiveness": CURVE},
        further=(
            {
                **_THREE,
                "talkers": TALKERS,
                "expressiveness": (0.0, *SELECTED),
                "max_expressiveness": (3.0,),
            },
        ),
    ),
    "thesis": Plan(
        name="thesis",
        description="Section 2.5.1: 333 learned settings and 18 baselines, 20 000 episodes of 25 "
        "steps, five seeds; and 2x2 again with talkers that may be silent.",
        settings=Settings(),
        grid={**_SIZES, "talkers": TALKERS, "expressiveness": CURVE},
        further=({**_TWO, "expressiveness": CURVE, "world.allow_silence": (True,)},),
    ),
    "tuned": Plan(
        name="tuned",
        description="The learner and what it observes as good as we could make them: how far the "
        "game can be learned. Five trials at 2x2, two at 3x3 and at 4x4, seed 0.",
        settings=_TUNED,
        grid={**_FOUR, "trials": (2,)},  # what takes longest comes first
        further=({**_THREE, "trials": (2,)}, {**_TWO, "trials": (5,)}),
    ),
}


def condition_of(settings: Settings) -> Condition:
    """The cell of the campaign that settings belong to."""
    world, vocabulary_size = settings.world, 0
    if settings.talkers == "optimal":
        vocabulary_size = world.robots * world.targets
    elif settings.talkers == "learned":
        vocabulary_size = vocabulary_size_of(settings.expressiveness, world.robots * world.targets)
    silence = world.allow_silence and vocabulary_size > 0 and settings.talkers == "learned"
    return Condition(world.robots, world.targets, settings.talkers, vocabulary_size, silence)


def vocabulary_size_of(expressiveness: float, associations: int) -> int:
    """|W| = floor(e n_r n_t)."""
    return math.floor(expressiveness * associations + ROUNDING)


def cases(plan: Plan[Settings]) -> list[Case]:
    """One case per condition, with all its trials.

    Expressiveness that gives the same alphabet is the same condition; a baseline's own is fixed.
    """
    found: dict[Condition, Settings] = {}
    for settings in plan.points():
        condition = condition_of(settings)
        exactly = dataclasses.replace(settings, expressiveness=condition.expressiveness)
        found.setdefault(condition, exactly)
    return [
        Case.of(study=NAME, version=VERSION, name=condition.name, settings=settings)
        for condition, settings in found.items()
    ]


def world_of(settings: Settings) -> Language:
    """The world of a case; learned languages have room for larger alphabets than their own."""
    condition, max_vocabulary_size = condition_of(settings), 0
    if condition.talkers == "learned":
        max_vocabulary_size = vocabulary_size_of(
            settings.max_expressiveness, condition.associations
        )
    return Language(
        **dataclasses.asdict(settings.world),
        vocabulary_size=condition.vocabulary_size,
        max_vocabulary_size=max(max_vocabulary_size, condition.vocabulary_size),
    )


def learner_of(settings: Settings) -> MADDPG:
    """The learners of a case, with no more room for transitions than their episodes fill.

    Where talkers are a baseline, movers alone learn, and their critics read what they observe.
    """
    game, learner = world_of(settings), settings.learner
    given = {"learned": None, "no-communication": NoCommunication, "optimal": Optimal}
    talker = given[settings.talkers]
    world = GivenPolicies(game, {"talker": talker(game)}) if talker else game
    played = plays(settings) * learner.episodes_per_update * game.horizon
    learner = dataclasses.replace(learner, buffer_size=min(learner.buffer_size, played))
    return MADDPG(world, **dataclasses.asdict(learner))


def plays(settings: Settings) -> int:
    """How often the learners play some episodes side by side, to make up all episodes."""
    return -(-settings.episodes // settings.learner.episodes_per_update)
