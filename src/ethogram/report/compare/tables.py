"""Two tables of one name as one: columns matched by name, rows by the cells that head them."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, takewhile
from typing import NamedTuple

from ethogram.core.findings import Cell, Measured, Table
from ethogram.report import formatting
from ethogram.report.compare.align import Presence, align, presence
from ethogram.report.tables import CellText, Column, Kind, Layout, Side, lay_out


@dataclass(frozen=True, kw_only=True)
class ColumnPair:
    """A column of both tables, or of one; numbers are shown for A, for B and as B - A."""

    name: str
    kind: Kind
    presence: Presence
    decimals: int
    published: bool
    alike: bool  # texts that are the same in every row that both have: shown once

    @property
    def span(self) -> int:
        """Columns on the page."""
        if self.kind == "head" or self.presence != "both" or self.alike:
            return 1
        return 2 if self.kind == "text" else 3 + self.published


@dataclass(frozen=True, kw_only=True)
class CellPair:
    """What a row has in a column, ready to be read; None where a side has no such row or column."""

    a: CellText | None
    b: CellText | None
    difference: str = ""  # B - A
    side: Side = ""  # of A's interval, where B's lies wholly
    published: str = ""

    @property
    def either(self) -> CellText:
        """A's where there is one, else B's, else nothing."""
        return self.a or self.b or CellText(text="", kind="text")

    @property
    def differs(self) -> bool:
        """Whether both are there and do not read the same."""
        return self.a is not None and self.b is not None and self.a != self.b


@dataclass(frozen=True, kw_only=True)
class RowPair:
    """A row of both tables, or of one."""

    presence: Presence
    cells: tuple[CellPair, ...]


@dataclass(frozen=True, kw_only=True)
class TablePair:
    """Two tables side by side."""

    a: Table
    b: Table
    columns: tuple[ColumnPair, ...]
    rows: tuple[RowPair, ...]
    duplicates: bool  # some rows of a table have the same headings, and were matched by their order

    @property
    def width(self) -> int:
        """Columns on the page."""
        return sum(column.span for column in self.columns)

    @property
    def heading_column(self) -> int:
        """The last of the columns that head the rows, or the first one where none does."""
        heads = [index for index, column in enumerate(self.columns) if column.kind == "head"]
        return heads[-1] if heads else 0

    @property
    def ranged(self) -> bool:
        """Whether either table has ranges of few trials in place of intervals."""
        return any(
            isinstance(cell, Measured) and cell.bounds == "range"
            for table in (self.a, self.b)
            for row in table.rows
            for cell in row
        )

    @property
    def marked(self) -> bool:
        """Whether any two intervals lie apart."""
        return any(cell.side for row in self.rows for cell in row.cells)


class _Row(NamedTuple):
    cells: tuple[Cell, ...]
    words: tuple[tuple[CellText, ...], ...]  # of each cell: itself, maybe published, difference


def compare_tables(a: Table, b: Table) -> TablePair:
    """Match columns and rows; numbers of a column share their decimals."""
    named = align(enumerate(a.columns), enumerate(b.columns), lambda column: column[1])
    presences = [presence(*pair) for pair in named]
    cells_a = _spread(a, [one and one[0] for one, _ in named])
    cells_b = _spread(b, [other and other[0] for _, other in named])
    names = tuple((one or other or (0, ""))[1] for one, other in named)
    whole = Table(name="", title="", caption="", columns=names, rows=(*cells_a, *cells_b))
    layout = lay_out(whole)
    rows = list(map(_Row, whole.rows, _words(layout)))
    rows_a, rows_b = rows[: len(cells_a)], rows[len(cells_a) :]

    heads = _heads(layout.columns, presences, cells_a, cells_b)
    pairs = align(rows_a, rows_b, lambda row: _heading(row.cells, heads))
    columns = tuple(
        _column(index, column, presences[index], index in heads, pairs)
        for index, column in enumerate(layout.columns)
    )
    return TablePair(
        a=a,
        b=b,
        columns=columns,
        rows=tuple(_row(columns, one, other) for one, other in pairs),
        duplicates=not (_told_apart(cells_a, heads) and _told_apart(cells_b, heads)),
    )


def _spread(table: Table, places: Sequence[int | None]) -> list[tuple[Cell, ...]]:
    """The rows with a cell for every column of either table."""
    return [tuple(None if place is None else row[place] for place in places) for row in table.rows]


def _words(layout: Layout) -> Iterator[tuple[tuple[CellText, ...], ...]]:
    """The rows of a layout, with all that belongs to one cell in one place."""
    for row in layout.rows:
        shown = iter(row)
        yield tuple(tuple(islice(shown, 3 if column.compared else 1)) for column in layout.columns)


def _heads(
    columns: Sequence[Column],
    presences: Sequence[Presence],
    cells_a: Sequence[tuple[Cell, ...]],
    cells_b: Sequence[tuple[Cell, ...]],
) -> list[int]:
    """The columns that name a row: the leading ones up to the end of the first run of texts.

    Further ones are taken in while rows of one table would have the same headings, but none that
    was measured.  In a table of nothing but texts the first one heads.
    """
    shared = [index for index, who in enumerate(presences) if who == "both"]
    rows = [*cells_a, *cells_b]
    leading = list(takewhile(lambda index: not _is_measured(index, rows), shared))
    texts = [columns[index].kind != "number" for index in leading]
    count = min(1, len(leading))
    if True in texts and not (leading == shared and all(texts)):
        first = texts.index(True)
        count = first + len(list(takewhile(bool, texts[first:])))
    while count < len(leading) and not (
        _told_apart(cells_a, leading[:count]) and _told_apart(cells_b, leading[:count])
    ):
        count += 1
    return leading[:count]


def _is_measured(index: int, rows: Sequence[tuple[Cell, ...]]) -> bool:
    return any(isinstance(row[index], (Measured, float)) for row in rows)


def _told_apart(rows: Sequence[tuple[Cell, ...]], heads: Sequence[int]) -> bool:
    return len({_heading(row, heads) for row in rows}) == len(rows)


def _heading(cells: tuple[Cell, ...], heads: Sequence[int]) -> tuple[str, ...]:
    return tuple(str(cells[index]) for index in heads)


_Pairs = list[tuple[_Row | None, _Row | None]]


def _column(index: int, column: Column, who: Presence, is_head: bool, pairs: _Pairs) -> ColumnPair:
    cells = [row.cells[index] for pair in pairs for row in pair if row]
    words = [(one.words[index], other.words[index]) for one, other in pairs if one and other]
    is_text = column.kind != "number" or any(isinstance(cell, bool) for cell in cells)
    kind: Kind = "head" if is_head else "text" if is_text else "number"
    return ColumnPair(
        name=column.name,
        kind=kind,
        presence=who,
        decimals=column.decimals,
        published=column.compared,
        alike=kind == "text" and all(one == other for one, other in words),
    )


def _row(columns: Sequence[ColumnPair], a: _Row | None, b: _Row | None) -> RowPair:
    cells = tuple(_cell(index, column, a, b) for index, column in enumerate(columns))
    return RowPair(presence=presence(a, b), cells=cells)


def _cell(index: int, column: ColumnPair, a: _Row | None, b: _Row | None) -> CellPair:
    words = {
        side: row.words[index]
        for side, row in (("a", a), ("b", b))
        if row is not None and column.presence in ("both", side)
    }
    published = [cell[1].text for cell in words.values() if column.published]
    has_numbers = a is not None and b is not None and column.kind == "number"
    one, other = (row.cells[index] if row and has_numbers else None for row in (a, b))
    return CellPair(
        a=words["a"][0] if "a" in words else None,
        b=words["b"][0] if "b" in words else None,
        difference=_difference(one, other, column.decimals),
        side=_side(one, other),
        published="; ".join(dict.fromkeys(filter(None, published))),
    )


def _difference(a: Cell, b: Cell, decimals: int) -> str:
    """B - A, or nothing where there is no such number."""
    one, other = _number(a), _number(b)
    if one is None or other is None:
        return ""
    difference = 0.0 if one == other else other - one  # two infinities differ by nothing
    return "" if math.isnan(difference) else formatting.number(difference, decimals, signed=True)


def _number(cell: Cell) -> float | None:
    if isinstance(cell, Measured):
        return cell.value
    return cell if isinstance(cell, (int, float)) else None


def _side(a: Cell, b: Cell) -> Side:
    """Where B's interval lies as seen from A's, if they have no point in common."""
    if not (isinstance(a, Measured) and isinstance(b, Measured)):
        return ""
    if "range" in (a.bounds, b.bounds):  # of too few trials to tell
        return ""
    if a.high is not None and b.low is not None and a.high < b.low:
        return "above"
    if a.low is not None and b.high is not None and b.high < a.low:
        return "below"
    return ""
