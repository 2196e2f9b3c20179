import numpy as np
import pytest
import xarray as xr

from ethogram.core.findings import Measured
from ethogram.studies.language import results as measure
from ethogram.studies.language.claims import claims
from ethogram.studies.language.figures import figures
from ethogram.studies.language.plan import CURVE, SELECTED, Condition
from ethogram.studies.language.published import (
    REFERENCE_REWARD,
    THOUSAND_EPISODES,
    VALIDATION_REWARD,
)
from ethogram.studies.language.results import SETTINGS, Results, Setting
from ethogram.studies.language.tables import tables

TRIALS = 8
LEARNS_AT = {"learned": 9, "no-communication": 2, "optimal": 4}  # thousand episodes


def record(condition, reward, episodes=20_000, learns_at=None):
    """A record of a condition: R_val per trial, learned in one step, with a perfect language."""
    robots, targets, talkers, vocabulary_size, _ = condition
    reward = np.asarray(reward, float)
    point = np.arange(1, 21) * episodes // 20
    late = 1000 * (learns_at or LEARNS_AT[talkers]) + np.resize([0, 1000, 0], len(reward))
    training = np.where(point < late[:, None], 3 * reward[:, None], reward[:, None])
    meaning = np.full((len(reward), robots, robots, targets, vocabulary_size + 1), np.nan)
    for talker, guided, target in np.ndindex(robots, robots, targets):
        if guided != talker:
            word = min(1 + target + targets * guided, vocabulary_size)
            meaning[:, talker, guided, target] = np.eye(vocabulary_size + 1)[word]
    episode = np.array([-1.0, 1.0])  # about the mean
    returns = {"validation": 0, "noise_free": 1, "discounted": 2, "silenced": -9, "scrambled": -4}
    data = {
        f"{name}_return": (("trial", "episode"), reward[:, None] + more + episode)
        for name, more in returns.items()
    }
    data |= {
        "training_return": (("trial", "point"), training),
        "meaning": (("trial", "talker", "guided", "target", "word"), meaning),
        "influence": (
            ("trial", "talker", "listener"),
            np.broadcast_to(0.5 - 0.5 * np.eye(robots), (len(reward), robots, robots)),
        ),
    }
    coords = {"point": ("point", point)}
    return {"results": xr.Dataset(data, coords, attrs=condition._asdict() | {"discount": 0.95})}


def outcome(setting, condition, peak=1.0, opt=0.0):
    """R_val as the thesis has it: best at `peak`, falling with size, steeper beyond it."""
    size = setting.associations
    level = -8.0 * setting.robots - 2.0 * setting.targets
    if condition.talkers == "optimal":
        return level + 1 + 0.3 * size + opt
    distance = condition.expressiveness - peak
    return level - 10 * abs(distance) if distance < 0 else level - 0.3 * size * distance


def campaign(settings=SETTINGS, expressiveness=CURVE, episodes=20_000, **changes):
    """Records of all that the thesis runs at some settings and e, with a little noise."""
    rng = np.random.default_rng(0)
    return {
        condition.name: record(
            condition, outcome(one, condition, **changes) + rng.normal(0, 0.02, TRIALS), episodes
        )
        for one in settings
        for condition in (*map(one.learned, expressiveness), one.optimal, one.no_communication)
    }


@pytest.fixture(scope="module")
def everything():
    return campaign()


@pytest.fixture(scope="module")
def smallest():
    """Two robots and two targets in full, three of each at one value of e, and with silence."""
    silent = Condition(2, 2, "learned", 4, True)
    learned = Setting(3, 3).learned(1)
    return campaign((Setting(2, 2),)) | {
        silent.name: record(silent, [-20, -21, -22]),
        learned.name: record(learned, [-30, -31, -32]),
    }


@pytest.fixture(scope="module")
def excerpt(smallest):
    """Two robots and two targets in full, three of each at the values of e of the tables."""
    return smallest | campaign((Setting(3, 3),), (0.0, *SELECTED))


def verdicts(records):
    return [claim.verdict for claim in claims(records)]


# Measures


def test_the_settings_are_those_of_the_campaign():
    assert sum(len(one.curve()) for one in SETTINGS) == 333
    assert [Setting(2, 3).learned(e).vocabulary_size for e in (0.25, 1, 3)] == [1, 6, 18]
    reached = {Setting(4, 4).learned(e).vocabulary_size for e in CURVE}
    assert reached == set(range(65))
    assert Setting(7, 7).learned(1 / 49).vocabulary_size == 1  # although 1 / 49 * 49 < 1


def test_published_numbers_are_complete():
    cells = {(*one, e) for one in SETTINGS for e in SELECTED}
    assert set(VALIDATION_REWARD) == cells
    assert set(THOUSAND_EPISODES) == set(SETTINGS)
    # What a robot earns is what the printed scores of the smallest game are near to.
    assert 2 * REFERENCE_REWARD["uninformed"][2] == pytest.approx(-37.84, rel=0.02)
    assert 2 * REFERENCE_REWARD["informed"][2] == pytest.approx(-13.80, rel=0.05)


def learning(points, *rewards):
    data = {"training_return": (("trial", "point"), np.array(rewards, float))}
    return xr.Dataset(data, {"point": ("point", points)})


def test_learning_is_over_within_five_per_cent_of_the_final_reward():
    points = np.arange(512, 512 * 11, 512)  # the last tenth is the last point
    slow = [-90, -60, -40, -30, -25, -22, -21.1, -20.9, -20, -20]
    quick = [-90, -20.5, -40, -30, -25, -22, -21.1, -20.9, -20, -20]
    data = learning(points, slow, quick)  # -21 and better is near enough
    np.testing.assert_allclose(measure.thousand_episodes(data), [8 * 0.512, 2 * 0.512])


def test_the_final_reward_weighs_points_by_their_episodes():
    points = np.array([*range(512, 512 * 20, 512), 512 * 19 + 32])
    rewards = [-40.0] * 17 + [-22.5, -20, -37]  # final: -(20 * 512 + 37 * 32) / 544 = -21
    data = learning(points, rewards)  # -22.05 and better is near enough
    np.testing.assert_allclose(measure.thousand_episodes(data), [19 * 0.512])


def test_rewards_are_normalised_within_each_trial_and_setting(smallest):
    every = [symbols / 4 for symbols in range(17)]
    (normalised,) = Results.of(smallest).normalised([Setting(2, 2)], every)
    assert normalised.shape == (TRIALS, 17)
    np.testing.assert_allclose(normalised.mean(1), 0, atol=1e-12)
    np.testing.assert_allclose(normalised.std(1), 1)
    assert (normalised.argmax(1) == 4).all()


def test_settings_are_averaged_at_equal_expressiveness():
    both = Setting(2, 2), Setting(2, 3)
    results = Results.of(campaign(both))
    value = results.normalised(both, (0.25, 0.5, 3.0))
    assert value.shape == (2, TRIALS, 3)
    exactly = results.normalised(both[1:], (1 / 6, 3 / 6, 18 / 6))  # 0.25 * 6 is no integer
    np.testing.assert_array_equal(value[1:], exactly)


def test_settings_with_unequal_trials_share_those_that_all_have():
    two, three = Setting(2, 2), Setting(2, 3)
    records = campaign([two, three], (0.0, 1.0, 3.0))
    every = Results.of(records).normalised([two, three], (0.0, 1.0))
    fewer = {
        name: {"results": groups["results"].isel(trial=slice(2 if name[:3] == "2x3" else None))}
        for name, groups in records.items()
    }
    results = Results.of(fewer)
    np.testing.assert_array_equal(results.normalised([two, three], (0.0, 1.0)), every[:, :2])
    assert figures(fewer)
    assert claims(fewer)[1].effect is not None


def test_rewards_are_normalised_over_what_was_run():
    one = Setting(2, 2)
    rewards = {0.0: [-30, -3, 1], 0.25: [-20, -2, 1], 1.0: [-10, -1, 4]}
    run = {one.learned(e).name: record(one.learned(e), values) for e, values in rewards.items()}
    run["or-silence"] = record(Condition(*one, "learned", 4, True), [0, 0, 0])
    results = Results.of(run)
    assert results.settings_with([0, 1]) == [one]
    assert results.settings_with([0, 3]) == results.settings_with(CURVE) == []
    (normalised,) = results.normalised([one], (0, 1))
    steps, jump = np.sqrt(3 / 2), np.sqrt(1 / 2)
    np.testing.assert_allclose(normalised, [[-steps, steps], [-steps, steps], [-jump, 2 * jump]])


def test_two_alphabets_are_too_few_to_normalise():
    assert Results.of(campaign((Setting(2, 2),), (0.0, 1.0))).settings_with([0, 1]) == []


def test_results_know_their_condition_from_numbers_of_any_type():
    condition = Condition(2, 2, "learned", 4, True)
    found = record(condition, [-20, -21, -22])
    found["results"].attrs |= {"robots": np.int64(2), "vocabulary_size": 4.0, "silence": 1}
    (read,) = Results.of({"a": found}).by_condition
    assert read == condition
    assert [type(part) for part in read] == [type(part) for part in condition]


def test_the_best_learned_policy_is_that_of_the_best_alphabet_over_all_trials(smallest):
    results = Results.of(smallest)
    at_one = results.trials(measure.validation_return, Setting(2, 2).learned(1))
    np.testing.assert_array_equal(results.best_learned(Setting(2, 2)).values, at_one.values)
    assert results.best_learned(Setting(3, 3)).missing


def test_influence_leaves_out_what_a_robot_says_to_itself(smallest):
    data = smallest["3x3-learned-9"]["results"]
    np.testing.assert_allclose(measure.influence(data), 0.5)


# Claims


def test_a_campaign_like_the_one_described_confirms_every_claim(everything):
    assert verdicts(everything) == ["confirmed"] * 7


def test_shorter_training_decides_nothing():
    judged = claims(campaign(episodes=4000))
    assert {claim.verdict for claim in judged} == {"undecided"}
    reason = "trained for 4 000 of the 20 000 episodes that the claim speaks of"
    assert all(claim.note.startswith(reason) for claim in judged)
    assert judged[0].effect is not None


def test_a_peak_elsewhere_refutes_where_it_should_be():
    assert verdicts(campaign(peak=2.0))[:2] == ["refuted", "confirmed"]


@pytest.mark.parametrize(("robots", "expected"), [(2, "confirmed"), (3, "refuted")])
def test_too_many_words_hurt_in_the_larger_games_only(everything, robots, expected):
    many = Setting(robots, 3).learned(3)
    records = everything | {many.name: record(many, np.linspace(-10.2, -10, TRIALS))}
    assert claims(records)[2].verdict == expected


def test_a_learned_policy_that_beats_opt_refutes_that_opt_is_best():
    claim = claims(campaign(opt=-25.0))[3]
    assert claim.verdict == "refuted"
    assert claim.note.startswith("rests on: optimal - 1.05 learned")


@pytest.mark.parametrize(("share", "expected"), [(0.04, "confirmed"), (0.08, "refuted")])
def test_opt_may_be_worse_by_five_per_cent(everything, share, expected):
    one = Setting(2, 2)
    worse = (1 + share) * outcome(one, one.learned(1)) + np.linspace(-0.01, 0.01, TRIALS)
    records = everything | {one.optimal.name: record(one.optimal, worse)}
    assert claims(records)[3].verdict == expected


def test_slower_baselines_refute_that_they_are_faster(everything):
    late = Setting(3, 3).optimal
    records = everything | {late.name: record(late, np.linspace(-20.2, -20, TRIALS), learns_at=15)}
    claim = claims(records)[6]
    assert (claim.verdict, claim.unit) == ("refuted", "thousand episodes")
    assert "optimal" in claim.note


def test_a_quick_plan_shows_the_direction_of_what_it_can():
    judged = claims(campaign((Setting(2, 2),), (0.0, 0.25, 1.0), episodes=6000))
    shown = {claim.number: claim for claim in judged if claim.verdict == "undecided"}
    assert set(shown) == {2, 4}
    assert {claim.verdict for claim in judged} == {"undecided", "not run"}
    assert shown[2].high < 0 < shown[4].low
    short = "trained for 6 000 of the 20 000 episodes that the claim speaks of"
    leans = "leans towards the claim"
    assert shown[2].note == f"{short}; 0 of 9 settings run whole, 1 in part; {leans}"
    assert shown[4].note.startswith(f"{short}; not run: 2 robots, 2 targets, learned, e = 0.5; ")


def test_an_excerpt_decides_what_it_ran_in_full_and_shows_where_the_rest_points(excerpt):
    first, *rest = claims(excerpt)
    leans = "leans towards the claim"
    assert (first.verdict, first.note) == ("undecided", f"1 of 9 settings run whole; {leans}")
    assert first.low > 0
    without, many, opt, targets, spread, faster = rest
    assert (without.verdict, spread.verdict) == ("undecided", "undecided")
    assert without.note == f"1 of 9 settings run whole, 1 in part; {leans}"
    assert spread.note.startswith("1 of 9 settings run whole, 1 in part; leans")
    assert without.high < 0
    assert spread.effect is not None
    assert (many.verdict, opt.verdict) == ("undecided", "undecided")
    assert many.high < 0 < opt.low
    assert many.note.startswith("not run: 3 robots, 4 targets, learned, e = 3; ")
    assert many.note.endswith(f"; rests on: e = 3 - e = 1, 3 robots, 3 targets; {leans}")
    assert (targets.verdict, faster.verdict) == ("not run", "confirmed")


def test_an_excerpt_can_refute_what_it_did_not_run_in_full(excerpt):
    many = Setting(3, 3).learned(3)
    records = excerpt | {many.name: record(many, np.linspace(-10.2, -10, TRIALS))}
    assert claims(records)[2].verdict == "refuted"


def test_an_average_over_all_settings_needs_the_whole_curve_of_each(everything):
    gap = Setting(4, 4).learned(2)
    records = {name: groups for name, groups in everything.items() if name != gap.name}
    judged = claims(records)
    assert [judged[index].verdict for index in (0, 1, 5)] == ["undecided"] * 3
    leans = "leans towards the claim"
    assert judged[0].note == f"8 of 9 settings run whole; {leans}"
    part = f"8 of 9 settings run whole, 1 in part; {leans}"
    assert judged[1].note == judged[5].note == part
    assert judged[3].note.startswith("not run: 4 robots, 4 targets, learned, e = 2; 4 robots, 4")


def test_the_tests_that_were_changed_after_a_first_run_say_so():
    found = claims({})
    assert {claim.stated for claim in found} == {"2026-11-23"}
    changed = {claim.number for claim in found if claim.history[0].date == "2026-11-23"}
    assert changed == {1, 2, 6}
    assert all(claim.history[-1].date == "2026-11-29" for claim in found)


def test_other_settings_than_the_nine_take_no_part_in_claims(everything):
    other = campaign((Setting(5, 2),), peak=2.0)
    assert claims(everything | other) == claims(everything)


def test_without_records_there_is_nothing_to_show_and_nothing_to_judge():
    assert verdicts({}) == ["not run"] * 7
    assert tables({}) == figures({}) == []


# Tables


def test_tables_have_a_row_for_what_was_run_beside_the_thesis(smallest):
    of = {table.name: table for table in tables(smallest)}
    assert set(of) == {"table-2-2", "table-2-3", "returns", "language"}
    assert [row[:4] for row in of["table-2-2"].rows] == [
        (2, 2, "0.25", 1),
        (2, 2, "1", 4),
        (2, 2, "3", 12),
        (3, 3, "1", 9),
    ]
    mean, deviation = of["table-2-2"].rows[-1][4:]
    assert (mean.value, mean.published) == (-31, -30.32)
    assert deviation == Measured(value=1.0, published=0.05)
    episodes = {row[:3]: row[3] for row in of["table-2-3"].rows}
    assert list(episodes)[:2] == [(2, 2, "NoComm"), (2, 2, "Opt")]
    late = episodes[3, 3, "e = 1"]
    assert (late.value, late.published) == (pytest.approx((9 + 10 + 9) / 3), 9)


def test_the_returns_and_the_language_of_every_condition_are_told(smallest):
    of = {table.name: {row[:3]: row[3:] for row in table.rows} for table in tables(smallest)}
    assert len(of["returns"]) == 17 + 2 + 2
    assert (2, 2, "learned, e = 1 or silence") in of["returns"]
    returns = [cell.value for cell in of["returns"][3, 3, "learned, e = 1"]]
    assert returns == pytest.approx([-31, -30, -29, -40, -35])
    language = [cell.value for cell in of["language"][3, 3, "learned, e = 1"]]
    assert language == pytest.approx([9, 4, 0.5, 1, 1, 6, 1, 1, 1])
    assert of["language"][2, 2, "optimal"][-1] is None  # no two talkers know of the same


def test_other_settings_than_the_nine_are_shown_without_published_numbers():
    of = {table.name: table for table in tables(campaign((Setting(5, 1),)))}
    *label, cell, _ = of["table-2-2"].rows[1]
    assert label == [5, 1, "1", 5]
    assert (cell.value, cell.published) == (pytest.approx(-42, abs=0.1), None)
    assert [row[3].published for row in of["table-2-3"].rows] == [None] * 5
    assert len(of["language"].rows) == 21 + 2


# Figures


def test_figures_have_panels_for_what_was_run(smallest):
    of = {figure.name: figure for figure in figures(smallest)}
    assert set(of) == {f"figure-2-{number}" for number in range(1, 5)} | {"words"}
    assert {row[:2] for row in of["figure-2-2"].data.rows} == {(2, 2), (3, 3)}
    assert {row[:2] for row in of["figure-2-4"].data.rows} == {(2, 2), (3, 3)}
    assert len(of["figure-2-1"].data.rows) == len(CURVE)
    assert "highest at e = 1." in of["figure-2-1"].alt
    series = {row[2] for row in of["figure-2-2"].data.rows}
    assert series == {
        "learned",
        "learned or silence",
        "Opt",
        "NoComm",
        "informed",
        "uninformed",
        "thesis",
    }


def test_a_part_of_a_curve_is_not_averaged():
    condition = Setting(2, 2).learned(1)
    drawn = figures({condition.name: record(condition, [-14, -15, -16])})
    assert {figure.name for figure in drawn} == {"figure-2-2", "figure-2-4", "words"}


def test_boxes_spread_what_was_run_at_each_expressiveness(excerpt):
    of = {figure.name: figure for figure in figures(excerpt)}
    assert "were run, (n_r, n_t) = (2, 2); mean" in of["figure-2-1"].caption
    listed = "(2, 2), (3, 3) at e = 0, 0.25, 1, 3; (2, 2) at e = 0.5, 2, 4."
    assert listed in of["figure-2-3"].caption
    rows = {row[0]: row[1:] for row in of["figure-2-3"].data.rows}
    results = Results.of(excerpt)
    both = results.normalised([Setting(2, 2), Setting(3, 3)], [3])
    assert rows["3"][2] == pytest.approx(np.median(both))
    assert rows["4"][4] == pytest.approx(results.normalised([Setting(2, 2)], [4]).max())


def test_settings_other_than_the_nine_are_drawn():
    of = {figure.name: figure for figure in figures(campaign((Setting(5, 1),)))}
    assert set(of) == {f"figure-2-{number}" for number in range(1, 5)} | {"words"}
    assert {row[:2] for row in of["figure-2-4"].data.rows} == {(5, 1)}
    series = {row[2] for row in of["figure-2-2"].data.rows}
    assert series == {"learned", "Opt", "NoComm"}  # nothing printed, no reference controllers


def test_the_words_are_those_of_the_largest_game_nearest_to_one_word_each(smallest):
    words = next(figure for figure in figures(smallest) if figure.name == "words")
    assert "3 robots, 3 targets, learned, e = 1" in words.title
    rows = words.data.rows
    assert len(rows) == 3 * 2 * 3 * 9  # talkers, others, targets, words
    said = {row[:3]: row[3] for row in rows if row[4] == 1}
    assert said[1, 2, 1] == 4
    assert said[1, 3, 3] == 9
