import dataclasses
import math

import hypothesis.strategies as st
import numpy as np
import pytest
import scipy.stats
from hypothesis import assume, given

from ethogram.core.findings import Claim
from ethogram.studies.statistics import (
    FAMILY_ERROR,
    ClaimSpec,
    Part,
    Side,
    Trials,
    bootstrap_interval,
    contributions,
    difference,
    holm,
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


# Intervals by bootstrap


def test_the_bootstrap_interval_of_a_mean_is_near_the_one_of_normal_theory():
    samples = np.random.default_rng(1).normal(5.0, 2.0, 400)
    interval = bootstrap_interval(samples, resamples=4000)
    error = samples.std(ddof=1) / math.sqrt(samples.size)
    np.testing.assert_allclose(
        interval, samples.mean() + 1.96 * error * np.array([-1, 1]), rtol=5e-3
    )


def test_the_bootstrap_covers_the_true_mean_as_often_as_its_level_says():
    rng = np.random.default_rng(2)
    samples = rng.normal(0.0, 1.0, (20, 600))  # 600 experiments of 20 trials, on the second axis
    low, high = bootstrap_interval(samples, level=0.9, resamples=500)
    coverage = np.mean((low <= 0) & (high >= 0))
    assert 0.84 < coverage < 0.92  # a percentile interval of 20 trials is known to be a bit short


def test_trials_without_spread_have_an_interval_of_no_width():
    assert bootstrap_interval(np.full(20, 99.0)) == (99.0, 99.0)
    assert bootstrap_interval(np.array([0.1])) == (0.1, 0.1)


def test_the_bootstrap_repeats_itself_and_follows_its_seed():
    samples = np.arange(10.0)
    assert bootstrap_interval(samples, seed=3) == bootstrap_interval(samples, seed=3)
    assert bootstrap_interval(samples, seed=3) != bootstrap_interval(samples, seed=4)


def test_every_column_is_resampled_with_the_trial_that_it_belongs_to():
    samples = np.random.default_rng(5).normal(size=(12, 7, 2))
    low, high = bootstrap_interval(samples, np.median)
    assert low.shape == high.shape == (7, 2)
    np.testing.assert_array_equal(low[3, 1], bootstrap_interval(samples[:, 3, 1], np.median).low)


def test_resampling_in_blocks_changes_nothing():
    wide = np.random.default_rng(6).normal(size=(20, 500))  # 20 million numbers: several blocks
    low, high = bootstrap_interval(wide)
    few = bootstrap_interval(wide[:, :2])
    np.testing.assert_allclose(low[:2], few.low, rtol=1e-12)
    np.testing.assert_allclose(high[:2], few.high, rtol=1e-12)


def test_an_interval_of_no_trial_is_refused():
    with pytest.raises(ValueError, match="at least one trial"):
        bootstrap_interval(np.array([]))


def test_a_measured_statistic_is_that_of_the_trials_beside_the_published_one():
    values = np.array([1.0, 2.0, 6.0])
    cell = measured(Trials("a condition", values), np.max, published=5.0)
    assert (cell.value, cell.high, cell.published) == (6.0, 6.0, 5.0)
    assert measured(Trials("a condition", values)).low == bootstrap_interval(values).low
    assert measured(Trials("a condition", None)) is None


# The test of a part, against SciPy and by hand


def test_a_difference_is_judged_as_by_scipys_welch_test():
    a, b = normal(1, 10.0, size=20), normal(2, 8.8, size=15, spread=3.0)
    claim = verdict(part(*difference(a, b), side="more than"))
    reference = scipy.stats.ttest_ind(a.values, b.values, equal_var=False)
    interval = reference.confidence_interval(0.95)
    assert claim.p_value == pytest.approx(reference.pvalue)
    assert (claim.low, claim.high) == pytest.approx((interval.low, interval.high))


def test_one_condition_is_judged_as_by_scipys_one_sample_test():
    a = normal(3, 4.0)
    claim = verdict(part((1.0, a), side="at most", margin=4.5))
    reference = scipy.stats.ttest_1samp(a.values, 4.5)
    interval = reference.confidence_interval(0.95)
    assert claim.p_value == pytest.approx(reference.pvalue)
    assert (claim.low, claim.high) == pytest.approx((interval.low, interval.high))


def test_welchs_error_and_freedom_are_those_worked_by_hand():
    # Variances 1/3 and 4/3 add up to 5/3; freedom (5/3)^2 / ((1/3)^2 / 2 + (4/3)^2 / 2) = 50/17.
    claim = verdict(part(*difference(trials(1, 2, 3), trials(2, 4, 6)), side="less than"))
    assert claim.effect == pytest.approx(-2.0)
    reach = scipy.stats.t.ppf(0.975, 50 / 17) * math.sqrt(5 / 3)
    assert (claim.low, claim.high) == pytest.approx((-2.0 - reach, -2.0 + reach))
    assert claim.p_value == pytest.approx(2 * scipy.stats.t.sf(2.0 / math.sqrt(5 / 3), 50 / 17))


def test_equivalence_is_two_one_sided_tests():
    a = normal(4, 0.1)
    claim = verdict(part((1.0, a), side="within", margin=0.8))
    one_sided = max(
        scipy.stats.ttest_1samp(a.values, -0.8, alternative="greater").pvalue,
        scipy.stats.ttest_1samp(a.values, 0.8, alternative="less").pvalue,
    )
    assert claim.p_value == pytest.approx(2 * one_sided)
    assert claim.verdict == "confirmed"


@pytest.mark.parametrize(("mean", "expected"), [(0, "confirmed"), (3, "refuted"), (-3, "refuted")])
def test_equivalence_is_refuted_on_either_side(mean, expected):
    assert verdict(part((1.0, normal(5, mean)), side="within", margin=1.0)).verdict == expected


def test_no_difference_found_is_no_equivalence():
    a, b = normal(6, 0.0, size=3), normal(7, 0.0, size=3)
    assert verdict(part(*difference(a, b), side="within", margin=0.1)).verdict == "undecided"


def test_a_scaled_difference_states_a_relative_margin():
    less, more = trials(89, 89, 89), trials(100, 100, 100)
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
    (alone,) = contributions(np.mean, a)
    np.testing.assert_allclose(alone, a)
    first, second = contributions(lambda a, b: a.mean() - b.mean(), a, b)
    np.testing.assert_allclose(first, a - 4.0)
    np.testing.assert_allclose(second, [1.0, -1.0])


def test_contributions_to_a_product_of_means_are_those_worked_by_hand():
    # The product is 3 * 4 = 12; without a trial of the first, the mean is 4, 3.5 or 1.5.
    a, b = np.array([1.0, 2.0, 6.0]), np.array([3.0, 5.0])
    first, second = contributions(lambda a, b: a.mean() * b.mean(), a, b)
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
        (each,) = contributions(between, values)
        found.append(each.mean())
        errors.append(each.std(ddof=1) / 5)
    assert np.mean(errors) == pytest.approx(np.std(found), rel=0.1)


def test_rows_of_a_sample_are_left_out_whole():
    rows = np.arange(12.0).reshape(4, 3)
    (found,) = contributions(lambda rows: rows.mean(), rows)
    np.testing.assert_allclose(found, rows.mean(1))


# Effects without spread


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
    claim = verdict(part((1.0, trials(0.3, 0.3)), (-1.0, trials(0.1, 0.1)), side=side, margin=0.2))
    assert claim.verdict == at_the_margin  # although 0.3 - 0.1 is not 0.2 in floating point
    assert claim.low == claim.effect == claim.high == 0.2
    assert claim.p_value == 0.0


@pytest.mark.parametrize(("value", "expected"), [(2.0, "confirmed"), (-2.0, "refuted")])
def test_a_certain_effect_off_the_margin_decides(value, expected):
    assert verdict(part((1.0, trials(value, value)))).verdict == expected


def test_one_condition_without_spread_leaves_the_other_ones_freedom():
    a = normal(8, 5.0)
    claim = verdict(part(*difference(a, trials(4, 4, 4))))
    reference = scipy.stats.ttest_1samp(a.values, 4.0).confidence_interval(0.95)
    assert (claim.low, claim.high) == pytest.approx((reference.low - 4.0, reference.high - 4.0))


# Claims of several parts


def test_a_claim_needs_every_part_and_rests_on_the_weakest():
    strong, weak = (
        part((1.0, normal(1, 9.0)), label="easy"),
        part((1.0, normal(2, 1.5)), label="hard"),
    )
    claim = verdict(strong, weak)
    assert claim.verdict == "confirmed"
    assert claim.note == "rests on: hard"
    assert claim.p_value == verdict(weak).p_value
    assert (claim.low, claim.high) == (verdict(weak).low, verdict(weak).high)


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
    claim = verdict(part((1.0, normal(1, 9.0))), part((1.0, trials(-1, 1)), label="in doubt"))
    assert claim.verdict == "undecided"
    assert claim.note == "rests on: in doubt"
    assert claim.low < 0 < claim.high


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
        (1.5, "undecided", "not run: elsewhere; rests on: here"),
        (-1.5, "refuted", "rests on: here"),
    ],
)
def test_a_claim_run_in_part_can_be_refuted_and_not_confirmed(mean, expected, note):
    here = part((1.0, normal(1, mean)), label="here")
    elsewhere = part(*difference(normal(2, 0), Trials("elsewhere", None)))
    claim, alone = verdict(elsewhere, here), verdict(here)
    assert alone.verdict != "undecided"
    assert claim == dataclasses.replace(alone, verdict=expected, note=note)


def test_a_claim_run_in_part_shows_the_weakest_part_and_counts_what_was_not_run():
    absent = [part((1.0, Trials(f"place {number}", None))) for number in range(5)]
    strong, weak = (part((1.0, normal(1, mean)), label=f"{mean}") for mean in (9.0, 0.1))
    claim = verdict(*absent, strong, weak)
    assert claim.verdict == "undecided"
    assert claim.note == "not run: place 0; place 1; place 2; and 2 more; rests on: 0.1"
    assert (claim.effect, claim.p_value) == (verdict(weak).effect, verdict(strong, weak).p_value)


def test_a_claim_run_in_part_says_what_forbids_the_test_of_the_rest():
    claim = verdict(part((1.0, trials(1.0, name="one"))), part((1.0, Trials("absent", None))))
    assert (claim.verdict, claim.effect) == ("undecided", None)
    assert claim.note == "not run: absent; rests on: a setting; fewer than two trials: one"


def test_a_claim_that_was_not_run_takes_no_share_of_the_correction():
    tested = spec(part((1.0, normal(1, 1.0))), number=2)
    absent = spec(part((1.0, Trials("absent", None))), number=1)
    first, second = judge([absent, tested])
    assert (first.number, second.number) == (1, 2)
    assert second == judge([tested])[0]


def test_fewer_than_two_trials_leave_a_claim_undecided():
    claim = verdict(part(*difference(normal(1, 9.0), trials(1.0, name="the single one"))))
    assert (claim.verdict, claim.effect, claim.low) == ("undecided", None, None)
    assert claim.note == "fewer than two trials: the single one"


def test_trials_without_a_value_leave_a_claim_undecided():
    claim = verdict(part((1.0, trials(1, math.nan, 3, math.inf, name="gaps"))))
    assert claim.verdict == "undecided"
    assert claim.note == "2 of 4 trials have no value: gaps"


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
    note = f"trained for too short a time; {decided.note}"
    assert withheld == dataclasses.replace(decided, verdict="undecided", note=note)


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


samples = st.lists(st.integers(-40, 40).map(lambda tenths: tenths / 10), min_size=1, max_size=6)
terms = st.tuples(st.sampled_from([1.0, -1.0, -0.9]), samples.map(lambda values: trials(*values)))
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
    if (bottom < low and high < top) if strict else (bottom <= low and high <= top):
        return "confirmed"
    if (high <= bottom or top <= low) if strict else (high < bottom or top < low):
        return "refuted"
    return "undecided"


@given(families)
def test_a_verdict_is_a_decision_exactly_when_the_reported_interval_lies_on_one_side(family):
    labelled = [
        [Part(**{**vars(one), "label": str(index)}) for index, one in enumerate(claim)]
        for claim in family
    ]
    claims = judge([spec(*claim, number=number) for number, claim in enumerate(labelled)])
    for claim, stated in zip(claims, labelled, strict=True):
        assert claim.p_value is not None
        assume(abs(claim.p_value - FAMILY_ERROR) > 1e-9)  # closer, the last bit decides
        decided = claim.verdict in ("confirmed", "refuted")
        assert decided == (claim.p_value < FAMILY_ERROR)
        if claim.low is None:
            assert claim.verdict == "undecided"
            continue
        where = {str(i): lies(claim.low, claim.high, one) for i, one in enumerate(stated)}
        rests_on = claim.note.removeprefix("rests on: ") or "0"
        assert where[rests_on] == claim.verdict


@given(families)
def test_more_claims_never_turn_a_doubt_into_a_decision(family):
    for number, claim in enumerate(judge([spec(*one, number=n) for n, one in enumerate(family)])):
        alone = verdict(*family[number])
        assert claim.p_value >= alone.p_value
        assert claim.verdict in (alone.verdict, "undecided")


@given(families)
def test_a_part_that_was_not_run_takes_away_a_confirmation_and_nothing_else(family):
    absent = part((1.0, Trials("elsewhere", None)))
    whole = judge([spec(*one, number=n) for n, one in enumerate(family)])
    partly = judge([spec(*one, absent, number=n) for n, one in enumerate(family)])
    for one, other in zip(whole, partly, strict=True):
        expected = "undecided" if one.verdict == "confirmed" else one.verdict
        assert other == dataclasses.replace(one, verdict=expected, note=other.note)
        assert ("not run: elsewhere" in other.note) == (expected == "undecided")


def wrong_verdicts(repetitions: int) -> float:
    """Share of studies with a wrong verdict, where every truth lies at, or just off, its margin."""
    rng = np.random.default_rng(11)
    wrong = 0
    for _ in range(repetitions):
        draws = iter(rng.normal(0.0, rng.uniform(0.5, 3.0, (12, 1)), (12, 20)))
        one = [Trials("null", next(draws)) for _ in range(12)]
        claims = judge(
            [
                spec(part(*difference(one[0], one[1]), side="more than"), number=1),
                spec(part(*difference(one[2], one[3]), side="less than"), number=2),
                spec(part(*difference(one[4], one[5])), part((1.0, one[6])), number=3),
                spec(part((1.0, one[7]), side="within", margin=0.0), number=4),
                spec(part((1.0, one[8])), part((1.0, one[9])), part((1.0, one[10])), number=5),
                spec(part((1.0, one[11]), side="at most"), number=6),
            ]
        )
        # Every mean is zero: the strict claims are false and all others true.
        errors = ["confirmed", "confirmed", "refuted", "refuted", "refuted", "refuted"]
        wrong += any(c.verdict == error for c, error in zip(claims, errors, strict=True))
    return wrong / repetitions


def test_few_studies_hold_a_wrong_verdict():
    assert wrong_verdicts(200) < 0.1  # 0.05 and more than three standard errors


@pytest.mark.slow
def test_no_more_studies_than_promised_hold_a_wrong_verdict():
    assert wrong_verdicts(4000) < FAMILY_ERROR + 3 * math.sqrt(0.05 * 0.95 / 4000)
