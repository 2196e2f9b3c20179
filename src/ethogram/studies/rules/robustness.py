"""The chapter's claims under other readings of the text, and of drivers who act greedily.

None of these is a verdict: they tell of a verdict whether it would be another.
"""

from dataclasses import replace
from typing import NamedTuple

from ethogram.core.findings import Claim
from ethogram.studies.readings import DEFAULT
from ethogram.studies.rules.claims import of_the_chapter, pairs
from ethogram.studies.rules.readings import words_of
from ethogram.studies.rules.results import Results
from ethogram.studies.statistics import judge


class Row(NamedTuple):
    """The claims under a reading."""

    description: str
    claims: list[Claim]


def rows(results: Results) -> list[Row]:
    """A row for each reading that was run; first the default one, with restored cars alone."""
    found = []
    for reading in dict.fromkeys(at.reading for at in results.by_condition):
        compared = pairs(reading)[-1:]
        specs = of_the_chapter(results, compared)
        judged = judge([replace(spec, needs=()) for spec in specs])
        if all(claim.verdict != "not run" for claim in judged):
            words = "none: as stated, cars restored" if reading == DEFAULT else words_of(reading)
            found.append(Row(words, judged))
    return found
