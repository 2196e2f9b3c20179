"""The claims once more, with one thing at a time otherwise: what their verdicts hang on.

Otherwise may be what a claim is measured by, which scenarios it speaks of, and how the text is
read.  All of this was thought of with results at hand, so these are no new verdicts: they tell of a
verdict whether it would be another.  Holm's correction is within a row.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from ethogram.core.findings import Claim
from ethogram.studies.chapter import Measure
from ethogram.studies.publishing.condition import (
    BIG,
    SCENARIOS,
    SMALL,
    STATIC,
    Condition,
)
from ethogram.studies.publishing.readings import OF_LEARNED, READINGS, words_of
from ethogram.studies.publishing.results import (
    Results,
    last_correlation,
    papers_and_quality,
    share_beyond_chance,
    share_in_last_year,
)
from ethogram.studies.publishing.statements import AS_STATED, Choices, specs
from ethogram.studies.readings import DEFAULT
from ethogram.studies.statistics import ClaimSpec, judge

Judged = dict[int, Claim]  # by number


class Row(NamedTuple):
    """The claims that something concerns, judged with it."""

    description: str  # what is otherwise
    claims: Judged
    beside: Judged  # without it


class Change(NamedTuple):
    """One thing that is otherwise in the tests of all scenarios."""

    description: str
    concerns: tuple[int, ...]  # claims
    choices: Choices = AS_STATED
    reading: str = DEFAULT  # of those who learn


def _of_what_it_counts(name: str) -> Measure:
    """An impact factor's correlation is with the quality of the papers that it counts."""
    return last_correlation(name, of="counted" if name == "impact_factor" else "published")


def _of_the_last_year(name: str) -> Measure:
    return papers_and_quality if name == "papers" else last_correlation(name)


LARGER = f"scenarios of {BIG.authors} authors too (figures 7.6, 7.7)"
CHANGES = (
    Change(
        "impact factors beside the quality of the papers that they count, of two years",
        (2, 6, 7),
        Choices(correlation=_of_what_it_counts),
    ),
    Change(
        "papers of the last year alone",
        (3, 6),
        Choices(correlation=_of_the_last_year, share=share_in_last_year),
    ),
    Change(
        "papers of the last year alone, their share less what chance adds",
        (3,),
        Choices(share=share_beyond_chance),
    ),
    Change(
        "correlations of ranks (Spearman)",
        (1, 2, 4, 6, 7),
        Choices(correlation=partial(last_correlation, kind="spearman")),
    ),
    Change(
        LARGER,
        (3, 4),
        Choices(sizes=(SMALL, BIG)),
    ),
    *(Change(words_of(reading), (1, 6, 7), reading=reading) for reading in OF_LEARNED),
)
ALONE = f"the four scenarios of {SMALL.authors} authors whose policies do not change, alone"


def rows(results: Results) -> list[Row]:
    """Those of which all was run; before them the claims as stated, if any of these was run."""
    stated = {claim.number: claim for claim in judge(specs(results, SCENARIOS))}
    found = []
    if any(claim.verdict != "not run" for claim in stated.values()):
        found.append(Row("nothing: as stated", stated, stated))
    for change in CHANGES:
        scenarios = [_learning(at, change.reading) for at in SCENARIOS]
        judged = _judged(specs(results, scenarios, change.choices))
        concerned = {number: judged[number] for number in change.concerns if number in judged}
        found.append(Row(change.description, concerned, stated))
    small = {reading: _judged(specs(results, _small(reading))) for reading in READINGS}
    found.append(Row(ALONE, small[DEFAULT], stated))
    for reading in READINGS:
        if reading != DEFAULT:
            found.append(Row(words_of(reading), small[reading], small[DEFAULT]))
    return [row for row in found if row.claims]


def depends_on(number: int, found: Sequence[Row]) -> tuple[str, ...]:
    """What would make the verdict on a claim another, in words, with that verdict."""
    named = []
    for words, claims, beside in found:
        if number in claims and number in beside:
            verdict = claims[number].verdict
            if verdict != beside[number].verdict:
                named.append(f"{words} ({verdict})")
    return tuple(named)


def _judged(claims: Sequence[ClaimSpec]) -> Judged:
    """The verdicts on those that lack nothing: what was run in part says nothing of a choice."""
    lacking = {claim.number for claim in claims if claim.lack}
    return {claim.number: claim for claim in judge(claims) if claim.number not in lacking}


def _small(reading: str) -> list[Condition]:
    return [replace(at, reading=reading) for at in STATIC if at.size == SMALL]


def _learning(at: Condition, reading: str) -> Condition:
    """A scenario in which somebody learns, under a reading; others as they are."""
    return replace(at, reading=reading) if "learned" in (at.author, at.editor) else at
