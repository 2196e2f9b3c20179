"""The kernel of soft bodies in the plane does what the steps in JAX do, in each of its variants."""

import dataclasses
import json
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
from jax import Array, lax
from tests.lacking import lacking
from tests.physics.kernels import FUSED, USABLE, assert_sound

from ethogram.core.errors import EthogramError, InvalidSettings
from ethogram.physics import native
from ethogram.physics.lattice2d import (
    Lattice,
    Material,
    State,
    Terrain,
    at_rest,
    avalanches,
    lattice,
    lattices,
    simulate,
)
from ethogram.physics.lattice2d.squares import area_ratio, squares

BEST = USABLE[0] if USABLE else "auto"
REFERENCE = json.loads((Path(__file__).parent / "reference" / "softbody2d.json").read_text())
BODIES = REFERENCE["bodies"]
EARTH = 9.8
HOOK = [(0, 0), (1, 0), (2, 0), (2, 1), (3, 2), (2, 2), (0, 1)]  # two meet in a vertex alone


@pytest.fixture(autouse=True, scope="module")
def _a_kernel() -> None:
    if not USABLE:
        lacking("no kernel was built, or none for this processor: see ethogram doctor")


@pytest.fixture(autouse=True)
def sixty_four_bits() -> Any:
    with jax.enable_x64(True):
        yield


def body(cells: Any) -> Lattice:
    return lattice(np.array(cells))


def drawn(rows: list[str]) -> np.ndarray:
    """Cells of a body as it is written, the bottom row first."""
    return np.array(
        [(x, y) for y, row in enumerate(reversed(rows)) for x, c in enumerate(row) if c == "#"]
    )


def random_cells(voxels: int) -> np.ndarray:
    rng = np.random.default_rng(voxels)
    cells = {(0, 0)}
    while len(cells) < voxels:
        cell = list(sorted(cells)[rng.integers(len(cells))])
        cell[rng.integers(2)] += rng.choice([-1, 1])
        cells.add(tuple(cell))
    found = np.array(sorted(cells))
    return found - found.min(0)


def alone(shapes: Lattice, number: int) -> Lattice:
    return jax.tree.map(itemgetter(number), shapes)


def rigid_bodies(shape: Lattice) -> np.ndarray:
    """Which are no padding."""
    return np.asarray(shape.voxel[..., 0] < shape.voxels)


def valley() -> Terrain:
    """Ground with a bump, between slopes, under a ceiling that comes lower."""
    ground = [(0.0, 100.0), (10.0, 0.0), (14.0, 0.5), (18.0, 0.0), (40.0, 0.0), (50.0, 100.0)]
    return Terrain(np.array(ground), np.array([(0.0, 13.0), (12.0, 12.0), (30.0, 9.0)]))


def thrown(shape: Lattice, robots: int, *, speed: float, height: float = 4.0) -> State:
    """Robots near the foot of the slope, each part of which moves at a speed of its own."""
    start = at_rest(shape, (robots,), place=(9.5, height))
    speeds = np.random.default_rng(robots).normal(0, speed, start.velocity.shape)
    return dataclasses.replace(start, velocity=jnp.asarray(speeds))


def waves(shape: Lattice, steps: int, robots: int) -> Array:
    phase = np.random.default_rng(robots).uniform(-np.pi, np.pi, (shape.voxels, robots))
    return jnp.asarray(np.sin(np.arange(steps)[:, None, None] / 8 + phase))


def in_type(tree: Any, dtype: Any) -> Any:
    return jax.tree.map(lambda x: x.astype(dtype) if x.dtype == jnp.float64 else x, tree)


@partial(jax.jit, static_argnames="kernel")
def moved(shape: Lattice, state: State, control: Array, kernel: str = BEST) -> State:
    """Robots of the default material in the valley, all in one call."""
    gravity, terrain = jnp.asarray(EARTH, control.dtype), in_type(valley(), control.dtype)
    return simulate(
        shape, Material(), state, control, gravity=gravity, terrain=terrain, kernel=kernel
    )


def robots(state: State, which: Any) -> State:
    return jax.tree.map(lambda leaf: leaf[..., which], state)


def assert_same_bits(one: State, other: State) -> None:
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(a, b)


def assert_near(found: State, expected: State, there: Any) -> None:
    """Equal but for rounding, in all that is no padding."""
    for name in ("moved", "heading", "velocity", "change", "contact"):
        a, b = (np.asarray(getattr(state, name)) for state in (found, expected))
        np.testing.assert_allclose(a[..., there, :], b[..., there, :], 0, 1e-9, err_msg=name)
    np.testing.assert_allclose(found.rope, expected.rope, rtol=0, atol=1e-9)


@pytest.mark.parametrize("kernel", USABLE)
def test_area_ratios_are_those_of_the_reference(kernel: str) -> None:
    traces = REFERENCE["area_ratio_traces"]
    for name, material, cells in (
        ("1x1 soft", Material.soft(), [(0, 0)]),
        ("1x1 default", Material(), [(0, 0)]),
        ("2x1 soft, pulse left", Material.soft(), [(0, 0), (1, 0)]),
    ):
        shape = body(cells)
        control = np.zeros((40, shape.voxels))
        control[1:13, 0], control[13:25, 0] = 1, -1

        def advance(
            state: State, now: Array, shape: Lattice = shape, material: Material = material
        ) -> tuple[State, Array]:
            after = simulate(shape, material, state, now[None], gravity=0.0, kernel=kernel)
            at = squares(shape, material, after.moved, after.heading)
            return after, area_ratio(material, at)

        _, found = lax.scan(advance, at_rest(shape, terrain=False), jnp.asarray(control))
        np.testing.assert_allclose(found, traces[name], rtol=0, atol=2e-4)


def tau(voxels: int) -> float:
    return 6.092750496194226e-3 - 1.4273597198968677e-4 * voxels + 9.238294116972325e-7 * voxels**2


@pytest.mark.parametrize("kernel", USABLE)
def test_avalanches_of_the_hand_made_bodies_are_those_of_the_reference(kernel: str) -> None:
    """But of two voxels of the biped, which are within 1e-5 of the threshold."""
    stacked = lattices([drawn(each["rows_top_to_bottom"]) for each in BODIES.values()])

    def of(shape: Lattice) -> Any:
        return avalanches(shape, Material.soft(), tau(20), kernel=kernel)

    size, duration = jax.jit(jax.vmap(of))(stacked)
    for name, sizes, durations in zip(BODIES, size, duration, strict=True):
        np.testing.assert_array_equal(durations, BODIES[name]["durations"], err_msg=name)
        differ = int((sizes != np.array(BODIES[name]["sizes"])).sum())
        assert differ <= (2 if name == "biped" else 0), name


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_avalanches_are_the_same_in_any_company_and_padding_has_none(dtype: Any) -> None:
    cells = [random_cells(voxels) for voxels in (5, 20)]
    with jax.enable_x64(dtype == jnp.float64):

        @jax.jit
        def of(shape: Lattice, threshold: Any) -> Any:
            return avalanches(shape, Material.soft(), threshold, kernel=BEST)

        thresholds, shapes = jnp.array([0.002, 0.004]), lattices(cells)
        assert shapes.centre.dtype == thresholds.dtype == dtype
        size, duration = jax.vmap(jax.vmap(of, (0, None)), (None, 0))(shapes, thresholds)
        assert size.shape == (2, 2, 20)
        assert size.dtype == duration.dtype == jnp.int32
        assert not size[:, 0, 5:].any()
        assert not duration[:, 0, 5:].any()
        for number, each in enumerate(cells):
            expected = of(lattice(each), thresholds[1])
            np.testing.assert_array_equal(size[1, number, : len(each)], expected.size)
            np.testing.assert_array_equal(duration[1, number, : len(each)], expected.duration)


def test_avalanches_that_do_not_end_are_ended_as_in_jax() -> None:
    shape = body([(0, 0), (1, 0), (1, 1)])
    ours, theirs = (
        avalanches(shape, Material.soft(), -1.0, longest=20, kernel=kernel)
        for kernel in (BEST, "none")
    )
    assert (theirs.duration == 19).all()
    assert (theirs.size == 3).all()
    np.testing.assert_array_equal(ours.duration, theirs.duration)
    np.testing.assert_array_equal(ours.size, theirs.size)


@pytest.mark.parametrize("kernel", USABLE)
def test_a_kernel_moves_all_of_a_state_as_jax_does(kernel: str) -> None:
    """A padded hook that falls, slides and is crushed: contacts with ground and ceiling, ropes."""
    shape, steps, count = alone(lattices([np.array(HOOK)], len(HOOK) + 2), 0), 20, 5
    start, control = thrown(shape, count, speed=4.0), waves(shape, 3 * steps, count)
    found = expected = start
    for now in np.split(control, 3):
        found = moved(shape, found, now, kernel=kernel)
        expected = moved(shape, expected, now, kernel="none")
        assert_near(found, expected, rigid_bodies(shape))
        assert (found.contact[:, 0] > 0).any(), "they touch"


@pytest.mark.parametrize("material_of", [Material, Material.soft], ids=["default", "soft"])
def test_random_bodies_move_as_in_jax_without_a_terrain(material_of: Any) -> None:
    material, steps, count = material_of(), 300, 2
    shapes = lattices([random_cells(voxels) for voxels in (4, 9, 14)])

    @partial(jax.jit, static_argnames="kernel")
    def of(shapes: Lattice, control: Array, kernel: str) -> State:
        def one(shape: Lattice) -> State:
            start = at_rest(shape, (count,), terrain=False)
            return simulate(shape, material, start, control, gravity=0.0, kernel=kernel)

        return jax.vmap(one)(shapes)

    control = waves(alone(shapes, 2), steps, count)
    found, expected = (of(shapes, control, kernel) for kernel in (BEST, "none"))
    for number in range(3):
        ours, theirs = (jax.tree.map(itemgetter(number), state) for state in (found, expected))
        assert_near(ours, theirs, rigid_bodies(alone(shapes, number)))


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_kernels_with_fused_arithmetic_give_the_same_bits(dtype: Any) -> None:
    if len(FUSED) < 2:
        pytest.skip("this processor has not both")
    shape, steps, count = body(HOOK), 200, 19
    start, control = thrown(shape, count, speed=12.0), waves(shape, steps, count)
    start, control, shape = in_type((start, control, shape), dtype)
    one, other = (moved(shape, start, control, kernel=name) for name in FUSED)
    assert (one.contact > 0).any()
    assert_same_bits(one, other)


@pytest.mark.parametrize("kernel", USABLE)
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_a_robot_has_the_same_bits_in_any_company_and_in_any_calls(dtype: Any, kernel: str) -> None:
    shape, steps, count = body(HOOK), 100, 19
    start, control = thrown(shape, count, speed=12.0), waves(shape, steps, count)
    start, control, shape = in_type((start, control, shape), dtype)
    together = moved(shape, start, control, kernel=kernel)
    order = np.random.default_rng(0).permutation(count)[:11]
    mixed = moved(shape, robots(start, order), control[..., order], kernel=kernel)
    assert_same_bits(mixed, robots(together, order))
    single = moved(shape, robots(start, 4), control[..., 4], kernel=kernel)
    assert_same_bits(single, robots(together, 4))
    step_by_step, _ = lax.scan(
        lambda state, now: (moved(shape, state, now[None], kernel=kernel), None), start, control
    )
    assert_same_bits(step_by_step, together)


@pytest.mark.parametrize("unsound", [np.nan, np.inf, -1e300])
@pytest.mark.parametrize("lane", [0, 11])
def test_a_robot_that_diverges_harms_no_other(lane: int, unsound: float) -> None:
    shape, steps, count = body(HOOK), 60, 19
    start, control = thrown(shape, count, speed=12.0), waves(shape, steps, count)
    sound = moved(shape, start, control)
    broken = moved(shape, start, control.at[7, 3, lane].set(unsound))
    others = np.delete(np.arange(count), lane)
    assert_same_bits(robots(broken, others), robots(sound, others))
    assert not np.isfinite(broken.moved[..., lane]).all()


def test_vmap_is_the_same_bits_as_lanes_and_nests() -> None:
    shape, steps = body(HOOK), 30
    control = waves(shape, steps, 6).reshape(steps, shape.voxels, 2, 3)
    start = thrown(shape, 6, speed=5.0)
    together = moved(shape, start, control.reshape(steps, -1, 6))
    start = jax.tree.map(lambda x: x.reshape(*x.shape[:-1], 2, 3), start)
    one = partial(moved, shape)
    inner = jax.vmap(jax.vmap(one, -1, -1), -2, -2)
    nested = jax.tree.map(lambda x: x.reshape(*x.shape[:-2], 6), inner(start, control))
    assert_same_bits(nested, together)
    lanes = jax.vmap(one, -1, -1)(start, control)  # of which each has lanes already
    assert_same_bits(jax.tree.map(lambda x: x.reshape(*x.shape[:-2], 6), lanes), together)


def test_vmap_over_bodies_materials_and_terrains_takes_each_with_its_robots() -> None:
    cells, steps = [np.array([(0, 0), (1, 0)]), np.array(HOOK)], 40
    shapes, control = lattices(cells), waves(body(HOOK), steps, 3)
    frictions, slopes = jnp.array([0.1, 3.0]), jnp.array([0.0, 0.2])

    def run(shape: Lattice, friction: Array, slope: Array, control: Array) -> Array:
        material = Material(friction=friction)
        ground = jnp.array([[0.0, 0.0], [1.0, 0.0]]).at[1, 1].set(slope)
        start = at_rest(shape, place=(2.0, 0.3))
        return simulate(
            shape, material, start, control, gravity=9.8, terrain=Terrain(ground), kernel=BEST
        ).moved

    each = jax.vmap(run, (None, None, None, -1))
    both = jax.vmap(jax.vmap(each, (0, None, None, None)), (None, 0, 0, None))
    found = jax.jit(both)(shapes, frictions, slopes, control)
    assert found.shape[:3] == (2, 2, 3)
    assert jnp.abs(found[0] - found[1]).max() > 0.01
    for number, each in enumerate(cells):
        shape = body(each)
        expected = run(shape, frictions[1], slopes[1], control[:, : len(each), 2])
        there = rigid_bodies(shape)
        place = found[1, number, 2][..., : shape.bodies]
        np.testing.assert_array_equal(place[..., there], expected[..., there])


@pytest.mark.slow
def test_derivatives_are_those_of_jax() -> None:
    shape = body([(0, 0)])
    control = waves(shape, 2, 3)

    def gone(control: Array, friction: Array, kernel: str) -> Array:
        material, start = Material(friction=friction), at_rest(shape, terrain=False)
        return simulate(shape, material, start, control, gravity=EARTH, kernel=kernel).moved.var()

    @partial(jax.jit, static_argnames="kernel")
    def of(kernel: str) -> Any:
        return jax.vmap(jax.grad(partial(gone, kernel=kernel)), (-1, None))(control, 0.5)

    ours, theirs = of(BEST), of("none")
    assert jnp.abs(theirs).max() > 0
    np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-15)


def test_what_is_wrong_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # which would come first
    shape = body(HOOK)
    start, control = at_rest(shape, (4,)), waves(shape, 2, 4)
    narrow = dataclasses.replace(start, rope=start.rope.astype(jnp.float32))
    for state, wrong, message in (
        (start, control[:, :2], r"control has the shape \(2, 2, 4\).*allowed: \(2, 7, 4\)"),
        (narrow, control, "state.rope has .* the type float32; allowed: .*float64"),
    ):
        with pytest.raises(InvalidSettings, match=message):
            simulate(shape, Material(), state, wrong, gravity=0.0, terrain=valley())
    for run in (
        lambda: simulate(
            shape, Material(), start, control, gravity=0.0, terrain=valley(), kernel="x"
        ),
        lambda: avalanches(shape, Material.soft(), 0.004, kernel="x"),
    ):
        with pytest.raises(EthogramError, match="'x'"):
            run()


def test_the_kernel_itself_refuses_what_is_wrong() -> None:
    from ethogram.physics.lattice2d.kernel import AVALANCHES, avalanches, call, target

    shape, name = body(HOOK), target(jnp.float64, BEST)
    start, control, zero = at_rest(shape, (4,)), waves(shape, 2, 4), jnp.zeros(())
    bare = dataclasses.replace(start, contact=start.contact[:0])
    beyond = eqx.tree_at(lambda s: s.voxel, shape, shape.voxel + 5)
    alien = eqx.tree_at(lambda s: s.body, shape, shape.body * 0)
    outside = eqx.tree_at(lambda s: s.body, shape, shape.body - 7)
    for body_of, state, commanded, message in (
        (shape, start, control[..., :3], "control: it has 3 robots; it should have 4"),
        (shape, start, control[:, :5], "control: it has 5 entries along an axis"),
        (shape, start, control.astype(jnp.float32), "control: it should be of type f64"),
        (shape, bare, control, "state.contact: it has 0 points; it should have 8"),
        (beyond, start, control, "lattice.voxel: there is no voxel"),
        (outside, start, control, "lattice.body: there is no rigid body -"),
        (alien, start, control, "lattice.body: rigid body 0 has no voxel"),
    ):
        arguments = body_of, Material(), zero, valley(), state, commanded
        with pytest.raises(Exception, match=message):
            jax.block_until_ready(call(name, *arguments).moved)
    found = avalanches(target(jnp.float64, BEST, AVALANCHES), 10)
    with pytest.raises(Exception, match="threshold: it has 2 robots; it should have 1"):
        jax.block_until_ready(found(shape, Material.soft(), jnp.ones(2)))


def test_other_platforms_than_cpus_get_the_steps_in_jax(monkeypatch: pytest.MonkeyPatch) -> None:
    from ethogram.physics import kernel_calls

    shape = body([(0, 0)])
    start, control = at_rest(shape, terrain=False), waves(shape, 1, 2)
    monkeypatch.setattr(kernel_calls, "backends", lambda: ["cpu", "cuda"])

    def run(control: Array) -> Array:
        return simulate(shape, Material(), start, control, gravity=0.0, kernel=BEST).moved

    traced = jax.jit(jax.vmap(run, -1)).trace(control)
    programs = {
        platform: traced.lower(lowering_platforms=(platform,)).as_text()
        for platform in ("cpu", "cuda")
    }
    assert "ethogram_lattice2d" in programs["cpu"]
    assert "ethogram_lattice2d" not in programs["cuda"]


def test_a_record_names_the_kernel() -> None:
    assert native.implementation("lattice2d") == native.variant()
    assert native.implementation("lattice2d", "none") == "jax"


@pytest.mark.slow
def test_a_build_that_checks_memory_and_arithmetic_finds_nothing(tmp_path: Path) -> None:
    assert_sound("lattice2d", __file__, tmp_path)
