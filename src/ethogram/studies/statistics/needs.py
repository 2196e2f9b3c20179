"""What a claim speaks of, and how much of it was run."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Need:
    """How much of something a claim speaks of: 20 000 episodes, 200 generations, 10 000 steps.

    A claim with less behind it is tested to show where it points, and stays undecided.  That it
    takes five trials need not be said.
    """

    verb: str  # "trained for"
    unit: str  # "episodes"
    needed: int
    run: int | None  # the least among the conditions compared; None where none was run

    @property
    def lack(self) -> str:
        """What is missing, in words; empty where nothing is."""
        if self.run is None or self.run >= self.needed:
            return ""
        some, all_ = (f"{count:,}".replace(",", " ") for count in (self.run, self.needed))
        return f"{self.verb} {some} of the {all_} {self.unit}"


def shortage(needs: Sequence[Need]) -> str:
    """Why what was run decides nothing, in words; empty where it may."""
    lacks = [need.lack for need in needs if need.lack]
    return f"{' and '.join(lacks)} that the claim speaks of" if lacks else ""
