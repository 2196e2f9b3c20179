import dataclasses
from functools import partial

import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from tests.studies.fuzzing import fuzz, misdrawn

from ethogram.campaign.context import Context
from ethogram.core.scene import Scene
from ethogram.studies import rules as study
from ethogram.studies.rules import results as measure
from ethogram.studies.rules.condition import NO_RULES, RULES, Condition, Fines
from ethogram.studies.rules.plan import Settings, condition_of, world_of
from ethogram.studies.rules.readings import READINGS, WORDS
from ethogram.studies.rules.validation import (
    ACTING,
    GROUPS,
    HUMANS,
    LEAST_GAP,
    ROADS,
    SHARES,
    SPEEDS,
    START,
    TRAFFIC,
    Fare,
    fare,
    upon_a_stopped_car,
)

SMALL = {"world.cars": 4, "world.steps": 12, "learner.minibatch_size": 24, "trials": 2}
STEER_LEFT, KEEP = np.array([1, 2]), np.array([1, 1])


@pytest.fixture(scope="module")
def records():
    """Two conditions, compiled once."""
    changes = [f"{key}={value}" for key, value in SMALL.items()]
    cases = study.cases(study.PLANS["smoke"].override(changes))
    return {case.name: study.run(case, Context()) for case in cases}


def test_the_thesis_plan_is_section_4_4():
    cases = study.cases(study.PLANS["thesis"])
    assert [case.name for case in cases] == [
        "rules-restored",
        "no-rules-restored",
        "rules-removed",
        "no-rules-removed",
    ]
    for case in cases:
        settings = case.parsed(Settings)
        assert (settings.trials, settings.updates) == (20, 500)
        world, learner = settings.world, settings.learner
        assert (world.cars, world.steps, world.car_length, world.view_distance) == (40, 500, 7, 50)
        assert (world.max_speed, world.acceleration, world.time_step) == (50, 2, 0.2)
        assert (world.impact_steps, world.dead_steps) == (10, 20)
        assert learner.discount == 0.999


def test_a_condition_is_what_is_fined_and_what_is_read_otherwise():
    def of(**changes):
        plan = study.PLANS["thesis"].override([f"{key}={value}" for key, value in changes.items()])
        return condition_of(plan.points()[0])

    assert of() == Condition(RULES)
    assert of(enforcement=0) == Condition(NO_RULES)
    assert of(enforcement=2).fines == Fines(2, 2, 2)
    half = of(**{"world.distance_weight": 0.5, "enforcement": 2})
    assert half.name == "fines-2-1-2-restored"
    assert half.description == "fines: intersection 2, distance 1, right lane 2, cars restored"
    literal = of(**{"world.braking": "literal", "world.collided": "removed"})
    assert literal.name == "rules-removed-literal_braking"
    odd = of(**{"world.braking": "literal", "world.impact": "false"})
    assert odd.name.startswith("rules-restored-reading_")
    assert set(READINGS) == set(WORDS)


def test_every_reading_and_every_set_of_fines_is_a_condition_of_its_own():
    assert len(study.cases(study.PLANS["readings"])) == 2 * len(READINGS)
    fines = [case.name for case in study.cases(study.PLANS["fines"])]
    assert len(set(fines)) == 8
    worlds = [world_of(case.parsed(Settings)) for case in study.cases(study.PLANS["fines"])]
    weights = {
        tuple(
            float(getattr(world, f"{rule}_weight"))
            for rule in ("intersection", "distance", "right_lane")
        )
        for world in worlds
    }
    assert {(1, 1, 1), (0, 0, 0), (1, 2, 1), (0, 1, 1)} <= weights


def test_without_rules_a_driver_earns_its_speed_while_it_lives(records):
    data = records["no-rules-restored"]["results"]
    for of_training in (True, False):
        earned, driven, collided = (
            data[f"training_{name}"] if of_training else data[f"traffic_{words}"]
            for name, words in (("R", "return"), ("E", "efficiency"), ("C", "collisions"))
        )
        assert (50 * earned <= driven + 1e-3).all()  # the dead move, and earn nothing
        unharmed = collided.values == 0
        assert unharmed.any()
        np.testing.assert_allclose(50 * earned.values[unharmed], driven.values[unharmed], rtol=1e-4)


def test_with_rules_breaches_are_paid_for(records):
    data = records["rules-restored"]["results"]
    fines = data["traffic_breaches"].sum("rule")
    unharmed = data["traffic_collisions"].values == 0
    paid = data["traffic_efficiency"] / 50 - data["traffic_return"]
    assert (fines.values[unharmed] > 0).any()
    np.testing.assert_allclose(paid.values[unharmed], fines.values[unharmed], atol=1e-4)


def test_what_the_living_drive_is_what_is_earned_and_paid(records):
    for groups in records.values():
        data = groups["results"]
        unharmed = data["traffic_collisions"].sel(acting="drawn", level=40).values == 0
        assert unharmed.any()
        driven = data["traffic_efficiency"].sel(acting="drawn", level=40).values
        alive = measure.alive_efficiency(40)(data)
        np.testing.assert_allclose(alive[unharmed], driven[unharmed], rtol=1e-4)
        assert (alive <= driven + 1e-3).all()


def test_groups_without_cars_have_fared_no_way(records):
    data = records["rules-restored"]["results"]
    nobody = data["mixed_efficiency"].sel(share=0.0, group="human")
    np.testing.assert_array_equal(nobody, 0)
    np.testing.assert_array_equal(data["mixed_efficiency"].sel(share=1.0, group="driver"), 0)
    humans = data["mixed_efficiency"].sel(share=1.0, group="human")
    assert (humans > 0).all()
    # nobody is ahead of a reckless driver for so short a time: full acceleration, 0.4 m/s a step
    reckless = humans.sel(human="reckless")
    np.testing.assert_allclose(reckless, 0.4 * 12 * 13 / 2, rtol=0.3)


def test_what_a_group_has_fared_is_worked_out_by_hand():
    sums = {
        "speed": jnp.array([[10.0, 30.0, 99.0]]),
        "collision": jnp.array([[0, 1, 7]]),
        "breaches": jnp.array([[[1, 0, 2], [3, 0, 0], [9, 9, 9]]]),
    }
    found = fare(sums, jnp.array([True, True, False]))
    expected = Fare([20.0], [10.0], [0.5], [[2.0, 0.0, 1.0]])
    for name, value in expected._asdict().items():
        np.testing.assert_allclose(getattr(found, name), value)


def test_only_who_leaves_the_right_lane_gets_past_a_stopped_car():
    world = dataclasses.replace(world_of(Settings(), cars=2), steps=40)

    @jax.jit
    @partial(jax.vmap, in_axes=(0, None, None))
    def drive(key, blocked, action):
        state, place = upon_a_stopped_car(world, key, blocked)

        def advance(state, key):
            actions = jnp.broadcast_to(action, (2, 2))
            after, outcome = world.step(key, state, {"driver": actions})
            return after, outcome.metrics["collision"][0]

        return state, place, jax.lax.scan(advance, state, jax.random.split(key, 30))[1].any()

    keys = jax.random.split(jax.random.key(0), 20)
    state, place, hit = drive(keys, True, KEEP)
    assert hit.all()
    assert not drive(keys, True, STEER_LEFT)[2].any()
    assert not drive(keys, False, KEEP)[2].any()
    speed, gap = state.speed[:, 0], place - START
    assert ((speed >= SPEEDS[0]) & (speed <= SPEEDS[1])).all()
    assert ((gap >= LEAST_GAP) & (gap <= 7 + speed**2 / 4)).all()  # which braking takes
    assert (state.exit[:, 0] == state.exit[:, 1]).all()


def test_scenes_of_the_first_trials_are_kept(records):
    groups = records["rules-restored"]
    assert set(groups) == {"results", "scene", "scene-2"}
    assert len(Scene.from_dataset(groups["scene"]).position) == SMALL["world.steps"] / 2


def test_figures_and_tables_show_what_there_is(records):
    names = [figure.name for figure in study.figures(records)]
    assert names == ["figure-4-3", "figure-4-5", "figure-4-6", "mixed"]
    tables = {table.name: table for table in study.tables(records)}
    assert list(tables) == ["training", "after-training", "traffic", "among-humans", "approaches"]
    assert len(tables["after-training"].rows) == 2 * len(ACTING)
    assert study.figures({}) == study.tables({}) == []


def test_a_short_plan_decides_nothing(records):
    claims = study.claims(records)
    assert {claim.verdict for claim in claims[:11]} == {"undecided"}
    assert {claim.verdict for claim in claims[11:]} == {"not run"}
    assert claims[0].note.startswith("trained for 4 of the 500 updates and in episodes of 12 of")
    assert {claim.verdict for claim in study.claims({})} == {"not run"}


def results_of(at, numbers, updates=500):
    """Steady results of a condition in five trials.

    Args:
        at: the condition.
        numbers: E, its deviation, C, and by which distance saturates: cars that fill the roads.
        updates: of training.

    """
    efficiency, deviation, collisions, room = numbers
    noise = 1 + 1e-3 * np.arange(5)
    levels = np.array(TRAFFIC)
    moving = np.minimum(levels, room) / levels  # of the cars

    def everywhere(value, *axes):
        sizes = {"acting": 2, "level": 8, "human": 4, "share": 5, "group": 2, "road": 2}
        shape = [sizes[axis] for axis in axes]
        return ("trial", *axes), np.multiply.outer(noise, np.broadcast_to(value, shape))

    def by_level(values):
        return ("trial", "acting", "level"), noise[:, None, None] * np.stack([values] * 2)[None]

    coords = {
        "acting": list(ACTING),
        "level": levels,
        "human": list(HUMANS),
        "share": list(SHARES),
        "group": list(GROUPS),
        "road": list(ROADS),
        "rule": ["intersection", "distance", "right lane"],
        "point": [updates],
    }
    data = {
        "training_R": (("trial", "point"), noise[:, None]),
        "training_E": (("trial", "point"), efficiency * noise[:, None]),
        "training_E_deviation": (("trial", "point"), deviation * noise[:, None]),
        "training_C": (("trial", "point"), collisions * noise[:, None]),
        "traffic_efficiency": by_level(efficiency * moving),
        "traffic_collisions": by_level(collisions * levels / 40),
        "mixed_collisions": everywhere(collisions, "human", "share", "group"),
        "mixed_efficiency": everywhere(efficiency, "human", "share", "group"),
        "approach_left_lane": everywhere([0.0, 1.0], "road"),
        "approach_collision": everywhere([0.0, 0.1], "road"),
        "approach_right_lane_rule": everywhere(0.0, "road"),
        "approach_distance_rule": everywhere(0.5, "road"),
        "traffic_return": by_level(efficiency * moving / 50),
        "traffic_deviation": by_level(deviation * moving),
        "traffic_breaches": (("trial", "acting", "level", "rule"), np.zeros((5, 2, 8, 3))),
    }
    attrs = {f"fine_{rule}": fine for rule, fine in at.fines._asdict().items()}
    attrs |= {
        "top_speed": 50.0,
        "collided": at.collided,
        "reading": at.reading,
        "updates": updates,
        "steps": 500,
    }
    return {"results": xr.Dataset(data, coords, attrs | {"time_step": 0.2})}


def chapter(with_rules, without):
    return {
        at.name: results_of(at, numbers)
        for collided in ("removed", "restored")
        for at, numbers in (
            (Condition(RULES, collided), with_rules),
            (Condition(NO_RULES, collided), without),
        )
    }


def test_the_findings_of_the_chapter_would_confirm_its_claims():
    found = study.claims(chapter((2000, 200, 1.0, 50), (6000, 1500, 8.0, 1000)))
    assert [claim.verdict for claim in found[:6]] == ["confirmed"] * 6
    assert [claim.verdict for claim in found[6:8]] == ["confirmed"] * 2


def test_their_opposites_would_refute_them():
    found = study.claims(chapter((6000, 1500, 8.0, 1000), (2000, 200, 1.0, 50)))
    assert [claim.verdict for claim in found[:6]] == ["refuted"] * 6


def test_one_scenario_that_differs_is_enough_to_refute():
    records = chapter((2000, 200, 1.0, 50), (6000, 1500, 8.0, 1000))
    at = Condition(RULES, "removed")
    records[at.name] = results_of(at, (6000, 200, 8.0, 50))
    verdicts = {claim.number: claim.verdict for claim in study.claims(records)}
    assert verdicts[1] == verdicts[2] == verdicts[6] == "refuted"
    assert verdicts[3] == verdicts[4] == "confirmed"


def test_the_table_of_readings_judges_each_by_its_own_results():
    records = chapter((2000, 200, 1.0, 50), (6000, 1500, 8.0, 1000))
    for fines, numbers in ((RULES, (6000, 1500, 8.0, 1000)), (NO_RULES, (2000, 200, 1.0, 50))):
        at = Condition(fines, "restored", "km_h")
        records[at.name] = results_of(at, numbers, updates=100)
    table = {table.name: table for table in study.tables(records)}["robustness"]
    assert table.rows[0][1:] == ("confirmed",) * 6
    assert table.rows[1] == (WORDS["km_h"], *["refuted"] * 6)


def test_overall_distance_is_that_of_all_cars():
    data = results_of(Condition(RULES), (2000, 200, 1.0, 1000))["results"]
    np.testing.assert_allclose(measure.overall("distance", 20)(data)[0], 20 * 2000 * 0.2)
    np.testing.assert_allclose(measure.overall("collisions", 80)(data)[0], 80 * 2.0)


ODD = st.sampled_from([-1, 0, 1.5, 1e9, "", "x", None, True, [1, 2]])
KEYS = (
    *("world.cars", "world.steps", "world.graph", "world.collided", "world.max_speed"),
    *("enforcement", "learning_rate", "learner.epochs", "updates", "record_every", "trials"),
    *("validation", "validation_episodes", "seed", "world.start_gap"),
)


@pytest.mark.slow  # compiles a program for most of them
def test_settings_drawn_at_random_run_or_are_refused(capsys):
    small = SMALL | {"enforcement": 1, "updates": 1, "record_every": 1, "validation": "traffic"}
    valid = st.fixed_dictionaries(
        {},
        optional={
            "world.cars": st.integers(1, 6),
            "world.collided": st.sampled_from(["removed", "restored"]),
            "world.joint_action": st.booleans(),
            "enforcement": st.floats(0, 10),
            "world.graph": st.sampled_from(["grid_oneway", "grid_twoway"]),
        },
    )
    outcomes = fuzz("rules", small, valid, misdrawn(KEYS, ODD), 12, capsys, then="claims")
    assert outcomes["ran"]
