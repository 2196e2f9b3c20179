import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ethogram.core.findings import Claim
from ethogram.report import formatting
from ethogram.report.margins import claimed


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [
        (99.0, 1, "99.0"),
        (-0.5, 2, "\u22120.50"),
        (-0.02, 1, "0.0"),
        (1234.0, 0, "1234"),
        (20_000.0, 0, "20\u202f000"),
        (0.0, 3, "0.000"),
        (2.5e-9, 6, "2.50 \u00d7 10⁻⁹"),
        (-3e12, 0, "\u22123.00 \u00d7 10¹²"),
        (math.nan, 2, "undefined"),
        (-math.inf, 2, "\u2212∞"),
    ],
)
def test_a_number_reads_as_an_author_would_print_it(value: float, decimals: int, text: str) -> None:
    assert formatting.number(value, decimals) == text


def test_a_signed_number_shows_its_plus_but_zero_has_no_sign() -> None:
    assert formatting.number(0.5, 1, signed=True) == "+0.5"
    assert formatting.number(-0.5, 1, signed=True) == "\u22120.5"
    assert formatting.number(0.01, 1, signed=True) == "0.0"


@given(st.floats(), st.integers(0, formatting.MOST_DECIMALS))
def test_every_float_can_be_worded(value: float, decimals: int) -> None:
    assert formatting.number(value, decimals)


def test_decimals_follow_the_typical_size() -> None:
    assert formatting.decimals_for([99.0, 25.4, 0.0]) == 1
    assert formatting.decimals_for([0.0123]) == 4
    assert formatting.decimals_for([4321.0]) == 0
    assert formatting.decimals_for([0.0, math.nan, math.inf]) == 0


def test_a_published_number_keeps_the_decimals_it_was_printed_with() -> None:
    assert formatting.decimals_printed(99.0) == 1
    assert formatting.decimals_printed(0.35) == 2
    assert formatting.decimals_printed(3050) == 0
    assert formatting.decimals_printed(1e-5) == 5


def claim(effect: float | None, low: float | None, high: float | None, unit: str) -> Claim:
    return Claim(
        number=1, statement="", source="", test="", effect=effect, low=low, high=high, unit=unit,
        p_value=None, verdict="undecided",
    )  # fmt: skip


def test_an_effect_has_the_digits_that_its_interval_bears() -> None:
    assert formatting.effect(claim(0.12345, 0.1, 0.14, "reward")) == (
        "0.123 reward",
        "[0.100, 0.140]",
    )
    assert formatting.effect(claim(12.345, 2.0, 24.0, "%")) == ("12 %", "[2, 24]")


def test_an_effect_smaller_than_its_interval_does_not_read_as_zero() -> None:
    assert formatting.effect(claim(-0.31, -780.0, 779.6, "")) == ("\u22120.3", "[\u2212780, 780]")


def test_an_interval_that_ends_next_to_its_margin_reads_as_the_verdict_does() -> None:
    near = replace(claim(-0.018, -0.0482, -0.0048, "J"), side="less than", margin=-0.0479)
    assert formatting.effect(near)[1] == "[\u22120.0482, \u22120.0048]"
    assert claimed(near) == "less than \u22120.0479 J"
    beyond = replace(near, margin=-0.04821)
    assert formatting.effect(beyond)[1] == "[\u22120.04820, \u22120.00480]"
    assert claimed(beyond) == "less than \u22120.04821 J"
    on_it = replace(near, margin=-0.0482)
    assert formatting.effect(on_it)[1] == "[\u22120.048, \u22120.005]"
    far = replace(near, side="within", margin=0.1)
    assert formatting.effect(far)[1] == "[\u22120.048, \u22120.005]"
    assert claimed(far) == "between \u22120.10 and 0.10 J"


def test_an_effect_may_lack_bounds_or_be_missing() -> None:
    assert formatting.effect(claim(0.5, 0.25, None, "")) == ("0.500", "[0.250, ∞]")
    assert formatting.effect(claim(0.5, None, None, "")) == ("0.500", "")
    assert formatting.effect(claim(0.5, 0.25, math.inf, "")) == ("0.500", "[0.250, ∞]")
    assert formatting.effect(claim(1.0, 1.0, 1.0, "")) == ("1.00", "[1.00, 1.00]")
    assert formatting.effect(claim(None, None, None, "m")) == ("", "")


def test_a_p_value_is_never_zero() -> None:
    assert formatting.p_value(0.0) == "< 0.001"
    assert formatting.p_value(0.0421) == "= 0.042"
    assert formatting.p_value(None) == ""


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 s"),
        (0.42, "0.4 s"),
        (59.4, "59 s"),
        (59.9, "1 min 0 s"),
        (161.3, "2 min 41 s"),
        (7260.0, "2 h 1 min"),
    ],
)
def test_a_duration_is_in_the_two_largest_units(seconds: float, text: str) -> None:
    assert formatting.duration(seconds) == text


def test_settings_are_listed_under_their_dotted_keys() -> None:
    settings = {"world": {"agents": 10, "fill": {"seen": True}}, "name": "a b", "empty": {}}
    assert list(formatting.dotted(settings)) == [
        ("world.agents", "10"),
        ("world.fill.seen", "true"),
        ("name", "a b"),
        ("empty", "{}"),
    ]
