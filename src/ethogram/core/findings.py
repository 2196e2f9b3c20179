"""What a study finds, as plain data: tables, figures and claims with their verdicts.

Studies make them, the report shows them, the command line prints them; none of them computes.
"""

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["confirmed", "refuted", "undecided", "not run"]
Bounds = Literal["interval", "range"]  # of 95%; of the trials themselves
Side = Literal["at least", "more than", "at most", "less than", "within"]


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A measured number with its interval, beside the published one where there is one.

    Where an interval would say nothing, `low` and `high` are the smallest and the largest trial:
    `bounds` is then "range", which speaks for no other trials and marks nothing.
    """

    value: float
    low: float | None = None
    high: float | None = None
    published: float | None = None
    bounds: Bounds = "interval"


Cell = str | int | float | Measured | None


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table of what was measured, beside what is published where there is such."""

    name: str  # "table-3-2", unique in the study: file name and anchor
    title: str
    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A drawn figure and the numbers behind it."""

    name: str  # "figure-3-2", unique in the study: file name and anchor
    title: str
    caption: str
    alt: str  # what a reader who cannot see it should know
    svg: str  # one <svg> element; text and axes in currentColor
    data: Table  # long form, one row per drawn number


@dataclass(frozen=True, kw_only=True)
class Revision:
    """A change to the test of a claim after it was first stated."""

    date: str  # "2026-11-29"
    change: str
    reason: str
    known: str  # which results had been seen by then


@dataclass(frozen=True, kw_only=True)
class ClaimPart:
    """One of the comparisons that a claim rests on, and what the run says of it.

    `low` and `high` are such that those of all parts of the claim hold together.
    """

    compared: str  # in words, "0.9 I(always) - I(optional)"
    effect: float | None
    low: float | None
    high: float | None
    unit: str
    side: Side | None
    margin: float | None
    note: str = ""  # what is missing


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim with its pre-stated test, and what the run says of it.

    The unit of evidence is the independent trial.  `low` and `high` bound the effect at the
    level that Holm's correction over the study's claims leaves to this claim.  `side`, `margin`
    and `compared` are those of the part that decided.
    """

    number: int
    statement: str
    source: str = (
        ""  # where the claim is made, "section 3.4.1"; nothing for one of the study itself
    )
    test: str  # what is compared, the margin and its unit
    effect: float | None
    low: float | None
    high: float | None
    unit: str
    p_value: float | None  # corrected
    verdict: Verdict
    note: str = ""  # the part that decided, or what is missing
    side: Side | None = None  # where the claim puts the effect, relative to the margin
    margin: float | None = None  # in `unit`; "within": the effect lies between -margin and margin
    compared: str = ""  # the deciding comparison in words, "0.9 I(always) - I(optional)"
    stated: str = ""  # the date on which the test was first stated
    history: tuple[Revision, ...] = ()  # changes since then, oldest first
    depends_on: tuple[str, ...] = ()  # measures or readings under which the verdict is another
    parts: tuple[ClaimPart, ...] = ()  # all comparisons, where there are several
