"""Findings' tables laid out for a page (measured beside published) and written as CSV."""

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from ethogram.core.findings import Cell, Measured, Table
from ethogram.report import wording

Kind = Literal["head", "text", "number"]
Side = Literal["", "above", "below"]


@dataclass(frozen=True, kw_only=True)
class Shown:
    """A cell of the page, ready to be read."""

    text: str
    kind: Kind
    interval: str = ""
    side: Side = ""  # of the published value, where the measured interval lies wholly


@dataclass(frozen=True, kw_only=True)
class Column:
    """How one column of a table is shown; a compared one takes three columns of the page."""

    name: str
    kind: Kind
    decimals: int
    compared: bool


@dataclass(frozen=True, kw_only=True)
class Layout:
    """A table ready for the page."""

    columns: tuple[Column, ...]
    rows: tuple[tuple[Shown, ...], ...]

    @property
    def width(self) -> int:
        """Columns on the page."""
        return sum(3 if column.compared else 1 for column in self.columns)

    @property
    def compared(self) -> bool:
        """Whether any column sets measured beside published."""
        return any(column.compared for column in self.columns)

    @property
    def marked(self) -> bool:
        """Whether any published value lies outside the measured interval."""
        return any(cell.side for row in self.rows for cell in row)


def lay_out(table: Table) -> Layout:
    """Decide what each column is, and word every cell."""
    columns = tuple(_columns(table))
    rows = tuple(
        tuple(
            shown
            for column, cell in zip(columns, row, strict=True)
            for shown in (_compared if column.compared else _plain)(column, cell)
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


def _columns(table: Table) -> Iterator[Column]:
    """Leading columns of text head the rows (only the first where there is nothing but text)."""
    by_column = _by_column(table)
    texts = [_is_text(cells) for cells in by_column]
    heads = texts.index(False) if False in texts else 1
    for index, (name, cells) in enumerate(zip(table.columns, by_column, strict=True)):
        measured = [cell for cell in cells if isinstance(cell, Measured)]
        published = [cell.published for cell in measured if cell.published is not None]
        yield Column(
            name=name,
            kind="head" if index < heads else "text" if texts[index] else "number",
            decimals=(
                max(map(wording.decimals_printed, published))
                if published
                else wording.decimals_for(_values(cells))
            ),
            compared=bool(published),
        )


def _is_text(cells: Sequence[Cell]) -> bool:
    return any(isinstance(cell, str) for cell in cells)


def _values(cells: Sequence[Cell]) -> Iterator[float]:
    for cell in cells:
        if isinstance(cell, Measured):
            yield cell.value
        elif isinstance(cell, float):
            yield cell


def _plain(column: Column, cell: Cell) -> tuple[Shown, ...]:
    if isinstance(cell, Measured):
        span = wording.interval(cell.low, cell.high, column.decimals)
        text = wording.number(cell.value, column.decimals)
        return (Shown(text=text, kind=column.kind, interval=span),)
    return (Shown(text=_worded(cell, column.decimals), kind=column.kind),)


def _compared(column: Column, cell: Cell) -> tuple[Shown, ...]:
    """Measured, published, difference."""
    (measured,) = _plain(column, cell)
    published = cell.published if isinstance(cell, Measured) else None
    if not isinstance(cell, Measured) or published is None:
        nothing = Shown(text="", kind=column.kind)
        return measured, nothing, nothing
    difference = wording.number(cell.value - published, column.decimals, signed=True)
    return (
        measured,
        Shown(text=wording.number(published, column.decimals), kind=column.kind),
        Shown(text=difference, kind=column.kind, side=_side(cell, published)),
    )


def _side(cell: Measured, published: float) -> Side:
    if cell.low is not None and published < cell.low:
        return "above"
    if cell.high is not None and published > cell.high:
        return "below"
    return ""


def _worded(cell: str | int | float | None, decimals: int) -> str:
    if cell is None:
        return ""
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, str):
        return cell
    return wording.number(cell, decimals if isinstance(cell, float) else 0)
