import re
from fractions import Fraction

import equinox as eqx
import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pydantic
import pytest
from hypothesis import given

from ethogram.core.errors import EthogramError, InvalidSettings, UnknownName
from ethogram.core.rollout import watch
from ethogram.core.scene import Scene
from ethogram.core.settings import settings_of
from ethogram.physics.beams3d import Material, centre
from ethogram.worlds.softbody import SoftBody3D
from ethogram.worlds.softbody.bodies import MAX_VOXELS, PLANE, cells_of, name_of, text_of
from ethogram.worlds.softbody.gravity import schedule, tilt
from ethogram.worlds.softbody.scene import Pose, scene_of_poses

# Bodies


def test_the_bodies_of_figure_5_1_are_those_of_the_sheet():
    """Places (x, z), one voxel deep."""
    expected = {
        "worm": {(x, 0) for x in range(4)},
        "biped": {(x, 1) for x in range(4)} | {(0, 0), (3, 0)},
        "tripod": {(x, 1) for x in range(5)} | {(0, 0), (2, 0), (4, 0)},
    }
    for body, places in expected.items():
        cells = cells_of(body)
        assert {(x, z) for x, _, z in cells.tolist()} == places
        assert not cells[:, 1].any()


def test_a_body_can_be_written_or_given_as_a_grid():
    grid = np.zeros((3, 2, 2), bool)
    grid[:, 0, 1] = grid[2, :, 0] = grid[2, 0, 1] = True
    text = "###/..#|.../..#"
    np.testing.assert_array_equal(cells_of(text), cells_of(grid))
    np.testing.assert_array_equal(cells_of(text), cells_of(grid.tolist()))
    np.testing.assert_array_equal(cells_of("###\n..#\n\n...\n..#\n"), cells_of(grid))
    assert text_of(cells_of(grid)) == text
    np.testing.assert_array_equal(SoftBody3D(body=grid).cells, cells_of(grid))


def test_a_body_has_one_spelling():
    spellings = ("##/##", "##\n##", "|##//##||", "\n##\n##\n\n\n\n")
    assert {name_of(SoftBody3D(body=body).cells) for body in spellings} == {"##/##"}
    assert {name_of(cells_of(body)) for body in ("##|##", "##||##")} == {"##|##"}
    assert name_of(SoftBody3D(body="####").cells) == "worm"


def test_in_the_plane_a_body_is_one_layer_or_a_grid_of_two_axes():
    cells = cells_of("##/#.", axes=PLANE)
    np.testing.assert_array_equal(cells, [[0, 0], [0, 1], [1, 1]])
    np.testing.assert_array_equal(cells_of([[1, 1], [0, 1]], axes=PLANE), cells)
    assert text_of(cells) == "##/#."
    for wrong, message in (("#|#", "2 layers; allowed in the plane: one"), ("#.#", "in 2 parts")):
        with pytest.raises(InvalidSettings, match=message):
            cells_of(wrong, axes=PLANE)
    with pytest.raises(InvalidSettings, match="2 axes, x, z; this one has 3"):
        cells_of(np.ones((2, 2, 2)), axes=PLANE)


def test_a_large_body_can_be_stepped():
    world = SoftBody3D(body=np.ones((6, 6, 6), bool))
    state, _ = world.reset(jax.random.key(0))
    after, _ = step(world, jax.random.key(0), state, {"robot": jnp.full((1, 216), 0.0101)})
    assert jnp.isfinite(after.position).all()
    assert not after.diverged
    assert (jnp.abs(after.momentum).max(1) > 1e-4).all(), "it swells"


def test_a_body_is_moved_to_the_corner_of_its_grid():
    np.testing.assert_array_equal(cells_of(".##/..."), [[0, 0, 0], [1, 0, 0]])


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("", "empty"),
        ("../..", "empty"),
        (np.zeros((2, 2, 2)), "empty"),
        ("#.#", r"in 2 parts .*\(x, y, z\) = \(2, 0, 0\)"),
        ("#./.#", "in 2 parts"),
        ("#" * (MAX_VOXELS + 1), f"{MAX_VOXELS + 1} voxels; allowed: at most {MAX_VOXELS}"),
        ("worms", "'w' is no part of one; allowed: worm, biped, tripod, or layers"),
        ("##/#", r"different sizes \(2 rows of 1, 2 rows of 2\)"),
        (np.ones((2, 2)), r"3 axes, x, y, z; .*shape \(2, 2\)"),
        (np.full((1, 1, 2), 2), "true and false"),
        ([[[True], [True, False]]], "rows of one length"),
    ],
)
def test_what_is_no_body_is_refused_with_what_is_allowed(body, message):
    with pytest.raises(InvalidSettings, match=message):
        cells_of(body)
    with pytest.raises(InvalidSettings, match=message):
        SoftBody3D(body=body)


@given(
    st.lists(
        st.tuples(st.integers(0, 3), st.integers(0, 2), st.integers(0, 3)), min_size=1, max_size=20
    )
)
def test_a_body_written_out_is_read_as_the_same_body_or_refused_for_its_parts(places):
    grid = np.zeros((4, 3, 4), bool)
    grid[tuple(np.array(places).T)] = True
    try:
        cells = cells_of(grid)
    except InvalidSettings as error:
        assert re.search(r"is in \d+ parts", str(error))  # noqa: PT017 - one of two outcomes
        return
    np.testing.assert_array_equal(cells_of(text_of(cells)), cells)


# Gravity


def test_gravity_is_that_of_the_equations():
    steps = 400
    sine = {"evolution": (2, 1.0), "sin": (5, 1.0)}
    moment = np.arange(steps) / steps
    for name, (cycles, most) in sine.items():
        found = np.asarray(schedule(name, steps))
        np.testing.assert_allclose(
            found[:, 0], most * np.sin(2 * np.pi * cycles * moment), atol=1e-5
        )
    step = np.asarray(schedule("step", steps))
    np.testing.assert_array_equal(step[: steps // 2 + 1, 0], 0)
    np.testing.assert_array_equal(step[steps // 2 + 1 :, 0], 3)
    for name in ("evolution", "flat", "step", "sin"):
        np.testing.assert_allclose(np.linalg.norm(schedule(name, steps), axis=1), 9.8, rtol=1e-6)
    np.testing.assert_allclose(schedule("even", 3), [[0, 0, -9.81]] * 3, rtol=1e-6)


def test_any_function_can_be_a_program():
    found = schedule(tilt(lambda moment: 2 * moment), 4)
    np.testing.assert_allclose(found[:, 0], [0, 0.5, 1, 1.5])
    assert SoftBody3D(gravity=tilt(lambda moment: 0.1)).gravity is not None


def test_plans_know_the_programs_by_name():
    settings = settings_of(SoftBody3D)
    assert settings().gravity == SoftBody3D().gravity == "even"
    with pytest.raises(pydantic.ValidationError, match="'even', 'evolution', 'flat'"):
        settings(gravity="uphill")


def test_what_is_no_program_is_refused():
    with pytest.raises(UnknownName, match="evolution"):
        schedule("evolutoin", 4)
    with pytest.raises(UnknownName, match="uphill"):
        SoftBody3D(gravity="uphill")
    with pytest.raises(InvalidSettings, match="gives 3 numbers"):
        schedule(lambda moment: jnp.zeros(2), 5)
    with pytest.raises(InvalidSettings, match=r"at step 3 of 5 .*tilts \(g_x\) below 9.8"):
        schedule(tilt(lambda moment: 20 * moment), 5)


# The world

step = eqx.filter_jit(SoftBody3D.step)


@pytest.fixture(scope="module")
def played():
    """A worm that is tilted and driven by a few waves: states and outcomes."""
    world = SoftBody3D(steps=60, gravity="step")
    state, _ = world.reset(jax.random.key(0))
    states, outcomes = [state], []
    for k in range(60):
        edge = 0.01 * (1 + 0.1 * jnp.sin(0.3 * k + jnp.arange(4.0)))
        state, outcome = step(world, jax.random.key(k), state, {"robot": edge[None]})
        states.append(state)
        outcomes.append(outcome)
    return world, states, outcomes


def test_rewards_add_up_to_the_way_made(played):
    world, states, outcomes = played
    ways = [float(centre(world.body, state)[0]) for state in states]
    total = sum(float(outcome.reward["robot"][0]) for outcome in outcomes)
    assert abs(total) > 1e-5
    np.testing.assert_allclose(total, ways[-1] - ways[0], atol=1e-7)


def test_time_runs_out_after_the_steps_and_nothing_terminates(played):
    truncated = [bool(outcome.truncated["robot"][0]) for outcome in played[2]]
    assert truncated == [False] * 59 + [True]
    assert not any(outcome.terminated["robot"][0] for outcome in played[2])


def test_the_clock_is_right_after_ten_million_steps():
    world = SoftBody3D(body="#", steps=10**7)
    state, _ = world.reset(jax.random.key(0))
    late = eqx.tree_at(lambda each: each.steps, state, jnp.int32(10**7))
    periods = Fraction(float(world.frequency)) * Fraction(float(world.material.time_step)) * 10**7
    angle = 2 * np.pi * float(periods % 1)
    np.testing.assert_allclose(world.sense(late).clock, [np.sin(angle), np.cos(angle)], atol=1e-6)


def test_a_robot_that_diverges_terminates_and_earns_nothing():
    world = SoftBody3D(steps=60, gravity="step")  # as before: the same program
    state, _ = world.reset(jax.random.key(0))
    torn = eqx.tree_at(lambda s: s.position, state, state.position.at[0, 3].add(5.0))
    _, outcome = step(world, jax.random.key(0), torn, {"robot": jnp.full((1, 4), 0.01)})
    assert outcome.terminated["robot"].tolist() == [True]
    assert outcome.reward["robot"].tolist() == [0.0]


def test_edges_out_of_bounds_are_as_good_as_the_bounds():
    world = SoftBody3D(body="##")
    state, _ = world.reset(jax.random.key(0))
    for wish, edge in ((1.0, 0.012), (0.0, 0.0025)):
        after, _ = step(world, jax.random.key(0), state, {"robot": jnp.full((1, 2), wish)})
        np.testing.assert_allclose(after.edge, edge, rtol=1e-6)
    space = world.roles["robot"].action
    np.testing.assert_allclose([space.low, space.high], [0.0025, 0.012], rtol=1e-6)


def test_the_material_is_a_sweep_away():
    """One program, three frictions: the slippery worm glides, the rough one stays."""

    @jax.jit
    @jax.vmap
    def slid(friction):
        material = Material(static_friction=friction, dynamic_friction=friction)
        world = SoftBody3D(body="##", gravity=tilt(lambda moment: 1.0), material=material)
        state, _ = world.reset(jax.random.key(0))

        pull = world.gravity(jnp.float32(0))

        def rest(state, _):
            return world.move(state, jnp.full(2, 0.01), pull), None

        state, _ = jax.lax.scan(rest, state, None, length=300)
        return centre(world.body, state)[0] - 0.01

    rough, half, slippery = slid(jnp.array([1.0, 0.05, 0.0]))
    assert 10 * abs(rough) < half < slippery


def test_bodies_of_one_size_are_one_program_and_padding_changes_nothing():
    """A worm and a square of four, and a worm in room for six."""
    traces = []

    @eqx.filter_jit
    def go(world, action):
        traces.append(None)
        state, _ = world.reset(jax.random.key(0))
        for _ in range(3):
            state, outcome = world.step(jax.random.key(0), state, action)
        return outcome

    edge = jnp.array([[0.011, 0.009, 0.0105, 0.01]])
    worm, square = (SoftBody3D(body=body, max_voxels=4, steps=9) for body in ("worm", "##/##"))
    found = [go(world, {"robot": edge}) for world in (worm, square, worm)]
    assert len(traces) == 1
    assert not np.allclose(found[0].reward["robot"], found[1].reward["robot"])
    wide = SoftBody3D(max_voxels=6, steps=9)
    outcome = go(wide, {"robot": jnp.pad(edge, ((0, 0), (0, 2)))})
    plain = go(SoftBody3D(steps=9), {"robot": edge})
    np.testing.assert_allclose(outcome.reward["robot"], plain.reward["robot"], rtol=1e-4)
    readings, own = outcome.observation["robot"][0], plain.observation["robot"][0]
    np.testing.assert_allclose(readings[:12], own[:12], rtol=1e-4, atol=1e-5)
    np.testing.assert_array_equal(readings[12:18], 0)
    for role in wide.roles.values():
        assert role.observation.used.sum() == 14
        assert role.action.used.tolist() == [True] * 4 + [False] * 2


def test_a_padded_robot_is_shown_without_its_padding():
    world = SoftBody3D(body="##", max_voxels=4, steps=3)
    scene = watch(world, lambda key, seen: {"robot": jnp.full((1, 4), 0.01)}, jax.random.key(0))
    assert scene.position.shape == (4, 2, 3)
    assert scene.title == "Soft robot: ##"


def test_settings_out_of_range_are_named():
    with pytest.raises(EthogramError, match="frequency = -1"):
        SoftBody3D(frequency=-1.0)
    with pytest.raises(InvalidSettings, match=r"shortest = 2.* and longest = 0\.1"):
        SoftBody3D(shortest=2.0, longest=0.1)
    with pytest.raises(InvalidSettings, match="max_voxels = 3; the body has 4 voxels"):
        SoftBody3D(max_voxels=3)
    with pytest.raises(EthogramError, match="elastic_modulus"):
        SoftBody3D(material=Material(elastic_modulus=0.0))


# Its scene


def test_a_scene_shows_where_voxels_are_how_large_and_how_turned(played):
    world, states, _ = played
    frames = jax.tree.map(lambda *leaves: np.stack(leaves), *map(world.pose, states))
    scene = scene_of_poses("worm", Pose(*frames), resting=0.01, seconds=0.5)
    again = Scene.from_dataset(scene.to_dataset())
    for found in (scene, again):
        assert found.position.shape == (61, 4, 3)
        last = states[-1]
        np.testing.assert_allclose(found.position[-1], last.position.T, rtol=1e-6)
        np.testing.assert_allclose(found.orientation[-1], last.orientation.T, rtol=1e-6)
        np.testing.assert_allclose(found.scale[-1], last.edge / 0.01, rtol=1e-6)
        assert {shape.kind for shape in found.shapes} == {"cube"}
        assert found.shapes[0].size == 0.005
        expected = np.sign(np.round((found.scale - 1) / 0.02 / 2, 6)) * (
            np.abs(found.scale - 1) > 0.02
        )
        np.testing.assert_array_equal(found.tint, 1 + expected)
    way = 1000 * (centre(world.body, states[-1])[0] - centre(world.body, states[0])[0])
    np.testing.assert_allclose(scene.series["distance (mm)"][-1, 0], way, atol=1e-4)
    assert scene.captions[2].startswith("1.000 s: ")
    left, bottom, right, top = scene.bounds
    assert left < scene.position[..., 0].min() < scene.position[..., 0].max() < right
    assert bottom <= 0 < scene.position[..., 2].max() < top
