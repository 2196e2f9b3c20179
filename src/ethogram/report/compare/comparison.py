"""Two runs of a study side by side: settings, claims and tables, each matched by what names it.

What only one run has stays in its place and is said to be so.  Nothing here reads or computes.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from ethogram.core.findings import Claim, Table, Verdict
from ethogram.report import formatting
from ethogram.report.compare.align import Presence, align, presence
from ethogram.report.compare.tables import TablePair, compare_tables
from ethogram.report.page import StudyPage

OPEN: frozenset[Verdict] = frozenset(("undecided", "not run"))  # that say neither yes nor no


@dataclass(frozen=True, kw_only=True)
class TextPair:
    """A setting, or a package's version, in either run; None where a run does not have it."""

    name: str
    a: str | None
    b: str | None


@dataclass(frozen=True, kw_only=True)
class ClaimPair:
    """A claim as either run judges it; None where a run does not state it."""

    number: int
    statements: tuple[str, ...]  # two where the runs word it differently
    a: Claim | None
    b: Claim | None

    @property
    def presence(self) -> Presence:
        """Which run states it."""
        return presence(self.a, self.b)

    @property
    def changed(self) -> bool:
        """Whether there are two verdicts, and they differ.

        Not run is no verdict, and undecided is none either: one against the other is no change.
        """
        if self.a is None or self.b is None or self.a.verdict == self.b.verdict:
            return False
        return not {self.a.verdict, self.b.verdict} <= OPEN

    @property
    def alike(self) -> bool:
        """Whether the effects are of one quantity: what is compared, and in which unit."""
        if self.a is None or self.b is None or None in (self.a.effect, self.b.effect):
            return True
        return (self.a.unit, self.a.compared) == (self.b.unit, self.b.compared)


@dataclass(frozen=True, kw_only=True)
class StudyPair:
    """A study as it was run twice."""

    a: StudyPage
    b: StudyPage
    settings: tuple[TextPair, ...]  # those that differ
    versions: tuple[TextPair, ...]  # those that differ
    claims: tuple[ClaimPair, ...]
    tables: tuple[TablePair, ...]  # of both
    tables_of_a: tuple[Table, ...]  # of A alone
    tables_of_b: tuple[Table, ...]

    @property
    def changed(self) -> int:
        """How many verdicts differ."""
        return sum(claim.changed for claim in self.claims)

    @property
    def tally(self) -> str:
        """How many verdicts differ, in words."""
        both = sum(claim.presence == "both" for claim in self.claims)
        verb = "differs" if self.changed == 1 else "differ"
        return f"{self.changed} of {both} verdicts {verb}."


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Two folders of results: the studies that both hold, and the names of the others."""

    a: str  # the folder as it was named
    b: str
    studies: Sequence[StudyPair]
    only_a: Sequence[str] = ()
    only_b: Sequence[str] = ()


def compare_pages(a: StudyPage, b: StudyPage) -> StudyPair:
    """Set two runs of one study side by side."""
    tables = align(a.tables, b.tables, lambda table: table.name)
    return StudyPair(
        a=a,
        b=b,
        settings=tuple(
            setting
            for setting in _texts(formatting.dotted(a.settings), formatting.dotted(b.settings))
            if not _same_setting(setting.a, setting.b)
        ),
        versions=tuple(
            version
            for version in _texts(a.versions.items(), b.versions.items())
            if version.a != version.b
        ),
        claims=tuple(
            _claim(one, other)
            for one, other in align(a.claims, b.claims, lambda claim: claim.number)
        ),
        tables=tuple(compare_tables(one, other) for one, other in tables if one and other),
        tables_of_a=tuple(one for one, other in tables if one and not other),
        tables_of_b=tuple(other for one, other in tables if other and not one),
    )


def _claim(a: Claim | None, b: Claim | None) -> ClaimPair:
    claims = [claim for claim in (a, b) if claim is not None]
    statements = dict.fromkeys(claim.statement for claim in claims)
    return ClaimPair(number=claims[0].number, statements=tuple(statements), a=a, b=b)


def _texts(a: Iterable[tuple[str, str]], b: Iterable[tuple[str, str]]) -> list[TextPair]:
    return [
        TextPair(
            name=one[0] if one else other[0] if other else "",
            a=one[1] if one else None,
            b=other[1] if other else None,
        )
        for one, other in align(a, b, lambda item: item[0])
    ]


def _same_setting(a: str | None, b: str | None) -> bool:
    """Whether two settings mean the same, as 1 and 1.0 do, and 1 and an axis with that one value.

    A plan writes an axis as the list of its values, though there be one only.
    """
    return a is not None and b is not None and (a == b or _meaning(a) == _meaning(b))


def _meaning(text: str) -> Any:
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return text
    return value[0] if isinstance(value, list) and len(value) == 1 else value
