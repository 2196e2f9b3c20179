"""The cells of the campaign, and how pages and files name them."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

from ethogram.studies.readings import DEFAULT

Collided = Literal["removed", "restored"]
COLLIDED: tuple[Collided, ...] = ("removed", "restored")


class Fines(NamedTuple):
    """w of the three rules, by which they are fined."""

    intersection: float
    distance: float
    right_lane: float

    @property
    def name(self) -> str:
        """As cases have it: "rules", "no-rules", or the weights."""
        named = {RULES: "rules", NO_RULES: "no-rules"}
        return named.get(self) or "fines-" + "-".join(f"{weight:g}" for weight in self)

    @property
    def description(self) -> str:
        """In words, for tables and notes."""
        if self in (RULES, NO_RULES):
            return "with rules" if self == RULES else "without rules"
        weights = (f"{name.replace('_', ' ')} {w:g}" for name, w in self._asdict().items())
        return f"fines: {', '.join(weights)}"


RULES, NO_RULES = Fines(1.0, 1.0, 1.0), Fines(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Condition:
    """What drivers are fined for, and what becomes of cars that collided, under a reading."""

    fines: Fines
    collided: Collided = "restored"
    reading: str = DEFAULT

    @property
    def name(self) -> str:
        """The case's name, plain enough for a file: it goes into its random keys."""
        reading = "" if self.reading == DEFAULT else f"-{self.reading}"
        return f"{self.fines.name}-{self.collided}{reading}"

    @property
    def description(self) -> str:
        """The condition in words, for tables and notes."""
        reading = "" if self.reading == DEFAULT else f", {self.reading.replace('_', ' ')}"
        return f"{self.fines.description}, cars {self.collided}{reading}"
