"""The cells of the campaign, and how pages and files name them."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

from ethogram.studies.readings import DEFAULT

Author = Literal["random", "minded", "learned"]
Editor = Literal["accept_everything", "mild_scrutiny", "improve_only", "learned"]
YEARS, STEPS_PER_YEAR = 20, 10  # that the chapter speaks of
SNAPSHOTS = (1, 4, 8, 12, 15, 20)  # years that its figures show


class Size(NamedTuple):
    """How large a publishing system is, at first."""

    authors: int
    journals: int
    papers: int

    @property
    def description(self) -> str:
        """The size in words."""
        return f"{self.authors} authors, {self.journals} journals and {self.papers} papers at first"


SMALL, BIG = Size(100, 20, 1000), Size(1000, 40, 10_000)


@dataclass(frozen=True)
class Condition:
    """What authors and editors do, in a system of a size, under a reading of the text."""

    author: Author
    editor: Editor
    size: Size = SMALL
    reading: str = DEFAULT

    @property
    def name(self) -> str:
        """The case's name, plain enough for a file: it goes into its random keys."""
        size = "-".join(map(str, self.size))
        reading = "" if self.reading == DEFAULT else f"-{self.reading}"
        return f"{self.author}-{self.editor}-{size}{reading}"

    @property
    def policies(self) -> str:
        """Who does what: "random authors, mild-scrutiny editors"."""
        return f"{self.author} authors, {self.editor.replace('_', '-')} editors"

    @property
    def description(self) -> str:
        """The condition in words, for tables and notes."""
        size = "" if self.size == SMALL else f", {self.size.authors} authors"
        reading = "" if self.reading == DEFAULT else f", {self.reading.replace('_', ' ')}"
        return f"{self.policies}{size}{reading}"


MILD, STRICT = "mild_scrutiny", "improve_only"
FIGURES = {  # which figure of the thesis shows a scenario
    Condition("random", "mild_scrutiny"): "7.2",
    Condition("minded", "mild_scrutiny"): "7.3",
    Condition("random", "improve_only"): "7.4",
    Condition("minded", "improve_only"): "7.5",
    Condition("minded", "mild_scrutiny", BIG): "7.6",
    Condition("minded", "improve_only", BIG): "7.7",
    Condition("minded", "learned"): "7.8",
    Condition("learned", "mild_scrutiny"): "7.9",
}
SCENARIOS = tuple(FIGURES)
STATIC = tuple(at for at in SCENARIOS if "learned" not in (at.author, at.editor))
EDITOR_LEARNS, AUTHOR_LEARNS = SCENARIOS[-2:]
