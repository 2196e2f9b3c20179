"""The cells of the campaign, and how pages and files name them."""

from dataclasses import dataclass

from ethogram.worlds.softbody.bodies import PLANE_BODIES

HAND_MADE = PLANE_BODIES
BOXES = tuple(range(3, 11))  # sides of the square bodies of figures 6.1 and 6.2
WORDS = {
    "thresholds": "square bodies",
    "hand_made": "hand-made bodies",
    "psrnd": "pseudo-random bodies (psrnd)",
    "rnd": "random bodies (rnd)",
    "evolved": "evolved bodies (opt)",
    "minimised": "bodies evolved for the least",
}


@dataclass(frozen=True)
class Condition:
    """One way to come by bodies."""

    bodies: str  # a key of `WORDS`

    @property
    def name(self) -> str:
        """The case's name: it goes into its random keys."""
        return self.bodies.replace("_", "-")

    @property
    def description(self) -> str:
        """The condition in words, for tables and notes."""
        return WORDS[self.bodies]
