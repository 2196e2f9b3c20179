import dataclasses

import equinox as eqx
import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from tests.oracles import traffic as oracle

import ethogram
from ethogram.core.errors import InvalidSettings, UnknownName
from ethogram.core.keys import random_words
from ethogram.core.rollout import rollout
from ethogram.worlds.traffic import Graph, Section, State, Traffic
from ethogram.worlds.traffic import neighbours as order
from ethogram.worlds.traffic.collisions import SLOTS
from ethogram.worlds.traffic.graph import as_graph, grid_oneway, grid_twoway
from ethogram.worlds.traffic.start import scattered

KEY = jax.random.key(0)
BRAKE, KEEP, FASTER = 0, 1, 2
RIGHT, STRAIGHT, LEFT = 0, 1, 2
RING = Graph((Section(100.0, 2, 0, 1), Section(100.0, 2, 1, 0)), u_turns=True)
VERTEX_1 = 3  # elements of the ring: two sections, then vertices 0 and 1


@eqx.filter_jit
def reset(world, key):
    return world.reset(key)[0]


def placed(world, cars):
    """A state with cars of these elements, positions, lanes and speeds; others are out."""
    count = world.max_cars + world.humans
    rest = [(0, 0.0, 1, 0.0)] * (count - len(cars))
    element, position, lane, speed = map(np.array, zip(*cars, *rest, strict=True))
    none = np.zeros(count, int)
    onward = world.graph.tables.following[element, 0]
    present = np.arange(count) < len(cars)
    nobody = np.full((count, SLOTS), -1)
    parts = element, position, lane, speed, onward, none, none, nobody, present, np.array(0)
    return State(*map(jnp.asarray, parts))


@eqx.filter_jit
def step(world, state, action, key=KEY):
    return world.step(key, state, {"driver": jnp.asarray(action)})


def drive(world, state, *actions):
    """The states and outcomes of some steps."""
    found = []
    for action in actions:
        state, outcome = step(world, state, action)
        found.append((state, outcome))
    return found


def ring(count=1, **settings):
    return Traffic(graph=RING, cars=count, max_cars=count, scale=False, **settings)


def test_a_lone_car_has_the_speed_and_the_position_of_the_equations():
    world = ring()
    state = placed(world, [(0, 20.0, 1, 0.0)])
    after = drive(world, state, [[FASTER, STRAIGHT]], [[FASTER, STRAIGHT]], [[BRAKE, STRAIGHT]])
    # v = 0.4, 0.8, 0.4; x = 20 + 0.08, + 0.16, + 0.08
    np.testing.assert_allclose([s.speed[0] for s, _ in after], [0.4, 0.8, 0.4], rtol=1e-6)
    np.testing.assert_allclose([s.position[0] for s, _ in after], [20.08, 20.24, 20.32], rtol=1e-6)
    seen = after[1][1].observation["driver"][0]
    np.testing.assert_allclose(seen, [79.76, 1, 0.8, 1, 1, 50, 50, 50, 50, 50, 50], rtol=1e-6)
    np.testing.assert_allclose(after[1][1].reward["driver"], [0.8 / 50], rtol=1e-6)
    np.testing.assert_allclose(after[1][1].metrics["distance"], [0.16], rtol=1e-6)


def test_a_car_stays_between_rest_and_the_maximum_speed():
    world = ring(2)
    state = placed(world, [(0, 20.0, 1, 0.2), (1, 20.0, 1, 49.8)])
    ((after, _),) = drive(world, state, [[BRAKE, STRAIGHT], [FASTER, STRAIGHT]])
    np.testing.assert_allclose(after.speed, [0.0, 50.0])


def test_a_car_enters_a_vertex_and_leaves_it_in_the_first_lane():
    world = ring()
    state = placed(world, [(0, 96.0, 2, 25.0)])
    keep = [[KEEP, STRAIGHT]]
    on_vertex, further, beyond = (s for s, _ in drive(world, state, keep, keep, keep))
    # 4 m to the vertex and 5 m a step: 1 m on the vertex, 6 m, then 1 m on the other section
    assert (on_vertex.element[0], on_vertex.lane[0]) == (VERTEX_1, 1)
    np.testing.assert_allclose([on_vertex.position[0], further.position[0]], [1.0, 6.0], rtol=1e-5)
    assert beyond.element[0] == on_vertex.exit[0]
    np.testing.assert_allclose(beyond.position[0], 1.0, rtol=1e-5)


def test_a_car_that_reaches_a_boundary_exactly_has_not_left():
    world = ring()
    ((after, outcome),) = drive(world, placed(world, [(0, 95.0, 1, 25.0)]), [[KEEP, STRAIGHT]])
    assert after.element[0] == 0
    np.testing.assert_allclose(outcome.observation["driver"][0, 0], 0.0, atol=1e-5)


def test_a_lane_change_goes_one_lane_and_not_off_the_road():
    world = ring()
    state = placed(world, [(0, 20.0, 1, 1.0)])
    lanes = [
        s.lane[0]
        for s, _ in drive(world, state, *[[[KEEP, way]] for way in (LEFT, LEFT, RIGHT, RIGHT)])
    ]
    assert lanes == [2, 2, 1, 1]


def test_a_rear_end_collision_pushes_both_cars_apart_and_stops_them():
    world = ring(2, impact_steps=2, dead_steps=4)
    state = placed(world, [(0, 20.0, 1, 10.0), (0, 28.0, 1, 0.0)])
    keep = [[KEEP, LEFT]] * 2  # the dead do not change lanes
    first, second, third, fourth, fifth = drive(
        world, state, *[[[KEEP, STRAIGHT]] * 2], *[keep] * 4
    )
    after, outcome = first  # 22 and 28: closer than 7
    assert outcome.metrics["collision"].all()
    assert outcome.acting["driver"].all()
    np.testing.assert_array_equal(outcome.reward["driver"], [0.0, 0.0])
    np.testing.assert_array_equal(after.impact, [-1, 1])
    # two steps of 5 m/s^2: 9 and 8 m/s behind, 1 and 2 m/s ahead
    np.testing.assert_allclose(second[0].speed, [9.0, 1.0], rtol=1e-6)
    np.testing.assert_allclose(third[0].speed, [8.0, 2.0], rtol=1e-6)
    np.testing.assert_allclose(third[0].position, [22 + 1.8 + 1.6, 28 + 0.2 + 0.4], rtol=1e-6)
    np.testing.assert_allclose(fourth[0].speed, [0.0, 0.0])
    for _, outcome in (second, third, fourth, fifth):
        assert not outcome.acting["driver"].any()
        assert not outcome.metrics["collision"].any()
    # dead in four states, alive again in the fifth, and immune while they overlap
    assert [bool(s.alive[0]) for s, _ in (first, second, third, fourth, fifth)] == [False] * 4 + [
        True
    ]
    assert fifth[0].immune.all()
    ((gone, outcome),) = drive(world, fifth[0], [[BRAKE, LEFT], [KEEP, STRAIGHT]])
    assert outcome.acting["driver"].all()
    assert not outcome.metrics["collision"].any()
    np.testing.assert_array_equal(gone.immune, [False, False])  # in two lanes they are apart


def test_restored_cars_spare_those_that_they_overlap_and_nobody_else():
    world = ring(3, impact=False, dead_steps=2, impact_steps=1)
    state = placed(world, [(0, 20.0, 1, 10.0), (0, 25.0, 1, 10.0), (0, 60.0, 1, 0.0)])
    go = [[FASTER, STRAIGHT], [FASTER, STRAIGHT], [BRAKE, STRAIGHT]]
    found = drive(world, state, *[go] * 45)
    hits = [np.flatnonzero(outcome.metrics["collision"]) for _, outcome in found]
    assert list(hits[0]) == [0, 1]  # they overlap from the start
    assert found[2][0].immune.tolist() == [True, True, False]
    first = next(number for number, hit in enumerate(hits[1:], 1) if len(hit))
    assert {1, 2} <= set(hits[first])  # the one in front hits the car that stands, and both collide


def test_without_immunity_overlapping_cars_collide_for_ever():
    world = ring(2, impact=False, dead_steps=2, impact_steps=1, revive="literal")
    state = placed(world, [(0, 20.0, 1, 0.0), (0, 25.0, 1, 0.0)])
    collisions = [
        int(o.metrics["collision"].sum())
        for _, o in drive(world, state, *[[[BRAKE, STRAIGHT]] * 2] * 7)
    ]
    assert collisions == [2, 0, 0, 2, 0, 0, 2]


def test_a_collided_car_is_removed_and_nobody_sees_it_any_more():
    world = ring(3, impact_steps=1, dead_steps=3, collided="removed")
    state = placed(world, [(0, 20.0, 1, 0.0), (0, 25.0, 1, 0.0), (0, 5.0, 1, 0.0)])
    wait = [[BRAKE, STRAIGHT]] * 3
    found = drive(world, state, *[wait] * 4)
    assert [int(s.present.sum()) for s, _ in found] == [3, 3, 3, 1]
    distance = [float(o.observation["driver"][2, 6]) for _, o in found]
    np.testing.assert_allclose(distance, [15.0, 15.0, 15.0, 50.0], rtol=1e-5)
    for _, outcome in found:  # they earn nothing after the collision
        np.testing.assert_array_equal(outcome.terminated["driver"], [True, True, False])
    assert not found[-1][1].observation["driver"][:2].any()


def test_cars_in_two_lanes_collide_only_where_lanes_do_not_count():
    for collision, collides in (("lanes", False), ("literal", True)):
        world = ring(2, collision=collision)
        state = placed(world, [(0, 20.0, 1, 0.0), (0, 22.0, 2, 0.0)])
        ((_, outcome),) = drive(world, state, [[BRAKE, STRAIGHT]] * 2)
        assert (outcome.metrics["collision"] == collides).all()


def test_cars_collide_across_the_boundary_that_one_of_them_is_about_to_cross():
    world = ring(2)
    state = placed(world, [(0, 97.0, 2, 0.0), (VERTEX_1, 3.0, 1, 0.0)])
    ((after, outcome),) = drive(world, state, [[BRAKE, STRAIGHT]] * 2)
    assert outcome.metrics["collision"].all()
    np.testing.assert_array_equal(after.impact, [-1, 1])


def test_rules_are_broken_from_their_bounds_on():
    world = ring(2)
    # 13 m before a vertex at 10.4 m/s; in the left lane with nobody to the right
    state = placed(world, [(0, 87.0 - 2.08, 1, 10.4), (1, 20.0, 2, 10.4)])
    ((_, outcome),) = drive(world, state, [[KEEP, STRAIGHT]] * 2)
    np.testing.assert_array_equal(
        outcome.metrics["breaches"], [[True, False, False], [False, False, True]]
    )
    np.testing.assert_allclose(outcome.reward["driver"], [10.4 / 50 - 1] * 2, rtol=1e-5)
    # an empty road: 43 m allow sqrt(4 x 43) = 13.11 m/s, as printed sqrt(43 / 4) = 3.28 m/s
    for braking, limit in (("distance", 13.11), ("literal", 3.28)):
        world = ring(2, braking=braking)
        state = placed(world, [(0, 20.0, 1, limit - 0.01), (1, 20.0, 1, limit + 0.01)])
        ((_, outcome),) = drive(world, state, [[KEEP, STRAIGHT]] * 2)
        np.testing.assert_array_equal(outcome.metrics["breaches"][:, 1], [False, True])


def test_speeds_in_kilometres_per_hour_are_slower():
    world = ring(1, speed_unit="km/h")
    ((after, outcome),) = drive(world, placed(world, [(0, 20.0, 1, 13.8)]), [[FASTER, STRAIGHT]])
    np.testing.assert_allclose(after.speed, 50 / 3.6, rtol=1e-6)
    state = placed(world, [(0, 90.0, 1, 3.0)])  # 10 km/h are 2.78 m/s
    ((_, outcome),) = drive(world, state, [[KEEP, STRAIGHT]])
    assert outcome.metrics["breaches"][0, 0]


def test_an_action_can_be_one_choice_of_nine():
    two, one = ring(3), ring(3, joint_action=True)
    state = placed(two, [(0, 10.0, 1, 3.0), (0, 40.0, 2, 3.0), (1, 10.0, 1, 3.0)])
    ((expected, _),) = drive(two, state, [[FASTER, LEFT], [BRAKE, RIGHT], [KEEP, LEFT]])
    ((found, _),) = drive(one, state, [3 * FASTER + LEFT, 3 * BRAKE + RIGHT, 3 * KEEP + LEFT])
    jax.tree.map(np.testing.assert_array_equal, found, expected)


def test_the_number_of_cars_shares_a_program_and_padding_changes_nothing():
    few, many = Traffic(cars=3, max_cars=3), Traffic(cars=3, max_cars=5)
    state, wide = reset(few, KEY), reset(many, KEY)
    wide = jax.tree.map(
        lambda part, three: jnp.asarray(np.concatenate([three, part[3:]])) if part.ndim else part,
        *jax.tree.map(np.asarray, (wide, state)),
    )
    action = jnp.array([[FASTER, STRAIGHT], [KEEP, LEFT], [BRAKE, RIGHT]])
    padding = jnp.full((2, 2), FASTER)
    for _ in range(3):
        state, expected = step(few, state, action)
        wide, found = step(many, wide, jnp.concatenate([action, padding]))
    np.testing.assert_array_equal(found.observation["driver"][:3], expected.observation["driver"])
    assert not found.observation["driver"][3:].any()
    assert not found.acting["driver"][3:].any()
    assert found.terminated["driver"][3:].all()

    traces = []

    @eqx.filter_jit
    def present(world):
        traces.append(None)
        return world.reset(KEY)[0].present.sum()

    assert [int(present(Traffic(cars=cars, max_cars=80))) for cars in (10, 80)] == [10, 80]
    assert len(traces) == 1


# dt = 1/4 s: all speeds are exact, so that rounding never decides on which side of a bound one is
EXACT = {"time_step": 0.25, "vertex_length": 12.5}
READINGS = {
    "restored": ({}, {}),
    "removed": ({"collided": "removed"}, {"removed": True}),
    "literal": (
        {"collision": "literal", "revive": "literal", "braking": "literal", "fine_dead": True},
        {"collision": "literal", "revive": "literal", "braking": "literal", "fine_dead": True},
    ),
    "no impact": ({"impact": False, "graph": "grid_twoway"}, {"impact": False}),
    "literal transition": ({"transition": "literal"}, {"transition": "literal"}),
}


@pytest.mark.parametrize("reading", READINGS)
def test_the_world_is_the_one_that_the_thesis_writes(reading):
    ours, theirs = READINGS[reading]
    steps = 500 if reading == "restored" else 100
    with jax.enable_x64(True):
        world = Traffic(scale=False, **EXACT, **ours)
        state = reset(world, jax.random.key(5))
        shift = np.random.default_rng(4).integers(0, 2**20, 40) / 2**30  # none as far as another
        state = dataclasses.replace(state, position=state.position + shift)
        keys = jax.random.split(jax.random.key(6), steps)
        rng = np.random.default_rng(7)
        actions = rng.choice(3, (steps, 40, 2), p=[0.25, 0.25, 0.5])

        def play(state, given):
            key, action = given
            after, outcome = world.step(key, state, {"driver": action})
            return after, (after, outcome, random_words(key, 40))

        _, played = jax.jit(lambda start: jax.lax.scan(play, start, (keys, actions)))(state)
        states, outcomes, words = jax.tree.map(np.asarray, played)
    assert states.position.dtype == np.float64
    slow = oracle.Traffic(
        sections=list(world.graph.sections),
        cars=[oracle.Car(*(np.asarray(part)[i].item() for part in _own(state))) for i in range(40)],
        dt=0.25,
        vertex=12.5,
        **theirs,
    )
    for t in range(steps):
        slow.step(actions[t], words[t])
        for name, ours_at, theirs_at in (
            ("element", states.element[t], [car.p for car in slow.cars]),
            ("position", states.position[t], [car.x for car in slow.cars]),
            ("lane", states.lane[t], [car.y for car in slow.cars]),
            ("dead", states.dead[t], [car.dead for car in slow.cars]),
            ("present", states.present[t], [car.present for car in slow.cars]),
            ("collision", outcomes.metrics["collision"][t], slow.died),
        ):
            np.testing.assert_array_equal(ours_at, theirs_at, f"{name} in step {t}")
        np.testing.assert_array_equal(outcomes.metrics["breaches"][t], slow.breaches())
        np.testing.assert_allclose(outcomes.reward["driver"][t], slow.rewards(), atol=1e-12)
        seen = slow.observations()
        if reading == "literal transition":  # it leads beyond the ends of elements
            seen = np.clip(seen, [0] * 8 + [-50] * 3, [100, 2, 50, 1, 1] + [50] * 6)
        np.testing.assert_allclose(outcomes.observation["driver"][t], seen, atol=1e-9)
    assert outcomes.metrics["collision"].sum() > 20


def _own(state):
    return state.element, state.position, state.lane, state.speed, state.exit


@pytest.fixture
def sorted_always(monkeypatch):
    monkeypatch.setattr(order, "FEW", 0)


def test_many_cars_are_ordered_as_few_are(sorted_always):
    del sorted_always
    test_the_world_is_the_one_that_the_thesis_writes("removed")


@given(data=st.data())
@settings(max_examples=4)
def test_cars_are_conserved_and_nothing_overlaps_that_did_not_collide(data):
    vertices = data.draw(st.integers(2, 5))
    around = [(v, (v + 1) % vertices) for v in range(vertices)]
    chords = data.draw(st.lists(st.sampled_from([(0, vertices - 1), (1, 0), (vertices - 1, 1)])))
    sections = [
        (data.draw(st.floats(20, 60)), data.draw(st.integers(1, 3)), *way)
        for way in [*around, *(way for way in chords if way[0] != way[1])][:6]
    ]
    world = Traffic(
        graph=Graph(tuple(Section(*each) for each in sections), u_turns=True),
        cars=3,
        max_cars=3,
        view_distance=20.0,
        steps=60,
    )
    start = jax.random.key(data.draw(st.integers(0, 99)))

    def play(state, key):
        action = world.roles["driver"].action.sample(key, 3).at[:, 0].add(1)
        after, _ = world.step(key, state, {"driver": action})
        return after, after

    @jax.jit
    def states_from(start):
        return jax.lax.scan(play, world.reset(start)[0], jax.random.split(KEY, 60))[1]

    states = jax.tree.map(np.asarray, states_from(start))
    assert states.present.all()
    lengths = np.array([*(s[0] for s in sections), *[10.0] * vertices])
    element, position = np.asarray(states.element), np.asarray(states.position)
    assert (position >= 0).all()
    assert (position <= lengths[element] + 1e-3).all()
    untouched = (states.dead == 0) & (states.spared_by < 0).all(-1)
    for i in range(3):
        for j in range(i):
            same = (element[:, i] == element[:, j]) & (states.lane[:, i] == states.lane[:, j])
            close = np.abs(position[:, i] - position[:, j]) < 7 - 1e-3
            assert not (same & close & untouched[:, i] & untouched[:, j]).any()


@given(
    seed=st.integers(0, 2**31),
    lengths=st.lists(st.floats(30, 200), min_size=1, max_size=5),
    gap=st.floats(0, 12),
)
@settings(max_examples=25)
def test_cars_start_apart_from_each_other(seed, lengths, gap):
    count = int(min(12, sum(lengths) // max(gap + 1, 1) - 1))
    bits = jax.random.bits(jax.random.key(seed), (12,))
    present = jnp.arange(12) < count
    section, position = scattered(bits, present, jnp.array(lengths), gap)
    for s in range(len(lengths)):
        here = np.sort(np.asarray(position[present & (section == s)]))
        assert (np.diff(here) >= gap).all()
        assert (here >= 0).all()
        assert (here <= lengths[s]).all()


def test_cars_start_everywhere_alike():
    world = Traffic()
    states = jax.jit(jax.vmap(lambda key: world.reset(key)[0]))(jax.random.split(KEY, 300))
    counts = np.bincount(np.asarray(states.element).reshape(-1), minlength=21)
    # 12 000 cars on 12 sections; within 5 standard deviations of a multinomial
    assert (abs(counts[:12] - 1000) < 5 * np.sqrt(1000 * 11 / 12)).all()
    assert not counts[12:].any()
    assert abs(np.asarray(states.lane).mean() - 1.5) < 0.03
    first = np.asarray(states.element[:, 0])
    assert len(set(first.tolist())) == 12  # a car's number tells nothing of its place


def test_the_grids_are_those_of_the_thesis():
    one, two = grid_oneway(), grid_twoway(lanes=1)
    assert (len(one.sections), one.vertices, len(two.sections)) == (12, 9, 24)
    ways = np.array([[s.start, s.end] for s in one.sections])
    degrees = np.bincount(ways.reshape(-1), minlength=9)
    np.testing.assert_array_equal(degrees, [2, 3, 2, 3, 4, 3, 2, 3, 2])  # turns, three-way, main
    back = {(s.end, s.start) for s in two.sections}
    for number, onward in enumerate(two.onward):
        start = two.sections[number]
        assert all(
            (two.sections[s].start, two.sections[s].end) != (start.end, start.start) for s in onward
        )
        assert (start.start, start.end) in back


@pytest.mark.parametrize(
    ("sections", "said"),
    [
        ([], "sections = "),
        ([(100.0, 2, 0)], "sections = "),
        ([(0.0, 1, 0, 1), (9.0, 1, 1, 0)], "section 0 has length 0.0"),
        ([(9.0, 0, 0, 1), (9.0, 1, 1, 0)], "section 0 has 0 lanes"),
        ([(9.0, 1, 0, 0)], "section 0 has ends"),
        ([(9.0, 1, 0, 1)], "section 0 .0>1. is a dead end"),
        ([(9.0, 1, 0, 1), (9.0, 1, 1, 0)], "u_turns=True allows"),
        ([(9.0, 1, 0, 1), (9.0, 1, 1, 3), (9.0, 1, 3, 0)], "vertex 2"),
        (
            [(9.0, 1, 0, 1), (9.0, 1, 1, 2), (9.0, 1, 2, 0), (9.0, 1, 3, 0)],
            "section 3 .3>0. cannot be reached from section 0",
        ),
        (
            [(9.0, 1, 3, 0), (9.0, 1, 0, 1), (9.0, 1, 1, 2), (9.0, 1, 2, 0)],
            "section 1 .0>1. does not lead to section 0",
        ),
    ],
)
def test_a_graph_that_cars_cannot_drive_on_for_ever_is_refused(sections, said):
    with pytest.raises(InvalidSettings, match=said):
        as_graph(sections)


def test_wrong_settings_are_named():
    with pytest.raises(UnknownName, match=r"graph 'grid_onway'\. Did you mean 'grid_oneway'"):
        Traffic(graph="grid_onway")
    with pytest.raises(InvalidSettings, match="cars = 80 is more than max_cars = 40"):
        Traffic(cars=80)
    with pytest.raises(
        InvalidSettings, match="200 cars at start_gap = 10 m need more than the 1200"
    ):
        Traffic(cars=200, max_cars=200)
    with pytest.raises(InvalidSettings, match=r"time_step = 0\.3 s is 15 m; .* which is 10 m"):
        Traffic(time_step=0.3)
    with pytest.raises(InvalidSettings, match="impact_steps = 30 is more than dead_steps = 20"):
        Traffic(impact_steps=30)
    with pytest.raises(InvalidSettings, match=r"car_length = 0\.0"):
        Traffic(car_length=0.0)


def test_a_scene_tells_drivers_the_fined_and_the_dead_apart():
    world = ethogram.make("traffic", cars=4, max_cars=4, steps=3, impact_steps=1)
    start = placed(
        world, [(0, 20.0, 1, 0.0), (0, 25.0, 1, 0.0), (1, 50.0, 2, 0.0), (2, 50.0, 1, 0.0)]
    )
    played = eqx.filter_jit(
        lambda start: rollout(
            world,
            lambda key, seen: {"driver": jnp.zeros((4, 2), jnp.int32) + STRAIGHT},
            KEY,
            3,
            ethogram.core.rollout.Position(start, world.observe(start)),
        )[1]
    )(start)
    scene = world.scene(played)
    boxes, arrows, crosses, rings = np.split(scene.tint[0] >= 0, 4)
    np.testing.assert_array_equal(crosses, [True, True, False, False])
    np.testing.assert_array_equal(rings, crosses)
    np.testing.assert_array_equal(arrows, [False, False, True, False])  # in the left lane
    np.testing.assert_array_equal(boxes, [False, False, False, True])
    assert len({shape.vertices for shape in scene.shapes if shape.kind == "polygon"}) == 3
    assert len({scene.palette[entry] for entry in scene.tint[0] if entry >= 0}) == 4
    np.testing.assert_allclose(scene.series["collisions"], [[2], [2], [2]])
    # sections 0>1 and 1>2 lead to the right: headings of 0
    np.testing.assert_allclose(scene.heading[0, [0, 2]], 0.0, atol=1e-6)
    assert isinstance(played.next_state, State)
