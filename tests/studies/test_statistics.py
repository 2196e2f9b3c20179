import dataclasses
import importlib.util
import math
import re
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pytest
import scipy.stats
from hypothesis import assume, given

from ethogram.core.findings import Claim, Revision, Side
from ethogram.studies.statistics import (
    FAMILY_ERROR,
    ClaimSpec,
    Need,
    Part,
    Support,
    Trials,
    difference,
    holm,
    interval_of_mean,
    jackknife_pseudovalues,
    judge,
    measured,
)

SIDES: tuple[Side, ...] = ("at least", "more than", "at most", "less than", "within")


def trials(*values: float, name: str = "a condition") -> Trials:
    return Trials(name, np.array(values, dtype=float))


def part(*terms, side: Side = "at least", margin: float = 0.0, label: str = "a setting") -> Part:
    return Part(label=label, terms=terms, side=side, margin=margin, unit="points")


def spec(*parts: Part, number: int = 1) -> ClaimSpec:
    return ClaimSpec(number=number, statement="It is so.", source="p. 1", test="t", parts=parts)


def verdict(*parts: Part) -> Claim:
    (claim,) = judge([spec(*parts)])
    return claim


def normal(seed: int, mean: float, size: int = 20, spread: float = 1.0) -> Trials:
    values = np.random.default_rng(seed).normal(mean, spread, size)
    return Trials(f"normal around {mean}", values)


# Intervals


def test_a_symmetric_interval_is_students():
    samples = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    low, high = interval_of_mean(samples, level=0.9)
    reference = scipy.stats.ttest_1samp(samples, 0).confidence_interval(0.9)
    assert (low, high) == pytest.approx((reference.low, reference.high))


def test_a_skewed_interval_reaches_further_towards_the_tail_than_students():
    samples = np.exp(np.random.default_rng(0).normal(size=20))
    low, high = interval_of_mean(samples)
    reference = scipy.stats.ttest_1samp(samples, 0).confidence_interval(0.95)
    assert low == pytest.approx(reference.low)
    assert high > reference.high + 0.5


@pytest.mark.parametrize("trials", [5, 6, 8, 20])
def test_intervals_of_few_skewed_trials_cover_the_mean(trials):
    rng = np.random.default_rng(2)
    samples = np.exp(0.5 * rng.normal(size=(trials, 4000))) - math.exp(0.125)
    low, high = interval_of_mean(samples)
    assert np.mean((low <= 0) & (high >= 0)) > 0.94  # percentiles of a bootstrap: 0.80 to 0.90


def test_trials_without_spread_have_an_interval_of_no_width():
    assert interval_of_mean(np.full(20, 99.0)) == (99.0, 99.0)
    assert interval_of_mean(np.array([0.1])) == (0.1, 0.1)


def test_every_column_has_an_interval_of_its_own():
    samples = np.random.default_rng(5).normal(size=(12, 7, 2))
    low, high = interval_of_mean(samples)
    assert low.shape == high.shape == (7, 2)
    assert (low[3, 1], high[3, 1]) == pytest.approx(interval_of_mean(samples[:, 3, 1]))


def test_an_interval_of_no_trial_is_refused():
    with pytest.raises(ValueError, match="at least one trial"):
        interval_of_mean(np.array([]))


def test_a_measured_mean_stands_beside_the_published_one():
    values = np.arange(6.0)
    cell = measured(Trials("a condition", values), published=5.0)
    assert (cell.value, cell.published, cell.bounds) == (2.5, 5.0, "interval")
    assert (cell.low, cell.high) == interval_of_mean(values)
    assert measured(Trials("a condition", None)) is None


def test_an_interval_ends_where_the_measure_does():
    values, within = np.array([0.7, 0.8, 0.9, 0.97, 1.0]), Support(low=0.0, high=1.0)
    assert measured(Trials("shares", values, within)).high == 1.0
    assert measured(Trials("numbers", values)).high > 1.0


@pytest.mark.parametrize("values", [[1, 4], [1, 2, 3, 4], [1, 1, 1, 1, 4], [1] * 7 + [4]])
def test_the_bounds_of_few_or_equal_trials_are_called_their_range(values):
    cell = measured(trials(*values))
    assert (cell.low, cell.high, cell.bounds) == (1.0, 4.0, "range")


# The test of a part, by hand and by law


def adopted(t: float, freedom: int) -> float:
    """The one-sided p-value of trials without skewness."""
    stretched = t / (1 + 37 / freedom**2 + 370 / freedom**4)
    return float(scipy.stats.t.sf(stretched, max(4, freedom / 3)))


def test_symmetric_trials_are_judged_by_a_stretched_t_of_a_heavier_tail():
    # Mean 3, variance 2.5: the error is the root of 2.5 / 5.
    claim = verdict(part((1.0, trials(1, 2, 3, 4, 5)), side="more than"))
    assert claim.p_value == pytest.approx(2 * adopted(3 / math.sqrt(0.5), 4))
    reach = (1 + 37 / 16 + 370 / 256) * scipy.stats.t.isf(0.025, 4) * math.sqrt(0.5)
    assert (claim.low, claim.high) == pytest.approx((3 - reach, 3 + reach))


def test_a_difference_has_welchs_error_and_the_freedom_of_its_smaller_side():
    # Variances of the means: 2.5 / 5, and 4.66... / 7 of the numbers 2 to 8 without their centre's.
    claim = verdict(part(*difference(trials(1, 2, 3, 4, 5), trials(2, 3, 4, 5, 6, 7, 8))))
    error = math.sqrt(2.5 / 5 + (28 / 6) / 7)
    assert claim.effect == pytest.approx(-2.0)
    assert claim.p_value == pytest.approx(min(1, 2 * adopted(2 / error, 4)))


def test_skewness_is_held_against_a_claim_as_by_halls_transformation():
    # About the mean 2: -1, -1, -1, -1, 4; second moment 4, third 12, variance 5; error 1.
    values = np.array([1.0, 1.0, 1.0, 1.0, 6.0]) + np.array([0.0, 1e-3, -1e-3, 0.0, 0.0])
    claim = verdict(part((1.0, Trials("skewed", values)), side="less than", margin=5.0))
    b, t = -2 * 12 / 5**2 / (4 / 5) ** 1.5, 3.0
    hall = t + b * t**2 / 3 + b**2 * t**3 / 27 + b / 6
    assert hall < t
    assert claim.p_value == pytest.approx(2 * adopted(hall, 4), rel=0.01)


def test_the_side_that_skewness_favours_is_judged_by_t():
    values = np.array([1.0, 1.2, 1.1, 1.3, 6.0])
    claim = verdict(part((1.0, Trials("skewed", values)), side="more than", margin=-20.0))
    t = (values.mean() + 20) / (values.std(ddof=1) / math.sqrt(5))
    assert claim.p_value == pytest.approx(2 * adopted(t, 4))


def test_equivalence_is_two_one_sided_tests():
    a = normal(4, 0.1, spread=0.7)
    claim = verdict(part((1.0, a), side="within", margin=0.8))
    above = verdict(part((1.0, a), side="more than", margin=-0.8))
    below = verdict(part((1.0, a), side="less than", margin=0.8))
    assert claim.p_value == max(above.p_value, below.p_value)
    assert claim.verdict == "confirmed"


@pytest.mark.parametrize(("mean", "expected"), [(0, "confirmed"), (3, "refuted"), (-3, "refuted")])
def test_equivalence_is_refuted_on_either_side(mean, expected):
    assert verdict(part((1.0, normal(5, mean)), side="within", margin=1.0)).verdict == expected


def test_no_difference_found_is_no_equivalence():
    a, b = normal(6, 0.0, size=6), normal(7, 0.0, size=6)
    assert verdict(part(*difference(a, b), side="within", margin=0.1)).verdict == "undecided"


def test_a_scaled_difference_states_a_relative_margin():
    less, more = normal(3, 89, spread=0.01), normal(4, 100, spread=0.01)
    assert verdict(part(*difference(less, more, scale=0.9))).verdict == "refuted"
    assert verdict(part(*difference(less, more, scale=0.88))).verdict == "confirmed"


def test_a_weight_stretches_the_interval_with_the_effect():
    plain, tripled = (verdict(part((weight, normal(9, 1.0)))) for weight in (1.0, 3.0))
    assert (tripled.low, tripled.high) == pytest.approx((3 * plain.low, 3 * plain.high))


def test_a_difference_of_differences_adds_four_variances():
    a, b, c, d = (normal(seed, mean) for seed, mean in ((1, 9.0), (2, 4.0), (3, 6.0), (4, 5.0)))
    lead = difference(a, b)
    other = [(-weight, term) for weight, term in difference(c, d)]
    claim = verdict(part(*lead, *other, side="more than"))
    assert claim.verdict == "confirmed"
    assert claim.effect == pytest.approx(
        a.values.mean() - b.values.mean() - c.values.mean() + d.values.mean()
    )


# Statistics that are no means


def test_contributions_to_a_mean_are_the_values_and_to_a_difference_those_about_the_means():
    a, b = np.array([1.0, 2.0, 6.0]), np.array([3.0, 5.0])
    (alone,) = jackknife_pseudovalues(np.mean, a)
    np.testing.assert_allclose(alone, a)
    first, second = jackknife_pseudovalues(lambda a, b: a.mean() - b.mean(), a, b)
    np.testing.assert_allclose(first, a - 4.0)
    np.testing.assert_allclose(second, [1.0, -1.0])


def test_contributions_to_a_product_of_means_are_those_worked_by_hand():
    # The product is 3 * 4 = 12; without a trial of the first, the mean is 4, 3.5 or 1.5.
    a, b = np.array([1.0, 2.0, 6.0]), np.array([3.0, 5.0])
    first, second = jackknife_pseudovalues(lambda a, b: a.mean() * b.mean(), a, b)
    np.testing.assert_allclose(first, 12 + 2 * (np.mean([16, 14, 6]) - [16, 14, 6]))
    np.testing.assert_allclose(second, [-3.0, 3.0])
    assert first.mean() + second.mean() == pytest.approx(12)


def test_a_part_of_contributions_has_the_error_of_the_statistic():
    """The mean distance between runs: every run is in many pairs, and its error is the double."""

    def between(values):
        return np.abs(values[:, None] - values).sum() / (len(values) * (len(values) - 1))

    rng, found, errors = np.random.default_rng(0), [], []
    for _ in range(400):
        values = rng.normal(size=25)
        (each,) = jackknife_pseudovalues(between, values)
        found.append(each.mean())
        errors.append(each.std(ddof=1) / 5)
    assert np.mean(errors) == pytest.approx(np.std(found), rel=0.1)


def test_rows_of_a_sample_are_left_out_whole():
    rows = np.arange(12.0).reshape(4, 3)
    (found,) = jackknife_pseudovalues(lambda rows: rows.mean(), rows)
    np.testing.assert_allclose(found, rows.mean(1))


# Effects without spread

EXACT = Support(exact=True)


def exactly(value: float) -> Trials:
    return Trials("no spread can be", np.full(5, value), EXACT)


@pytest.mark.parametrize(
    ("side", "at_the_margin"),
    [
        ("at least", "confirmed"),
        ("more than", "refuted"),
        ("at most", "confirmed"),
        ("less than", "refuted"),
        ("within", "confirmed"),
    ],
)
def test_a_certain_effect_at_the_margin_holds_unless_the_claim_is_strict(side, at_the_margin):
    claim = verdict(part((1.0, exactly(0.3)), (-1.0, exactly(0.1)), side=side, margin=0.2))
    assert claim.verdict == at_the_margin  # although 0.3 - 0.1 is not 0.2 in floating point
    assert claim.low == claim.effect == claim.high == pytest.approx(0.2)
    assert 0 < claim.p_value < 1e-90


@pytest.mark.parametrize(("value", "expected"), [(2.0, "confirmed"), (-2.0, "refuted")])
def test_a_certain_effect_off_the_margin_decides(value, expected):
    assert verdict(part((1.0, exactly(value)))).verdict == expected


@pytest.mark.parametrize("margin", [2.0, -2.0])
def test_equal_trials_of_a_measure_without_bounds_decide_nothing(margin):
    claim = verdict(part((1.0, trials(*[0.0] * 20, name="a cost")), margin=margin))
    assert (claim.verdict, claim.low, claim.high) == ("undecided", -math.inf, math.inf)
    assert "no spread in 20 trials: a cost" in claim.note


def test_equal_trials_are_bounded_by_what_they_may_not_have_shown():
    # Of outcomes other than 99, of 0 at the worst, up to 1 - 0.025^(1/20) have stayed unseen.
    earned = Trials("earned", np.full(20, 99.0), Support(low=0.0, high=99.0))
    claim = verdict(part((1.0, earned), margin=50.0))
    assert claim.low == pytest.approx(99 * 0.025 ** (1 / 20))
    assert claim.high == 99.0
    # Zero to forty-nine 99ths of the trials would have to be others: p = (50 / 99)^20.
    assert claim.p_value == pytest.approx(2 * (50 / 99) ** 20)
    assert claim.verdict == "confirmed"


@pytest.mark.parametrize("size", [5, 8, 20])
def test_what_is_rarely_otherwise_is_hardly_ever_taken_as_certain(size):
    """Of trials that earn 99, in 5% of cases 50, the mean is 96.55: it is not above 97.02."""
    rng, confirmed, refuted = np.random.default_rng(size), 0, 0
    for _ in range(200):
        rare = rng.random(size) < 0.05
        earned = Trials("earned", np.where(rare, 50.0, 99.0), Support(low=0.0, high=99.0))
        lost = Trials("lost", np.where(rare, 49.0, 0.0), Support(low=0.0, high=99.0))
        confirmed += verdict(part((1.0, earned), side="more than", margin=97.02)).verdict == (
            "confirmed"
        )
        refuted += verdict(part((1.0, lost), margin=1.98)).verdict == "refuted"
    assert max(confirmed, refuted) <= 10  # 0.05 of 200; they were 154 to 72


def test_nearly_equal_trials_are_bounded_as_equal_ones_are():
    values = np.array([99.0] * 17 + [98.9, 98.8, 98.9])
    wary = verdict(part((1.0, Trials("earned", values, Support(low=0.0, high=99.0))), margin=97.02))
    assert wary.verdict == "undecided"
    assert wary.note.startswith("hardly any spread in 20 trials: earned")


def test_one_condition_without_spread_leaves_the_other_ones_test():
    a, flat = normal(8, 5.0), Trials("four", np.full(20, 4.0), EXACT)
    claim, alone = verdict(part(*difference(a, flat))), verdict(part((1.0, a)))
    assert (claim.low, claim.high) == pytest.approx((alone.low - 4.0, alone.high - 4.0))


# Trials at the cap of their measure

STEPS = Support(low=2.0, high=11.0, capped=True)  # 11: not within the ten that were shown


def steps(*values: float) -> Trials:
    return Trials("steps", np.array(values, float), STEPS)


def test_a_censored_trial_may_be_anywhere_beyond_its_cap():
    never = steps(3, 4, 11, 11, 11, 5, 11, 4)
    claim = verdict(part((1.0, never), side="at most", margin=30.0))
    assert (claim.verdict, claim.high) == ("undecided", math.inf)
    assert "4 of 8 trials at the cap: steps" in claim.note
    assert verdict(part((1.0, never), side="more than", margin=-50.0)).verdict == "confirmed"


def test_a_censored_condition_can_still_be_the_later_one():
    early, late = normal(1, 3.0, spread=0.1), steps(*[11.0, 10.0] * 10)
    assert verdict(part(*difference(early, late), side="less than")).verdict == "confirmed"
    assert verdict(part(*difference(early, late), side="at least")).verdict == "refuted"
    assert verdict(part(*difference(early, late), side="at least", margin=-100.0)).verdict == (
        "undecided"
    )


def test_two_trials_at_a_cap_refute_nothing():
    claim = verdict(part((1.0, steps(11, 11)), side="at most", margin=10.0))
    assert (claim.verdict, claim.p_value, claim.effect) == ("undecided", None, 11.0)


# Claims of several parts


def test_a_claim_needs_every_part_and_rests_on_the_weakest():
    strong, weak = (
        part((1.0, normal(1, 9.0)), label="easy"),
        part((1.0, normal(2, 1.5)), label="hard"),
    )
    claim = verdict(strong, weak)
    assert claim.verdict == "confirmed"
    assert claim.note == "rests on: hard"
    alone = verdict(weak)
    assert claim.p_value == alone.p_value
    assert claim.low == alone.low  # towards the margin: only the truly weakest part errs there
    assert claim.high > alone.high  # either part may be the one whose interval is shown
    assert claim.compared == "hard"


def test_the_interval_of_a_confirmed_claim_covers_the_part_that_it_shows():
    rng, held = np.random.default_rng(3), 0
    for _ in range(100):
        draws = (Trials("one of eight", 20.0 + rng.normal(size=8)) for _ in range(8))
        claim = verdict(*(part((1.0, each)) for each in draws))
        assert claim.verdict == "confirmed"
        held += claim.low <= 20.0 <= claim.high
    assert held >= 95


def test_the_interval_of_an_effect_ends_where_its_measures_do():
    within = Support(low=0.0, high=1.0)
    one = Trials("one", np.array([0.7, 0.8, 0.9, 0.97, 1.0]), within)
    other = Trials("other", np.array([0.0, 0.02, 0.1, 0.2, 0.3]), within)
    found = verdict(part((1.0, one), (-2.0, other), margin=0.0))
    assert (found.low, found.high) == (-2.0, 1.0)


def test_the_far_end_of_a_match_stays_within_the_margin():
    claim = verdict(
        *(part((1.0, normal(n, 0.4, spread=0.05)), side="within", margin=1.2) for n in range(6))
    )
    assert claim.verdict == "confirmed"
    assert -1.2 <= claim.low < claim.high < 1.2


def test_one_counter_example_refutes_a_claim_at_a_price():
    holds, fails = (
        part((1.0, normal(1, 9.0)), label="here"),
        part((1.0, normal(2, -2.0)), label="there"),
    )
    claim = verdict(holds, fails, holds)
    alone = verdict(fails)
    assert claim.verdict == "refuted"
    assert claim.note == "rests on: there"
    assert claim.p_value == pytest.approx(3 * alone.p_value)
    assert claim.low < alone.low < alone.high < claim.high < 0


def test_a_part_in_doubt_leaves_the_claim_undecided():
    doubtful = part((1.0, trials(-1, 1, -2, 2, 0.1)), label="in doubt")
    claim = verdict(part((1.0, normal(1, 9.0))), doubtful)
    assert claim.verdict == "undecided"
    assert claim.note == "rests on: in doubt; leans towards the claim"
    assert claim.low < 0 < claim.high


@pytest.mark.parametrize("side", ["at least", "at most"])
def test_an_undecided_claim_says_about_how_many_trials_would_decide_it(side):
    few = normal(3, 0.3, size=8)
    note = verdict(part((1.0, few), side=side)).note
    more = int(re.fullmatch(r"leans .*; about (\d+) trials in place of 8 would .*", note)[1])

    def decided(copies):  # the same effect and spread, all but for the n - 1 of a variance
        many = Trials("many", np.tile(few.values, copies))
        return verdict(part((1.0, many), side=side)).verdict != "undecided"

    assert decided(round(1.2 * more / 8))
    assert not decided(round(0.8 * more / 8))


def test_a_term_that_counts_for_nothing_leaves_the_bounds_as_they_are():
    alone = (1.0, Trials("measured", np.arange(8.0), Support(low=0.0)))
    nothing = (0.0, Trials("without bounds", np.ones(8)))
    claim, other = verdict(part(alone, nothing)), verdict(part(alone))
    assert (claim.low, claim.high, claim.p_value) == (other.low, other.high, other.p_value)
    assert claim.low >= 0


def test_where_more_trials_would_not_decide_it_none_are_named():
    at_the_margin = verdict(part((1.0, trials(-1, 1, -2, 2, 1e-6))))
    capped = Trials("capped", np.full(9, 5.0), Support(high=5.0, capped=True))
    too_few = verdict(part((1.0, trials(1.0, 2.0, 3.0))))
    for claim in (at_the_margin, verdict(part((1.0, capped), side="less than", margin=9)), too_few):
        assert claim.verdict == "undecided"
        assert "would decide" not in claim.note


# What cannot be tested


def test_a_missing_condition_is_not_run_and_named_once():
    absent = Trials("random, mixed", None)
    empty = Trials("none, mixed", np.array([]))
    claim = verdict(part(*difference(normal(1, 0), absent)), part(*difference(absent, empty)))
    assert claim.verdict == "not run"
    assert claim.note == "not run: random, mixed; none, mixed"
    assert claim.effect is claim.low is claim.high is claim.p_value is None


@pytest.mark.parametrize(
    ("mean", "expected", "note"),
    [
        (2.5, "undecided", "not run: elsewhere; rests on: here; leans towards the claim"),
        (-2.5, "refuted", "rests on: here"),
    ],
)
def test_a_claim_run_in_part_can_be_refuted_and_not_confirmed(mean, expected, note):
    here = part((1.0, normal(1, mean)), label="here")
    elsewhere = part(*difference(normal(2, 0), Trials("elsewhere", None)))
    claim, alone = verdict(elsewhere, here), verdict(here)
    assert alone.verdict != "undecided"
    assert claim == dataclasses.replace(alone, verdict=expected, note=note, parts=claim.parts)
    missing, tested = claim.parts
    assert (missing.effect, missing.low, missing.note) == (None, None, "not run: elsewhere")
    assert (tested.compared, tested.effect, tested.note) == ("here", alone.effect, "")
    assert alone.parts == ()


def test_a_claim_run_in_part_shows_the_weakest_part_and_counts_what_was_not_run():
    absent = [part((1.0, Trials(f"place {number}", None))) for number in range(5)]
    strong, weak = (part((1.0, normal(1, mean)), label=f"{mean}") for mean in (9.0, 0.1))
    claim = verdict(*absent, strong, weak)
    assert claim.verdict == "undecided"
    lack = "not run: place 0; place 1; place 2; and 2 more"
    assert claim.note == f"{lack}; rests on: 0.1; leans towards the claim"
    assert (claim.effect, claim.p_value) == (verdict(weak).effect, verdict(strong, weak).p_value)


def test_a_claim_run_in_part_says_what_forbids_the_test_of_the_rest():
    claim = verdict(part((1.0, trials(1.0, name="one"))), part((1.0, Trials("absent", None))))
    assert (claim.verdict, claim.effect) == ("undecided", 1.0)
    few = "1 trial, fewer than five: one"
    assert claim.note == f"not run: absent; rests on: a setting; {few}; leans towards the claim"


def test_a_claim_that_was_not_run_takes_no_share_of_the_correction():
    tested = spec(part((1.0, normal(1, 1.0))), number=2)
    absent = spec(part((1.0, Trials("absent", None))), number=1)
    first, second = judge([absent, tested])
    assert (first.number, second.number) == (1, 2)
    assert second == judge([tested])[0]


@pytest.mark.parametrize("size", [1, 2, 4])
def test_fewer_than_five_trials_leave_a_claim_undecided(size):
    few = Trials("the few", 1.0 + np.arange(size) / 100)
    claim = verdict(part(*difference(normal(1, 9.0), few)))
    assert (claim.verdict, claim.p_value, claim.low, claim.high) == ("undecided", None, None, None)
    assert claim.effect == pytest.approx(normal(1, 9.0).mean - few.mean)
    some = f"{size} trial{'s' * (size > 1)}, fewer than five: the few"
    assert claim.note == f"{some}; leans towards the claim"


def test_a_claim_of_too_few_trials_takes_no_share_of_the_correction():
    tested, few = spec(part((1.0, normal(1, 1.0))), number=2), spec(part((1.0, trials(1, 2))))
    assert judge([few, tested])[1] == judge([tested])[0]


def test_trials_without_a_value_leave_a_claim_undecided():
    claim = verdict(part((1.0, trials(1, math.nan, 3, math.inf, name="gaps"))))
    assert claim.verdict == "undecided"
    assert claim.note == "2 of 4 trials have no value: gaps"  # and so no side to lean to


def test_a_claim_refuted_elsewhere_does_not_need_the_part_that_cannot_be_tested():
    claim = verdict(part((1.0, trials(1.0))), part((1.0, normal(1, -9.0)), label="there"))
    assert (claim.verdict, claim.note) == ("refuted", "rests on: there")


@pytest.mark.parametrize("mean", [9.0, -9.0])
def test_a_reservation_withholds_the_verdict_and_nothing_else(mean):
    one = part((1.0, normal(1, mean)), label="here"), part((1.0, normal(2, mean)), label="there")
    plain = spec(*one)
    reserved = dataclasses.replace(plain, reservation="trained for too short a time")
    (decided,), (withheld,) = judge([plain]), judge([reserved])
    assert decided.verdict != "undecided"
    leans = "towards the claim" if mean > 0 else "against the claim in 2 of 2 parts"
    note = f"trained for too short a time; {decided.note}; leans {leans}"
    assert withheld == dataclasses.replace(decided, verdict="undecided", note=note)


def test_a_claim_that_needs_more_than_was_run_is_decided_neither_way():
    needs = [
        Need(verb="trained for", unit="episodes", needed=20_000, run=4_000),
        Need(verb="evolved for", unit="generations", needed=200, run=200),
        Need(verb="simulated for", unit="steps", needed=100, run=50),
        Need(verb="watched for", unit="episodes", needed=100, run=None),
    ]
    short = dataclasses.replace(spec(part((1.0, normal(1, 9.0)))), needs=tuple(needs))
    (claim,) = judge([short])
    assert claim.verdict == "undecided"
    assert claim.note == (
        "trained for 4 000 of the 20 000 episodes and simulated for 50 of the 100 steps that the "
        "claim speaks of; leans towards the claim"
    )
    (met,) = judge([dataclasses.replace(short, needs=(needs[1], needs[3]))])
    assert met.verdict == "confirmed"


def test_a_claim_shows_its_margin_and_brings_its_history():
    change = Revision(date="2026-01-02", change="A margin.", reason="It was none.", known="All.")
    stated = dataclasses.replace(
        spec(part((1.0, normal(1, 9.0)), side="more than", margin=2.5, label="a - b")),
        stated="2026-01-01",
        history=(change,),
        depends_on=("another measure",),
    )
    (claim,) = judge([stated])
    assert (claim.side, claim.margin, claim.compared) == ("more than", 2.5, "a - b")
    assert (claim.stated, claim.history) == ("2026-01-01", (change,))
    assert claim.depends_on == ("another measure",)


def test_a_spec_that_states_nothing_testable_is_refused():
    with pytest.raises(ValueError, match="at least one condition"):
        part()
    with pytest.raises(ValueError, match="within the margin -1"):
        part((1.0, trials(1, 2)), side="within", margin=-1.0)
    with pytest.raises(ValueError, match="claim 1 has no part"):
        spec()
    with pytest.raises(ValueError, match=r"one number per trial, not shape \(2, 2\)"):
        Trials("a table", np.ones((2, 2)))


# The family


def test_holms_correction_is_the_one_worked_by_hand():
    corrected = holm([0.01, 0.04, 0.03, 0.005])
    assert [one.p_value for one in corrected] == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert [one.rejected for one in corrected] == [True, False, False, True]
    assert [one.level for one in corrected] == pytest.approx([0.05 / 3, 0.025, 0.025, 0.05 / 4])
    assert holm([]) == []


samples = st.lists(st.integers(-40, 40).map(lambda tenths: tenths / 10), min_size=3, max_size=9)
supports = st.sampled_from(
    [Support(), Support(low=-4.0, high=4.0), Support(low=-4.0, high=4.0, capped=True), EXACT]
)
drawn = st.builds(
    lambda values, support: Trials("drawn", np.array(values), support), samples, supports
)
terms = st.tuples(st.sampled_from([1.0, -1.0, -0.9]), drawn)
parts = st.builds(
    Part,
    label=st.just("a setting"),
    terms=st.lists(terms, min_size=1, max_size=2).map(tuple),
    side=st.sampled_from(SIDES),
    margin=st.sampled_from([0.0, 0.5, 2.0]),
    unit=st.just("points"),
)
families = st.lists(st.lists(parts, min_size=1, max_size=3), min_size=1, max_size=4)


def lies(low: float, high: float, one: Part) -> str:
    """Where an interval lies relative to what a part claims."""
    bottom = one.margin if one.side in ("at least", "more than") else -math.inf
    top = one.margin if one.side in ("at most", "less than") else math.inf
    if one.side == "within":
        bottom, top = -one.margin, one.margin
    strict = one.side in ("more than", "less than")
    slack = 1e-12 if strict else -1e-12  # an effect that cannot spread may be on the margin
    if bottom + slack < low and high < top - slack:
        return "confirmed"
    return "refuted" if high < bottom + slack or top - slack < low else "undecided"


@given(families)
def test_a_verdict_is_a_decision_exactly_when_the_reported_interval_lies_on_one_side(family):
    labelled = [
        [Part(**{**vars(one), "label": str(index)}) for index, one in enumerate(claim)]
        for claim in family
    ]
    claims = judge([spec(*claim, number=number) for number, claim in enumerate(labelled)])
    for claim, stated in zip(claims, labelled, strict=True):
        if claim.p_value is None:  # too few trials everywhere
            assert (claim.verdict, claim.low) == ("undecided", None)
            continue
        assert claim.p_value > 0
        assume(abs(claim.p_value - FAMILY_ERROR) > 1e-9)  # closer, the last bit decides
        decided = claim.verdict in ("confirmed", "refuted")
        assert decided == (claim.p_value < FAMILY_ERROR)
        if claim.low is None:
            assert claim.verdict == "undecided"
            continue
        assert lies(claim.low, claim.high, stated[int(claim.compared)]) == claim.verdict


@given(families)
def test_more_claims_never_turn_a_doubt_into_a_decision(family):
    for number, claim in enumerate(judge([spec(*one, number=n) for n, one in enumerate(family)])):
        alone = verdict(*family[number])
        assert (claim.p_value or 1) >= (alone.p_value or 0)
        assert claim.verdict in (alone.verdict, "undecided")


@given(families)
def test_a_part_that_was_not_run_takes_away_a_confirmation_and_nothing_else(family):
    absent = part((1.0, Trials("elsewhere", None)))
    whole = judge([spec(*one, number=n) for n, one in enumerate(family)])
    partly = judge([spec(*one, absent, number=n) for n, one in enumerate(family)])
    for one, other in zip(whole, partly, strict=True):
        expected = "undecided" if one.verdict == "confirmed" else one.verdict
        assert other == dataclasses.replace(
            one, verdict=expected, note=other.note, parts=other.parts
        )
        assert ("not run: elsewhere" in other.note) == (expected == "undecided")


def simulations():
    """The benchmark that simulates studies, as a module."""
    path = Path(__file__).parents[2] / "benchmarks" / "verdicts.py"
    described = importlib.util.spec_from_file_location("verdict_simulations", path)
    module = importlib.util.module_from_spec(described)
    described.loader.exec_module(module)
    return module


@pytest.mark.parametrize(("shape", "size"), [("normal", 5), ("lognormal, sigma 1", 8)])
def test_few_studies_hold_a_wrong_verdict(shape, size):
    assert simulations().family_error(shape, size, studies=100, seed=11) <= 0.1


@pytest.mark.slow
@pytest.mark.parametrize("size", [5, 6, 8, 20])
def test_no_more_studies_than_promised_hold_a_wrong_verdict(size):
    found = simulations()
    for shape in found.SHAPES:
        error = found.family_error(shape, size, studies=400, seed=12)
        assert error < FAMILY_ERROR + 3 * math.sqrt(0.05 * 0.95 / 400), shape


@pytest.mark.slow
def test_what_is_far_from_its_margin_is_decided():
    found = simulations()
    assert found.power("normal", 20, 2.0, studies=50, seed=0) > 0.8
    assert found.power("lognormal, sigma 1", 20, 5.0, studies=50, seed=0) > 0.9
    assert found.power("normal", 8, 10.0, studies=50, seed=0) > 0.9  # of five trials 0.43 is left
