"""Findings' tables laid out for a page (measured beside published) and written as CSV."""

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from ethogram.core.findings import Cell, Measured, Table
from ethogram.report import formatting

Kind = Literal["head", "text", "number"]
Side = Literal["", "above", "below"]
MORE_DECIMALS = 3  # than published numbers have, at most
TO = "to"  # between the ends of a range


@dataclass(frozen=True, kw_only=True)
class CellText:
    """A cell of the page, ready to be read."""

    text: str
    kind: Kind
    interval: str = ""  # in brackets; a range of few trials in words
    side: Side = ""  # of the published value, where the measured interval lies wholly


@dataclass(frozen=True, kw_only=True)
class Column:
    """How one column of a table is shown; a compared one takes three columns of the page."""

    name: str
    kind: Kind
    decimals: int  # of what was measured
    compared: bool
    printed: int = 0  # decimals of published numbers


@dataclass(frozen=True, kw_only=True)
class Layout:
    """A table ready for the page."""

    columns: tuple[Column, ...]
    rows: tuple[tuple[CellText, ...], ...]

    @property
    def width(self) -> int:
        """Columns on the page."""
        return sum(3 if column.compared else 1 for column in self.columns)

    @property
    def compared(self) -> bool:
        """Whether any column sets measured beside published."""
        return any(column.compared for column in self.columns)

    @property
    def ranged(self) -> bool:
        """Whether any measured number has a range of its trials in place of an interval."""
        return any(f" {TO} " in cell.interval for row in self.rows for cell in row)

    @property
    def marked(self) -> bool:
        """Whether any published value lies outside the measured interval."""
        return any(cell.side for row in self.rows for cell in row)


def lay_out(table: Table, *, comparable: bool = True) -> Layout:
    """Decide what each column is, and word every cell.

    Args:
        table: what was measured.
        comparable: whether it may be held against what is published, and marked where it differs;
            a run that was only to show that everything works may not.

    """
    columns = tuple(_columns(table, comparable=comparable))
    rows = tuple(
        tuple(
            shown
            for column, cell in zip(columns, row, strict=True)
            for shown in (
                _compared(column, cell, comparable) if column.compared else _plain(column, cell)
            )
        )
        for row in table.rows
    )
    return Layout(columns=columns, rows=rows)


def as_csv(table: Table) -> str:
    """The table in full precision; a measured column brings its interval and published value."""
    measured = [any(isinstance(cell, Measured) for cell in column) for column in _by_column(table)]
    page = io.StringIO()
    writer = csv.writer(page, lineterminator="\n")
    writer.writerow(
        name
        for column, wide in zip(table.columns, measured, strict=True)
        for name in ([f"{column}{part}" for part in _PARTS] if wide else [column])
    )
    for row in table.rows:
        writer.writerow(
            value
            for cell, wide in zip(row, measured, strict=True)
            for value in (_spread(cell) if wide else [cell])
        )
    return page.getvalue()


_PARTS = ("", " low", " high", " published")


def _spread(cell: Cell) -> list[Cell]:
    if isinstance(cell, Measured):
        return [cell.value, cell.low, cell.high, cell.published]
    return [cell, None, None, None]


def _by_column(table: Table) -> list[tuple[Cell, ...]]:
    return [tuple(row[index] for row in table.rows) for index in range(len(table.columns))]


def _columns(table: Table, *, comparable: bool) -> Iterator[Column]:
    """Leading columns of text head the rows (only the first where there is nothing but text)."""
    by_column = _by_column(table)
    texts = [_is_text(cells) for cells in by_column]
    heads = texts.index(False) if False in texts else 1
    for index, (name, cells) in enumerate(zip(table.columns, by_column, strict=True)):
        measured = [cell for cell in cells if isinstance(cell, Measured)]
        published = [cell.published for cell in measured if cell.published is not None]
        printed = max(map(formatting.decimals_printed, published), default=0)
        yield Column(
            name=name,
            kind="head" if index < heads else "text" if texts[index] else "number",
            decimals=(
                _telling(measured if comparable else [], printed)
                if published
                else formatting.decimals_for(_values(cells))
            ),
            compared=bool(published),
            printed=printed,
        )


def _telling(cells: Sequence[Measured], decimals: int) -> int:
    """Decimals, a few more if need be, with which numbers show what is marked beside them."""
    differing = [cell for cell in cells if _side(cell)]
    for more in range(MORE_DECIMALS + 1):
        if all(_shows(cell, decimals + more) for cell in differing):
            return decimals + more
    return decimals


def _shows(cell: Measured, decimals: int) -> bool:
    """Whether the rounded interval leaves the published value out, as the exact one does."""
    if cell.published is None:
        return False
    low, high = (
        round(bound, decimals) if bound is not None else off
        for bound, off in ((cell.low, -math.inf), (cell.high, math.inf))
    )
    return cell.published < low or high < cell.published


def _is_text(cells: Sequence[Cell]) -> bool:
    return any(isinstance(cell, str) for cell in cells)


def _values(cells: Sequence[Cell]) -> Iterator[float]:
    for cell in cells:
        if isinstance(cell, Measured):
            yield cell.value
        elif isinstance(cell, float):
            yield cell


def _plain(column: Column, cell: Cell) -> tuple[CellText, ...]:
    if isinstance(cell, Measured):
        span = _span(cell, column.decimals)
        text = formatting.number(cell.value, column.decimals)
        return (CellText(text=text, kind=column.kind, interval=span),)
    return (CellText(text=_worded(cell, column.decimals), kind=column.kind),)


def _span(cell: Measured, decimals: int) -> str:
    """An interval in brackets, or "(1 to 3)", the range of trials that are too few for one."""
    if cell.bounds == "range" and cell.low is not None and cell.high is not None:
        low, high = (formatting.number(bound, decimals) for bound in (cell.low, cell.high))
        return f"({low} {TO} {high})"
    return formatting.interval(cell.low, cell.high, decimals)


def _compared(column: Column, cell: Cell, comparable: bool) -> tuple[CellText, ...]:
    """Measured, published, difference."""
    (measured,) = _plain(column, cell)
    published = cell.published if isinstance(cell, Measured) else None
    if not isinstance(cell, Measured) or published is None:
        nothing = CellText(text="", kind=column.kind)
        return measured, nothing, nothing
    difference = formatting.number(cell.value - published, column.decimals, signed=True)
    return (
        measured,
        CellText(text=formatting.number(published, column.printed), kind=column.kind),
        CellText(
            text=difference,
            kind=column.kind,
            side=_side(cell) if comparable and _shows(cell, column.decimals) else "",
        ),
    )


def _side(cell: Measured) -> Side:
    """Where the interval lies as seen from the published value; a range of trials tells nothing."""
    if cell.published is None or cell.bounds == "range":
        return ""
    if cell.low is not None and cell.published < cell.low:
        return "above"
    if cell.high is not None and cell.published > cell.high:
        return "below"
    return ""


def _worded(cell: str | int | float | None, decimals: int) -> str:
    if cell is None:
        return ""
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, str):
        return cell
    return formatting.number(cell, decimals if isinstance(cell, float) else 0)
