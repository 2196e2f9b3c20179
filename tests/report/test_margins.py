"""A claim's evidence on a line: whatever the numbers, everything is at its place on one scale."""

import math
import xml.etree.ElementTree as ET
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ethogram.core.findings import Claim, Revision
from ethogram.report.formatting import note, shared_revisions, stated
from ethogram.report.margins import claimed, margin_plot

CLAIM = Claim(
    number=4, statement="", test="", effect=-0.018, low=-0.026, high=-0.010, unit="return",
    p_value=0.001, verdict="refuted", side="less than", margin=-2.0,
)  # fmt: skip
NUMBERS = st.just(0.0) | st.floats(1e-6, 1e6) | st.floats(-1e6, -1e-6)
WIDTHS = st.just(0.0) | st.floats(1e-6, 1e6)


def drawn(claim: Claim) -> dict[str, list[float]]:
    """Where things are: the shade from left to right, margins, the interval, the effect."""
    root = ET.fromstring(margin_plot(claim))
    found: dict[str, list[float]] = {"bound": []}
    for part in root:
        kind, path = part.get("class", ""), part.get("d", "")
        if kind == "side":
            left = float(part.get("x", ""))
            found[kind] = [left, left + float(part.get("width", ""))]
        elif kind == "bound":
            found[kind].append(float(path[1:].split()[0]))
        elif kind == "interval":
            start, end = path[1:].split("H")
            found[kind] = [float(start.split()[0]), float(end)]
        elif kind == "effect":
            found[kind] = [float(part.get("cx", ""))]
    return found


@given(NUMBERS, NUMBERS, WIDTHS, WIDTHS)
def test_margin_effect_and_interval_are_drawn_to_one_scale(
    margin: float, effect: float, below: float, above: float
) -> None:
    claim = replace(CLAIM, margin=margin, effect=effect, low=effect - below, high=effect + above)
    at = drawn(claim)
    places = [*at["bound"], *at["effect"], *at["interval"]]
    values = [margin, effect, effect - below, effect + above]
    assert all(0 <= place <= 240 for place in places)
    (first, low), (last, high) = (f(zip(places, values, strict=True)) for f in (min, max))
    scale = (last - first) / (high - low) if high > low else 0
    for place, value in zip(places, values, strict=True):
        assert place == pytest.approx(first + scale * (value - low), abs=0.05)


@pytest.mark.parametrize(
    ("side", "margin", "words", "shaded"),
    [
        ("less than", -2.0, "less than \u22122.0 return", "left"),
        ("at most", 0.5, "at most 0.50 return", "left"),
        ("more than", 0.0, "more than 0 return", "right"),
        ("at least", 3.0, "at least 3.0 return", "right"),
        ("within", 0.1, "between \u22120.10 and 0.10 return", "between"),
    ],
)
def test_the_claimed_side_is_worded_and_shaded(
    side: str, margin: float, words: str, shaded: str
) -> None:
    claim = replace(CLAIM, side=side, margin=margin)  # type: ignore[arg-type]
    assert claimed(claim) == words
    at = drawn(claim)
    start, end = at["side"]
    assert (start == min(at["bound"])) == (shaded != "left")
    assert (end == pytest.approx(max(at["bound"]))) == (shaded != "right")


def test_an_open_interval_ends_at_the_edge_and_without_a_margin_nothing_is_drawn() -> None:
    at = drawn(replace(CLAIM, low=-math.inf, high=None))
    assert at["interval"] == [10, 230]
    for missing in ({"effect": None}, {"margin": None}, {"side": None}, {"effect": math.nan}):
        assert margin_plot(replace(CLAIM, **missing)) == ""
    assert claimed(replace(CLAIM, margin=None)) == ""


def test_text_in_a_line_is_text() -> None:
    hostile = '"><script>run()</script>'
    root = ET.fromstring(margin_plot(replace(CLAIM, unit=hostile)))
    assert hostile in root.get("aria-label", "")


def test_what_the_page_says_of_when_claims_were_stated_is_what_they_say() -> None:
    early = replace(CLAIM, number=1, stated="2026-11-01")
    late = replace(CLAIM, number=2, stated="2026-12-01")
    changed = replace(
        early,
        number=3,
        history=(Revision(date="2026-11-02", change="a", reason="b", known="c"),),
    )
    unknown = replace(CLAIM, number=5)
    day = "2026-11-20"
    plain = "Each was stated before the run, with its test and margin."
    assert stated([early, early], day) == plain
    assert stated([early, changed], day) == (
        "Each was first stated before the run, with its test and margin. "
        "Claim 3: its test has changed since, as is said there."
    )
    assert stated([early, late, unknown], day) == (
        "Each has its test and margin. Claim 2 was stated after the run. "
        "It is not recorded when claim 5 was stated."
    )
    assert "stated before" not in stated([unknown], day)
    assert stated([changed, changed], day).endswith(
        "The tests of all have changed since, as is said below."
    )


def test_changes_to_all_claims_are_said_once_and_the_deciding_comparison_too() -> None:
    one, other = (Revision(date="2026-11-02", change=each, reason="", known="") for each in "ab")
    claims = [
        replace(CLAIM, number=1, history=(one, other)),
        replace(CLAIM, number=2, history=(other, one)),
        replace(CLAIM, number=3, history=(other,)),
    ]
    assert shared_revisions(claims) == {other: "all claims", one: "claims 1 and 2"}
    assert list(shared_revisions(claims)) == [other, one]
    assert shared_revisions(claims[:1]) == {}
    told = replace(CLAIM, compared="a - b", note="3 trials; rests on: a - b; leans towards it")
    assert note(told) == "3 trials; leans towards it"
    assert note(replace(told, compared="")) == told.note
