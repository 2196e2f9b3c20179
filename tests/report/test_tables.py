import csv
import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ethogram.core.findings import Cell, Measured, Table
from ethogram.report.tables import as_csv, lay_out


def table(columns: tuple[str, ...], *rows: tuple[Cell, ...]) -> Table:
    return Table(name="t", title="T", caption="", columns=columns, rows=rows)


def test_a_measured_cell_is_shown_beside_the_published_one_with_their_difference() -> None:
    cell = Measured(value=98.7, low=98.2, high=99.1, published=99.0)
    ((head, measured, published, difference),) = lay_out(table(("who", "J"), ("all", cell))).rows
    assert (head.text, head.kind) == ("all", "head")
    assert (measured.text, measured.interval) == ("98.7", "[98.2, 99.1]")
    assert published.text == "99.0"
    assert (difference.text, difference.side) == ("\u22120.3", "")


@pytest.mark.parametrize(
    ("published", "side"),
    [(97.9, "above"), (98.0, ""), (99.0, ""), (99.1, "below")],
)
def test_a_difference_is_marked_where_the_interval_leaves_the_published_value_out(
    published: float, side: str
) -> None:
    cell = Measured(value=98.5, low=98.0, high=99.0, published=published)
    layout = lay_out(table(("J",), (cell,)))
    assert layout.rows[0][-1].side == side
    assert layout.marked == bool(side)


@pytest.mark.parametrize(
    ("cell", "shown"),
    [
        (Measured(value=1.53, low=1.4, high=1.7, published=2),
         ["1.5", "[1.4, 1.7]", "2", "\u22120.5"]),
        (Measured(value=98.982, low=98.976, high=98.988, published=99.0),
         ["98.98", "[98.98, 98.99]", "99.0", "\u22120.02"]),
    ],
)  # fmt: skip
def test_a_marked_difference_is_seen_in_the_numbers_beside_it(
    cell: Measured, shown: list[str]
) -> None:
    ((measured, published, difference),) = lay_out(table(("J",), (cell,))).rows
    assert [measured.text, measured.interval, published.text, difference.text] == shown
    assert difference.side == "below"


@given(st.integers(-50, 50), st.floats(-0.7, 0.7), st.floats(1e-9, 1), st.floats(1e-9, 1))
def test_no_marker_contradicts_what_is_shown(
    published: int, off: float, below: float, above: float
) -> None:
    value = published + off
    cell = Measured(value=value, low=value - below, high=value + above, published=published)
    ((measured, _, difference),) = lay_out(table(("J",), (cell,))).rows
    low, high = (
        float(bound.replace("\u2212", "-")) for bound in measured.interval[1:-1].split(", ")
    )
    outside = "above" if published < low else "below" if high < published else ""
    assert difference.side in ("", outside)


def test_a_range_of_few_trials_is_worded_as_one_and_marks_nothing() -> None:
    cell = Measured(value=2.5, low=2.0, high=3.0, published=9.0, bounds="range")
    layout = lay_out(table(("J",), (cell,)))
    assert layout.rows[0][0].interval == "(2.0 to 3.0)"
    assert layout.ranged
    assert not layout.marked


def test_numbers_of_a_run_that_is_only_to_work_are_marked_beside_nothing() -> None:
    found = table(("J",), (Measured(value=1.0, low=0.9, high=1.1, published=9.0),))
    assert lay_out(found).marked
    assert not lay_out(found, comparable=False).marked


def test_without_an_interval_nothing_is_marked() -> None:
    layout = lay_out(table(("J",), (Measured(value=1.0, published=99.0),)))
    assert not layout.marked


def test_a_missing_cell_leaves_its_three_places_empty() -> None:
    cell = Measured(value=1.0, published=2.0)
    layout = lay_out(table(("J",), (cell,), (None,), (Measured(value=3.0),)))
    assert [shown.text for shown in layout.rows[1]] == ["", "", ""]
    assert [shown.text for shown in layout.rows[2]] == ["3.0", "", ""]
    assert {len(row) for row in layout.rows} == {layout.width}


def test_leading_texts_head_their_row_and_in_a_table_of_texts_only_the_first_does() -> None:
    mixed = lay_out(table(("a", "b", "x", "c"), ("p", "q", 1.5, "r")))
    assert [column.kind for column in mixed.columns] == ["head", "head", "number", "text"]
    texts = lay_out(table(("agent", "1", "2"), ("first", "o", "x")))
    assert [column.kind for column in texts.columns] == ["head", "text", "text"]


def test_a_column_shares_its_decimals_and_whole_numbers_have_none() -> None:
    layout = lay_out(table(("x", "n", "yes"), (0.5, 20_000, True), (12.25, 3, False)))
    assert [[shown.text for shown in row] for row in layout.rows] == [
        ["0.5", "20\u202f000", "yes"],
        ["12.2", "3", "no"],
    ]


def test_a_table_without_rows_has_its_columns() -> None:
    layout = lay_out(table(("a", "b")))
    assert layout.width == 2
    assert layout.rows == ()


def test_csv_keeps_every_digit_and_every_bound() -> None:
    cell = Measured(value=1 / 3, low=0.1, high=None, published=0.3)
    text = as_csv(table(("who, why", "J"), ('said "hi"\nand left', cell), ("nobody", None)))
    assert list(csv.reader(io.StringIO(text))) == [
        ["who, why", "J", "J low", "J high", "J published"],
        ['said "hi"\nand left', repr(1 / 3), "0.1", "", "0.3"],
        ["nobody", "", "", "", ""],
    ]
