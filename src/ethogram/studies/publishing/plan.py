"""Settings, conditions and plans of the study: what is run, and at what price."""

import dataclasses
from dataclasses import field
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from ethogram.campaign.case import Case
from ethogram.campaign.plan import Grid, Plan
from ethogram.campaign.settings_json import flatten, to_json
from ethogram.core.errors import InvalidSettings
from ethogram.core.rollout import Policy
from ethogram.core.settings import settings_class, settings_of
from ethogram.core.world import World
from ethogram.core.wrappers import RolePolicies, RolePolicy
from ethogram.learners.qlearning import QLearning
from ethogram.learners.schedules import ExponentialDecay
from ethogram.studies.publishing.condition import (
    BIG,
    Author,
    Condition,
    Editor,
    Size,
)
from ethogram.studies.publishing.readings import KNOWN, OF_LEARNED, READINGS
from ethogram.studies.readings import Readings, reading_of
from ethogram.worlds.publishing import Publishing
from ethogram.worlds.publishing.learnable import LearnablePublishing, Reward
from ethogram.worlds.publishing.policies import (
    BINS,
    MAX_REJECTIONS,
    SHARES,
    BinRule,
    Minded,
    Random,
    Ranking,
    Remainder,
    Scrutiny,
)

NAME = "publishing"
VERSION = "4"  # goes up whenever the same settings would give other numbers

Count = Annotated[int, Field(ge=1, le=1_000_000)]

if TYPE_CHECKING:

    class WorldSettings(Publishing):
        """Those of the world."""

    class ExplorationSettings(ExponentialDecay):
        """Those of the schedule."""

    class LearnerSettings(QLearning):
        """Those of the learner, without its world."""

        world: World = field(init=False)

else:
    WorldSettings = settings_of(Publishing)
    ExplorationSettings = settings_of(ExponentialDecay)
    LearnerSettings = settings_of(QLearning)


@settings_class
class Settings:
    """Everything that fixes a case's numbers."""

    world: WorldSettings = Field(default_factory=WorldSettings)
    author: Author = "minded"
    editor: Editor = "mild_scrutiny"
    bins: Annotated[int, Field(ge=1, le=100)] = BINS  # of journals, and of what is learned from
    bin_rule: BinRule = "ranked"
    bin_remainder: Remainder = "spread"
    max_rejections: Annotated[int, Field(ge=0, le=1_000_000)] = MAX_REJECTIONS  # of random authors
    minded_max_rejections: Annotated[int, Field(ge=0, le=1_000_000)] | None = None
    reward: Reward = "change"
    table: Literal["shared", "own"] = "shared"
    learner: LearnerSettings = Field(default_factory=LearnerSettings)
    exploration: ExplorationSettings = Field(
        default_factory=lambda: ExplorationSettings(decay=0.985)
    )
    episodes: Count = 300  # of training
    trials: Annotated[int, Field(ge=1, le=10_000)] = 20
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0


_STATIC_AUTHORS = {"author": ("random", "minded")}
_STATIC_EDITORS = {"editor": ("mild_scrutiny", "improve_only")}
_STATIC: Grid = {**_STATIC_AUTHORS, **_STATIC_EDITORS}
_BIG: Grid = {
    "world.authors": (BIG.authors,),
    "world.journals": (BIG.journals,),
    "world.initial_papers": (BIG.papers,),
    "author": ("minded",),
    **_STATIC_EDITORS,
}
_EDITOR_LEARNS: Grid = {"author": ("minded",), "editor": ("learned",)}
_AUTHOR_LEARNS: Grid = {"author": ("learned",), "editor": ("mild_scrutiny",)}
_LEARNED = (_EDITOR_LEARNS, _AUTHOR_LEARNS)
_SCENARIOS = (_EDITOR_LEARNS, _AUTHOR_LEARNS, _BIG, _STATIC)  # what takes longest comes first


def _under(readings: Readings, *grids: Grid) -> list[Grid]:
    """Grids under each of some readings but the default."""
    return [
        {**grid, **{key: (value,) for key, value in changes.items()}}
        for changes in readings.values()
        if changes
        for grid in grids
    ]


PLANS = {
    "smoke": Plan(
        name="smoke",
        description="Three scenarios of a small system for a moment, to see that everything works.",
        settings=Settings(
            world=WorldSettings(
                authors=12, journals=10, initial_papers=60, years=4, steps_per_year=3
            ),
            episodes=4,
            trials=2,
        ),
        grid={"author": ("random",), "editor": ("mild_scrutiny",)},
        further=(_EDITOR_LEARNS, _AUTHOR_LEARNS),
    ),
    "quick": Plan(
        name="quick",
        description="The eight scenarios in eight runs, those that learn after fewer episodes.",
        settings=Settings(trials=8, episodes=60),
        grid=_SCENARIOS[0],
        further=_SCENARIOS[1:],
    ),
    "thesis": Plan(
        name="thesis",
        description="Section 7.4 with twenty runs in place of one; authors that learn also with "
        "improve-only editors, and every policy under the other readings of the text that concern "
        "it.",
        settings=Settings(),
        grid=_SCENARIOS[0],
        further=(
            *_under(OF_LEARNED, *_LEARNED),
            *_SCENARIOS[1:],
            {**_AUTHOR_LEARNS, "editor": ("improve_only",)},
            *_under(READINGS, _STATIC),
        ),
    ),
}


def condition_of(settings: Settings) -> Condition:
    """The cell of the campaign that settings belong to."""
    world = settings.world
    flat, default = (dict(flatten(to_json(each))) for each in (settings, Settings()))
    return Condition(
        settings.author,
        settings.editor,
        Size(world.authors, world.journals, world.initial_papers),
        reading_of(flat, default, KNOWN),
    )


def cases(plan: Plan[Settings]) -> list[Case]:
    """One case per condition, with all its trials."""
    found = []
    for settings in plan.points():
        if settings.author != "random" and settings.bins > settings.world.journals:
            raise InvalidSettings(
                f"bins = {settings.bins}; allowed: at most world.journals, "
                f"{settings.world.journals}."
            )
        if settings.author == settings.editor == "learned":
            raise InvalidSettings(
                "author = learned, editor = learned; allowed: that one of them learns."
            )
        name = condition_of(settings).name
        found.append(Case.of(study=NAME, version=VERSION, name=name, settings=settings))
    return found


def world_of(settings: Settings) -> Publishing:
    """The world of a case."""
    return Publishing(**dataclasses.asdict(settings.world))


def ranking_of(settings: Settings) -> Ranking:
    """How a case's authors group journals."""
    return Ranking(settings.bins, settings.bin_remainder)


def author_of(settings: Settings) -> RolePolicy:
    """What the authors of a case do, unless they learn it."""
    if settings.author == "random":
        return Random(settings.max_rejections)
    return Minded(
        world_of(settings).quality_max,
        ranking_of(settings),
        settings.bin_rule,
        settings.minded_max_rejections,
    )


def editor_of(settings: Settings) -> RolePolicy:
    """What the editors of a case do, unless they learn it."""
    return Scrutiny(SHARES[settings.editor])


def policy_of(settings: Settings) -> Policy:
    """What both do in a case in which nobody learns."""
    return RolePolicies({"author": author_of(settings), "editor": editor_of(settings)})


def learner_of(settings: Settings) -> QLearning | None:
    """Who learns in a case, if anybody does."""
    if "learned" not in (settings.author, settings.editor):
        return None
    authors = settings.author == "learned"
    world = LearnablePublishing(
        world_of(settings),
        others=editor_of(settings) if authors else author_of(settings),
        learns="author" if authors else "editor",
        ranking=ranking_of(settings),
        reward=settings.reward,
    )
    return QLearning(
        world,
        ExponentialDecay(**dataclasses.asdict(settings.exploration)),
        **dataclasses.asdict(settings.learner),
        shared=settings.table == "shared",
    )
