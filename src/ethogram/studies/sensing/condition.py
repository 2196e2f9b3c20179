"""The cells of the campaign, and how pages and files name them."""

import hashlib
from dataclasses import dataclass

MORPHOLOGIES = ("worm", "biped", "tripod")  # the thesis' bodies
NON_SENSING_LAWS = ("shrink_limited", "plain")  # the first is the one compared with the thesis
OUTPUTS = ("tanh", "unbounded")  # of the sensing controller's network
FITNESS = "fitness"  # the scenario of evolution
VALIDATION = ("flat", "step", "sin")
SCENARIOS = {  # by surface: which gravity, first that of evolution, then those of validation
    "even": {FITNESS: "even"},
    "uneven": {FITNESS: "evolution", "flat": "flat", "step": "step", "sin": "sin"},
}
LONGEST_NAME = 60  # of a body's layers in a file's name

_PLAIN = str.maketrans({"#": "1", ".": "0", "/": "_", "|": "__"})


@dataclass(frozen=True)
class Condition:
    """One body under one law of control on one surface."""

    body: str  # a name, or text layers
    controller: str  # "non-sensing" or "sensing"
    law: str  # "shrink_limited", "plain"; "tanh", "unbounded"
    surface: str  # "even" or "uneven"

    @property
    def name(self) -> str:
        """The case's name, plain enough for a file: it goes into its random keys."""
        return f"{_plain(self.body)}-{self.law}-{self.surface}"

    @property
    def law_words(self) -> str:
        """The law as pages write it: "shrink-limited"."""
        return self.law.replace("_", "-")

    @property
    def kind(self) -> str:
        """The controller with its law: "sensing (tanh)"."""
        return f"{self.controller} ({self.law_words})"

    @property
    def description(self) -> str:
        """The condition in words, for tables and notes."""
        return f"{self.body}, {self.kind}, {self.surface} surface"


def non_sensing(body: str, surface: str) -> Condition:
    """What sensing is compared with."""
    return Condition(body, "non-sensing", NON_SENSING_LAWS[0], surface)


def sensing(body: str, output: str, surface: str) -> Condition:
    """A sensing controller whose network has these outputs."""
    return Condition(body, "sensing", output, surface)


def _plain(body: str) -> str:
    """A body's name; of layers, their cells as ones and zeros, or a hash where these are many."""
    plain = body.translate(_PLAIN)
    if len(plain) <= LONGEST_NAME:
        return plain
    return f"body-{hashlib.sha256(body.encode()).hexdigest()[:16]}"
