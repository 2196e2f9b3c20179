"""Rewards, ends, contacts and sights of traffic, by hand and car by car."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.oracles import traffic as oracle
from tests.worlds.test_traffic import BRAKE, FASTER, KEEP, STRAIGHT, VERTEX_1, drive, placed, ring

from ethogram.worlds.traffic import Graph, Section, Traffic
from ethogram.worlds.traffic import neighbours as order

STEPS = 3
DISTANCE, RELATIVE_SPEED = slice(5, 8), slice(8, 11)  # of an observation: to the right, own, left
BEHIND = slice(11, 17)


def four(**settings):
    return ring(4, steps=STEPS, **settings)


def one_step(world, cars, *accelerations):
    """The state reached, and the outcome; who is told nothing brakes."""
    chosen = [*accelerations, *[BRAKE] * (len(cars) - len(accelerations))]
    return drive(world, placed(world, cars), [[each, STRAIGHT] for each in chosen])[0]


@pytest.mark.parametrize(
    ("weights", "fines"), [((0.5, 2.0, 3.0), [5.5, 2.0, 3.0, 0.0]), ((0.0, 0.0, 0.0), [0.0] * 4)]
)
def test_each_rule_has_the_fine_of_its_weight(weights, fines):
    names = "intersection_weight", "distance_weight", "right_lane_weight"
    cars = [
        (0, 87.2, 2, 14.0),  # 10 m before a vertex, in an empty road: 49 m to stop, 43 m seen
        (1, 20.0, 1, 8.0),  # 16 m to stop, and 20 - 7 m to the fourth
        (1, 60.0, 2, 8.0),  # nobody to the right
        (1, 41.6, 1, 0.0),
    ]
    world = four(**dict(zip(names, weights, strict=True)))
    _, outcome = one_step(world, cars, KEEP, KEEP, KEEP)
    np.testing.assert_array_equal(
        outcome.metrics["breaches"],
        [[True, True, True], [False, True, False], [False, False, True], [False] * 3],
    )
    speeds = np.array([14.0, 8.0, 8.0, 0.0])
    np.testing.assert_allclose(outcome.reward["driver"], speeds / 50 - fines, rtol=1e-5)


def test_the_speed_that_is_measured_is_that_of_the_state_reached():
    cars = [(0, 20.0, 1, 10.0), (0, 60.0, 1, 8.0), (1, 20.0, 1, 5.0), (1, 60.0, 1, 0.0)]
    after, outcome = one_step(four(), cars, FASTER, BRAKE, KEEP, FASTER)
    np.testing.assert_allclose(outcome.metrics["speed"], [10.4, 7.6, 5.0, 0.4], rtol=1e-6)
    np.testing.assert_array_equal(outcome.metrics["speed"], after.speed)


def test_time_is_up_with_the_last_step_and_not_before_or_after():
    world = four()
    start = placed(world, [(0, 20.0, 1, 0.0)])
    outcomes = [each for _, each in drive(world, start, *[[[BRAKE, STRAIGHT]] * 4] * STEPS)]
    late = [each.truncated["driver"].tolist() for each in outcomes]
    assert late == [[False] * 4, [False] * 4, [True] * 4]


def test_cars_that_are_a_length_apart_do_not_touch():
    for nearer, collides in ((0.0, False), (0.125, True)):
        two = [(0, 20.0, 1, 0.0), (0, 27.0 - nearer, 1, 0.0)]
        across = [(0, 97.0, 1, 0.0), (VERTEX_1, 4.0 - nearer, 1, 0.0)]
        _, outcome = one_step(four(), [*two, *across])
        np.testing.assert_array_equal(outcome.metrics["collision"], [collides] * 4)


def test_a_car_beside_another_is_not_ahead_of_it():
    beside = [(0, 50.0, 1, 0.0), (0, 50.0, 2, 0.0)]
    a_metre_on = [(1, 50.0, 1, 0.0), (1, 51.0, 2, 0.0)]
    _, outcome = one_step(four(), [*beside, *a_metre_on])
    seen = outcome.observation["driver"]
    distances = np.full((4, 3), 50.0)
    distances[2, 2] = 1.0
    np.testing.assert_array_equal(seen[:, DISTANCE], distances)
    np.testing.assert_array_equal(seen[:, RELATIVE_SPEED], np.where(distances == 1, 0.0, 50.0))
    np.testing.assert_array_equal(outcome.metrics["breaches"][:, 2], [False, True, False, True])


def test_the_dead_that_earn_are_terminated_only_when_they_are_removed():
    world = ring(4, collided="removed", fine_dead=True, impact_steps=1, dead_steps=2)
    start = placed(
        world, [(0, 20.0, 1, 0.0), (0, 25.0, 1, 0.0), (1, 50.0, 1, 0.0), (1, 80.0, 1, 0.0)]
    )
    outcomes = [each for _, each in drive(world, start, *[[[BRAKE, STRAIGHT]] * 4] * 3)]
    assert [each.acting["driver"].tolist() for each in outcomes] == [
        [True] * 4,
        [False, False, True, True],
        [False, False, True, True],
    ]
    assert [each.terminated["driver"].tolist() for each in outcomes] == [
        [False] * 4,
        [False] * 4,
        [True, True, False, False],
    ]
    # too close to the second, the first is fined while it is dead; the impact makes 1 m/s
    rewards = [each.reward["driver"] for each in outcomes]
    np.testing.assert_allclose(rewards, [[-1, 0, 0, 0], [-1, 0.02, 0, 0], [0] * 4], rtol=1e-6)


@pytest.mark.parametrize("few", [order.FEW, 0])  # counted, and sorted
def test_a_human_sees_the_cars_behind_that_a_loop_finds(few, monkeypatch):
    monkeypatch.setattr(order, "FEW", few)
    sections = ((40.0, 2, 0, 1), (40.0, 2, 1, 0), (40.0, 1, 1, 0))  # of the last two one is chosen
    world = Traffic(
        graph=Graph(tuple(Section(*each) for each in sections), u_turns=True),
        cars=0,
        max_cars=1,
        humans=3,
        scale=False,
    )
    slow, rng = oracle.Traffic(sections=list(sections), cars=[]), np.random.default_rng(3)
    places = [
        (p, x, y)
        for p in range(5)
        for x in np.arange(0.0, slow.length(p), 5.0)
        for y in range(1, slow.width(p) + 1)
    ]
    observe = jax.jit(lambda state: world.observe(state)["human"])
    within = across = 0
    for cars in [4] * 20 + [3] * 5:
        drawn = [places[n] for n in rng.choice(len(places), cars, replace=False)]
        drawn = [(*place, v) for place, v in zip(drawn, rng.permutation(4) + 1.0, strict=False)]
        exits = [int(rng.choice(slow.n(p))) for p, *_ in drawn]
        slow.cars = [oracle.Car(*car, onward) for car, onward in zip(drawn, exits, strict=True)]
        state = placed(world, drawn)
        state = dataclasses.replace(state, exit=jnp.array([*exits, 0][:4], jnp.int32))
        seen = observe(state)[: cars - 1, BEHIND]
        wanted = np.array([np.ravel(slow.seen_behind(car)) for car in slow.cars[1:]])
        np.testing.assert_allclose(seen, wanted, atol=1e-5)
        at = np.array([car.x for car in slow.cars[1:]])[:, None]
        is_seen, is_across = wanted[:, :3] < 50, wanted[:, :3] > at
        within += (is_seen & ~is_across).sum()
        across += (is_seen & is_across & (at > 0)).sum()
    assert min(within, across) > 10
