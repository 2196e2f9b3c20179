"""What a study's page is made of: plain data, put together by the caller from stored records."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, get_args

from ethogram.core.findings import Claim, Figure, Table, Verdict
from ethogram.core.introduction import Introduction
from ethogram.core.scene import Scene
from ethogram.report.replay import Replay

TRIAL_RUN = "smoke"  # the plan that only shows that everything works
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)


@dataclass(frozen=True, kw_only=True)
class OpeningFrame:
    """A frame of a scene that a page opens with."""

    scene: Scene
    frame: int
    caption: str


@dataclass(frozen=True, kw_only=True)
class StudyPage:
    """One study as it was run; every text is shown as text, whatever it holds."""

    name: str  # as on the command line, unique in a report
    title: str
    question: str
    introduction: Introduction = field(default_factory=Introduction)
    plan: str
    plan_description: str
    trials: int | None  # per case, where all cases have as many
    cases_done: int
    cases_planned: int
    failures: Sequence[tuple[str, str]] = ()  # case, last line of the traceback
    date: str
    seconds: float  # of computing
    command: str  # runs the study again
    digest: str  # over the data of all records
    settings: Mapping[str, Any] = field(default_factory=dict)  # nested JSON
    versions: Mapping[str, str] = field(default_factory=dict)
    claims: Sequence[Claim] = ()
    tables: Sequence[Table] = ()
    figures: Sequence[Figure] = ()
    replays: Sequence[Replay] = ()

    @property
    def opening(self) -> OpeningFrame | None:
        """The frame to open with, among the scenes of the replays."""
        wanted = self.introduction
        scenes = [(each.name == wanted.case, each.scene) for each in self.replays]
        found = [(named, scene) for named, scene in scenes if scene is not None and len(scene.tint)]
        if not found:
            return None
        named, scene = max(found, key=lambda each: each[0])  # the first of those
        frame = wanted.frame if named else len(scene.tint) // 3
        caption = (wanted.caption if named or not wanted.case else "") or scene.title
        return OpeningFrame(scene=scene, frame=min(frame, len(scene.tint) - 1), caption=caption)

    @property
    def comparable(self) -> bool:
        """Whether its numbers may be held against published ones."""
        return self.plan != TRIAL_RUN

    def tally(self) -> dict[Verdict, int]:
        """How many claims got each verdict, zeros included."""
        counts = Counter(claim.verdict for claim in self.claims)
        return {verdict: counts[verdict] for verdict in VERDICTS}
