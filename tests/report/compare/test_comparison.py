import string
from dataclasses import replace
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings

from ethogram.cli.printing import show_comparison
from ethogram.core.findings import Cell, Claim, Measured, Table
from ethogram.report import Comparison, StudyPage, compare_pages, write_comparison
from ethogram.report.compare.align import align
from ethogram.report.compare.comparison import StudyPair
from ethogram.report.compare.tables import TablePair, compare_tables

HOSTILE = "<script>alert(1)</script> \"'&amp;{{ 7*7 }}\u202e\u05e9\u05dc\u05d5\u05dd"


def table(columns: tuple[str, ...], *rows: tuple[Cell, ...], name: str = "t") -> Table:
    return Table(name=name, title="T", caption="", columns=columns, rows=rows)


def page(**changes: Any) -> StudyPage:
    return StudyPage(**{
        "name": "s", "title": "S", "question": "?", "plan": "smoke", "plan_description": "",
        "trials": 2, "cases_done": 1, "cases_planned": 1, "date": "2026-11-20", "seconds": 1.0,
        "command": "", "digest": "d", **changes,
    })  # fmt: skip


def claim(number: int = 1, **changes: Any) -> Claim:
    return Claim(**{
        "number": number, "statement": "It is so.", "source": "", "test": "", "effect": 1.0,
        "low": 0.5, "high": 1.5, "unit": "m", "p_value": 0.01, "verdict": "confirmed", **changes,
    })  # fmt: skip


def texts(pair: TablePair) -> list[tuple[str, list[tuple[str | None, str | None, str]]]]:
    """Who holds each row, and the texts of its cells: A's, B's and the difference."""
    return [
        (
            row.presence,
            [(c.a and c.a.text, c.b and c.b.text, c.difference) for c in row.cells],
        )
        for row in pair.rows
    ]


def test_what_only_b_has_follows_what_it_follows_there() -> None:
    pairs = align("acd", "abde", str)
    assert pairs == [("a", "a"), (None, "b"), ("c", None), ("d", "d"), (None, "e")]


def test_items_of_one_name_are_matched_by_their_order() -> None:
    assert align(["x1", "x2", "x3"], ["x4"], lambda item: item[0]) == [
        ("x1", "x4"),
        ("x2", None),
        ("x3", None),
    ]


def test_numbers_stand_as_a_as_b_and_as_their_difference() -> None:
    a = table(("who", "J", "n"), ("all", 1.25, 3), ("none", 2.0, 4))
    b = table(("who", "J", "n"), ("none", 1.5, 4), ("all", 1.5, 1))
    pair = compare_tables(a, b)
    assert [column.kind for column in pair.columns] == ["head", "number", "number"]
    assert texts(pair) == [
        ("both", [("all", "all", ""), ("1.25", "1.50", "+0.25"), ("3", "1", "\u22122")]),
        ("both", [("none", "none", ""), ("2.00", "1.50", "\u22120.50"), ("4", "4", "0")]),
    ]


def test_a_row_that_one_table_lacks_is_kept_and_said_to_be_its_own() -> None:
    pair = compare_tables(table(("who", "J"), ("a", 1.0)), table(("who", "J"), ("b", 2.0)))
    assert texts(pair) == [
        ("b", [(None, "b", ""), (None, "2.00", "")]),
        ("a", [("a", None, ""), ("1.00", None, "")]),
    ]


def test_columns_are_matched_by_name_and_one_that_a_table_lacks_is_kept() -> None:
    a = table(("who", "J", "old"), ("a", 1.0, 5.0))
    b = table(("who", "new", "J"), ("a", 7.0, 3.0))
    pair = compare_tables(a, b)
    assert [(column.name, column.presence) for column in pair.columns] == [
        ("who", "both"),
        ("new", "b"),
        ("J", "both"),
        ("old", "a"),
    ]
    assert texts(pair)[0][1][1:] == [
        (None, "7.00", ""),
        ("1.00", "3.00", "+2.00"),
        ("5.00", None, ""),
    ]
    assert [column.span for column in pair.columns] == [1, 1, 3, 1]


@pytest.mark.parametrize(
    ("low", "high", "side"),
    [(2.1, 3.0, "above"), (2.0, 3.0, ""), (-1.0, 1.0, ""), (-1.0, 0.9, "below"), (None, 3.0, "")],
)
def test_intervals_without_a_common_point_are_marked(
    low: float | None, high: float, side: str
) -> None:
    a = table(("who", "J"), ("a", Measured(value=1.5, low=1.0, high=2.0)))
    b = table(("who", "J"), ("a", Measured(value=2.5, low=low, high=high)))
    pair = compare_tables(a, b)
    assert pair.rows[0].cells[1].side == side
    assert pair.marked == bool(side)


def test_the_published_value_stands_once_and_twice_only_where_the_tables_disagree() -> None:
    a = table(("who", "J"), ("a", Measured(value=1.0, published=2.5)), ("b", None))
    b = table(("who", "J"), ("a", Measured(value=1.2, published=2.5)), ("b", None))
    pair = compare_tables(a, b)
    assert [row.cells[1].published for row in pair.rows] == ["2.5", ""]
    assert pair.columns[1].span == 4
    other = table(("who", "J"), ("a", Measured(value=1.2, published=3.5)))
    assert compare_tables(a, other).rows[0].cells[1].published == "2.5; 3.5"


def test_texts_stand_once_unless_they_differ_and_bools_have_no_difference() -> None:
    a = table(("who", "J", "note", "unit", "ok"), ("a", 1.0, "up", "m", True))
    b = table(("who", "J", "note", "unit", "ok"), ("a", 1.0, "down", "m", False))
    pair = compare_tables(a, b)
    assert [column.span for column in pair.columns] == [1, 3, 2, 1, 2]
    assert texts(pair)[0][1][2:] == [("up", "down", ""), ("m", "m", ""), ("yes", "no", "")]
    assert [cell.differs for cell in pair.rows[0].cells[2:]] == [True, False, True]


def test_numbers_before_the_first_text_head_a_row_and_so_does_what_tells_rows_apart() -> None:
    measured = Measured(value=1.0)
    a = table(("n", "policy", "words", "R"), (2, "x", 4, measured), (3, "x", 9, measured))
    heads = [column.kind for column in compare_tables(a, a).columns]
    assert heads == ["head", "head", "number", "number"]
    twice = table(("reading", "claim", "verdict"), ("r", 1, "confirmed"), ("r", 2, "refuted"))
    other = table(("reading", "claim", "verdict"), ("r", 1, "confirmed"), ("r", 2, "undecided"))
    pair = compare_tables(twice, other)
    assert [column.kind for column in pair.columns] == ["head", "head", "text"]
    assert [row.presence for row in pair.rows] == ["both", "both"]
    assert not pair.duplicates


def test_rows_that_nothing_tells_apart_are_matched_by_their_order_and_it_is_said() -> None:
    pair = compare_tables(table(("x",), (1.0,), (2.0,)), table(("x",), (1.5,)))
    assert texts(pair) == [("both", [("1.00", "1.50", "+0.50")]), ("a", [("2.00", None, "")])]
    assert pair.duplicates


def test_what_has_no_difference_shows_none() -> None:
    inf, nan = float("inf"), float("nan")
    a = table(("k", "x"), ("same", inf), ("up", 1.0), ("nan", nan), ("none", None))
    b = table(("k", "x"), ("same", inf), ("up", inf), ("nan", 1.0), ("none", 1.0))
    assert [row.cells[1].difference for row in compare_tables(a, b).rows] == ["0.00", "∞", "", ""]


def test_claims_are_matched_by_number_and_a_missing_effect_is_no_trouble() -> None:
    a = page(claims=[claim(1), claim(2), claim(4, verdict="not run", effect=None, low=None)])
    b = page(claims=[claim(1, verdict="refuted"), claim(2, statement="Else."), claim(3)])
    pair = compare_pages(a, b)
    assert [(found.number, found.presence, found.changed) for found in pair.claims] == [
        (1, "both", True),
        (2, "both", False),
        (3, "b", False),
        (4, "a", False),
    ]
    assert pair.claims[1].statements == ("It is so.", "Else.")
    assert pair.tally == "1 of 2 verdicts differs."


def test_settings_that_mean_the_same_do_not_differ() -> None:
    a = page(settings={"w": {"n": 1, "axis": [3.0], "x": "u", "y": True}, "old": None})
    b = page(settings={"w": {"n": 1.0, "axis": 3.0, "x": "v", "y": False}, "new": [1, 2]})
    found = [(pair.name, pair.a, pair.b) for pair in compare_pages(a, b).settings]
    assert found == [
        ("w.x", "u", "v"),
        ("w.y", "true", "false"),
        ("new", None, "[1, 2]"),
        ("old", "null", None),
    ]


def test_versions_are_compared_as_texts() -> None:
    pair = compare_pages(page(versions={"p": "3.1"}), page(versions={"p": "3.10", "q": "1"}))
    assert [(v.name, v.a, v.b) for v in pair.versions] == [("p", "3.1", "3.10"), ("q", None, "1")]


def test_tables_that_one_run_lacks_are_named() -> None:
    one, other, shared = (table(("x",), name=name) for name in ("one", "other", "shared"))
    pair = compare_pages(page(tables=[one, shared]), page(tables=[shared, other]))
    assert (pair.tables_of_a, pair.tables_of_b) == ((one,), (other,))
    assert [found.a for found in pair.tables] == [shared]


def test_any_text_is_taken_as_it_is() -> None:
    hostile = page(
        settings={HOSTILE: HOSTILE, "deep": "[" * 100_000},
        claims=[claim(statement=HOSTILE, unit=HOSTILE)],
        tables=[table((HOSTILE, "J"), (HOSTILE, 1.0), (HOSTILE, 2.0), name=HOSTILE)],
    )
    pair = compare_pages(hostile, replace(hostile, settings={HOSTILE: "", "deep": "[" * 100_001}))
    assert [setting.name for setting in pair.settings] == [HOSTILE, "deep"]
    assert pair.tables[0].columns[0].name == HOSTILE
    assert is_without_difference(replace(pair, settings=()))


def is_without_difference(pair: StudyPair) -> bool:
    rows = [row for found in pair.tables for row in found.rows]
    cells = [cell for row in rows for cell in row.cells]
    return (
        not (pair.settings or pair.versions or pair.changed)
        and not (pair.tables_of_a or pair.tables_of_b)
        and {row.presence for row in rows} <= {"both"}
        and {column.presence for found in pair.tables for column in found.columns} <= {"both"}
        and not any(cell.differs or cell.side for cell in cells)
        and all(set(cell.difference) <= set("0.") for cell in cells)
    )


words = st.text(string.printable + "\u05d0\u0660<>&", max_size=6)
numbers = st.floats(allow_subnormal=False, width=32)
bounds = st.none() | numbers


@st.composite
def measurements(draw: st.DrawFn) -> Measured:
    ends = sorted(draw(st.lists(st.floats(-1e9, 1e9), min_size=2, max_size=2)))
    low, high = draw(st.tuples(st.sampled_from([None, ends[0]]), st.sampled_from([None, ends[1]])))
    return Measured(value=draw(numbers), low=low, high=high, published=draw(st.none() | numbers))


@st.composite
def any_tables(draw: st.DrawFn) -> Table:
    columns = draw(st.lists(words, min_size=1, max_size=4))
    cell = st.none() | words | st.integers(-99, 99) | st.booleans() | numbers | measurements()
    rows = draw(st.lists(st.tuples(*(cell for _ in columns)), max_size=4))
    return table(tuple(columns), *rows, name=draw(words))


trees = st.recursive(
    words | st.integers() | st.booleans() | numbers | st.lists(st.integers(), max_size=2),
    lambda leaves: st.dictionaries(words, leaves, max_size=3),
    max_leaves=6,
)
pages = st.builds(
    page,
    settings=st.dictionaries(words, trees, max_size=3),
    versions=st.dictionaries(words, words, max_size=2),
    claims=st.lists(st.builds(claim, st.integers(1, 3), effect=bounds, statement=words)),
    tables=st.lists(any_tables(), max_size=2),
)


@settings(max_examples=60)
@given(pages)
def test_a_run_beside_itself_shows_no_difference(run: StudyPage) -> None:
    assert is_without_difference(compare_pages(run, run))


@settings(max_examples=60)
@given(any_tables(), any_tables())
def test_no_row_and_no_column_gets_lost(a: Table, b: Table) -> None:
    pair = compare_tables(a, b)
    for side, part in (("a", a), ("b", b)):
        assert sum(row.presence in ("both", side) for row in pair.rows) == len(part.rows)
        assert sum(column.presence in ("both", side) for column in pair.columns) == len(
            part.columns
        )


@pytest.mark.parametrize(
    ("one", "other", "changed"),
    [
        ("confirmed", "refuted", True),
        ("confirmed", "undecided", True),
        ("not run", "refuted", True),
        ("undecided", "not run", False),
        ("not run", "undecided", False),
        ("refuted", "refuted", False),
    ],
)
def test_undecided_against_not_run_is_no_difference(one: str, other: str, changed: bool) -> None:
    pair = compare_pages(
        page(claims=[claim(verdict=one)]), page(claims=[claim(verdict=other, effect=None)])
    )
    assert pair.claims[0].changed == changed
    assert pair.changed == changed


@pytest.mark.parametrize(
    ("changes", "alike"),
    [
        ({}, True),
        ({"effect": 7.0}, True),
        ({"unit": "m (standard deviation)"}, False),
        ({"compared": "J(none) - J(always)"}, False),
        ({"unit": "s", "effect": None}, True),
    ],
)
def test_effects_of_unlike_quantities_do_not_stand_beside_each_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changes: dict[str, Any], alike: bool
) -> None:
    mine = claim(compared="J(optional) - J(always)", low=None, high=None)
    theirs = replace(mine, **({"effect": 2.0} | changes))
    pair = compare_pages(page(claims=[mine]), page(claims=[theirs]))
    assert pair.claims[0].alike == alike
    found = Comparison(a="one", b="two", studies=[pair])
    write_comparison(tmp_path / "compare.html", found)
    text = (tmp_path / "compare.html").read_text()
    assert ("of different quantities" in text) == (not alike)
    assert text.count("1.00 m") == 1
    show_comparison(found)
    printed = capsys.readouterr().out
    assert ("of different quantities" in printed) == (not alike)
    assert ("confirmed  1 " in printed) == alike
