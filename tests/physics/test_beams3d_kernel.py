"""The kernel written by hand does what the steps in JAX do, whichever of its variants runs."""

import dataclasses
from functools import partial
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jax import Array, lax
from tests.lacking import lacking
from tests.physics.kernels import FUSED, USABLE, assert_sound

from ethogram.core.errors import EthogramError, InvalidSettings
from ethogram.physics.beams3d import (
    Lattice,
    Material,
    Size,
    State,
    at_rest,
    lattice,
    pad,
    simulate,
    stack,
)

BEST = USABLE[0] if USABLE else "auto"


@pytest.fixture(autouse=True, scope="module")
def _a_kernel() -> None:
    if not USABLE:
        lacking("no kernel was built, or none for this processor: see ethogram doctor")


ELL = [(0, 0, 0), (1, 0, 0), (1, 0, 1)]
RING = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 0, 1), (2, 0, 2), (1, 0, 2), (0, 0, 2)]
EARTH = (0.5, 0.2, -9.81)


@pytest.fixture(autouse=True)
def sixty_four_bits() -> Any:
    with jax.enable_x64(True):
        yield


def body(cells: Any) -> Lattice:
    return lattice(np.array(cells))


def waves(shape: Lattice, steps: int, robots: int, amplitude: float = 0.6) -> Array:
    """Edges that swing, each with a phase of its own."""
    phase = np.random.default_rng(robots).uniform(-np.pi, np.pi, (shape.voxels, robots))
    time = np.arange(steps)[:, None, None] * 0.0358
    return jnp.asarray(0.01 * (1 + amplitude * np.sin(time + phase)))


def pulls(steps: int) -> Array:
    return jnp.tile(jnp.array(EARTH), (steps, 1))


def in_type(state: State, dtype: Any) -> State:
    return jax.tree.map(lambda x: x.astype(dtype) if x.dtype == jnp.float64 else x, state)


@partial(jax.jit, static_argnames=("floor", "kernel"))
def moved(
    shape: Lattice, state: State, edges: Array, gravity: Array, floor: bool = True, kernel: str = ""
) -> State:
    return simulate(shape, Material(), state, edges, gravity, floor=floor, kernel=kernel or BEST)


@partial(jax.jit, static_argnames="kernel")
def moved_step_by_step(
    shape: Lattice, state: State, edges: Array, gravity: Array, kernel: str = ""
) -> State:
    def advance(state: State, now: tuple[Array, Array]) -> tuple[State, None]:
        edge, pull = now
        after = simulate(shape, Material(), state, edge[None], pull[None], kernel=kernel or BEST)
        return after, None

    return lax.scan(advance, state, (edges, gravity))[0]


def assert_same_bits(one: State, other: State) -> None:
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(a, b)


def robots(state: State, which: Any) -> State:
    return jax.tree.map(lambda leaf: leaf if leaf.ndim == 0 else leaf[..., which], state)


@pytest.mark.parametrize("kernel", USABLE)
def test_a_kernel_moves_all_of_a_state_as_jax_does(kernel: str) -> None:
    """A ring that closes on itself: bends large and small, contacts, friction; two blocks."""
    shape, steps, count = body(RING), 300, 19
    start, edges = at_rest(shape, Material(), (count,)), waves(shape, steps, count)
    found = moved(shape, start, edges, pulls(steps), kernel=kernel)
    expected = moved(shape, start, edges, pulls(steps), kernel="none")
    assert found.memory.small.any(), "angles large and small"
    assert not found.memory.small.all(), "angles large and small"
    assert int(found.steps) == steps
    for name, within in {
        "position": 1e-10,
        "orientation": 1e-8,
        "momentum": 1e-8,
        "angular_momentum": 1e-8,
        "force": 1e-4,
        "edge": 0,
        "strain": 1e-8,
        "diverged": 0,
    }.items():
        a, b = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(a, b, rtol=0, atol=within, err_msg=name)
    np.testing.assert_array_equal(found.memory.small, expected.memory.small)
    np.testing.assert_allclose(
        found.memory.deformation, expected.memory.deformation, rtol=0, atol=1e-8
    )


def random_body(rng: np.random.Generator, voxels: int) -> list[tuple[int, ...]]:
    cells = {(0, 0, 0)}
    while len(cells) < voxels:
        cell = list(sorted(cells)[rng.integers(len(cells))])
        cell[rng.integers(3)] += rng.choice([-1, 1])
        cells.add(tuple(cell))
    return sorted(cells)


def compare_random_bodies(bodies: int, voxels: int, steps: int, every: int) -> None:
    """Random bodies in JAX and by the kernel, under random commands and gravity programs.

    Rounding grows, where a voxel that just comes to rest, slides or touches does so a step later:
    from a difference of 1e-9 m on, such a body is compared no further.
    """
    rng = np.random.default_rng(4)
    size = Size.for_voxels(voxels)
    parted = []
    for number in range(bodies):
        cells = random_body(rng, int(rng.integers(1, voxels + 1)))
        shape = pad(body(cells), size)
        count = 3
        start = at_rest(shape, Material(), (count,))
        lift = rng.uniform(0, 0.005) - float(start.position[2, : len(cells)].min()) + 0.005
        start = dataclasses.replace(start, position=start.position.at[2].add(lift))
        amplitude, phase, frequency = (
            rng.uniform(*bounds, (voxels, count))
            for bounds in ((0, 0.5), (-np.pi, np.pi), (10, 60))
        )
        time = np.arange(steps)[:, None, None] * 1.4235e-4
        edges = jnp.asarray(0.01 * (1 + amplitude * np.sin(2 * np.pi * frequency * time + phase)))
        tilt = rng.uniform(-3, 3, 2)[:, None, None] * np.sin(
            rng.uniform(0, 40, (2, 1, count)) * time[:, 0]
        )
        down = np.full((steps, count), -9.81)
        gravity = jnp.asarray(np.stack([tilt[0], tilt[1], down], 1))
        ours = theirs = start
        for first in range(0, steps, every):
            now = slice(first, first + every)
            ours = moved(shape, ours, edges[now], gravity[now])
            theirs = moved(shape, theirs, edges[now], gravity[now], kernel="none")
            off = float(jnp.abs(ours.position - theirs.position)[:, : len(cells)].max())
            if not off < 1e-9:
                parted.append((number, len(cells), first, off))
                break
        else:
            np.testing.assert_array_equal(ours.diverged, theirs.diverged)
    assert len(parted) <= bodies // 10, f"body, voxels, step and distance: {parted}"


def test_random_bodies_move_as_in_jax() -> None:
    compare_random_bodies(bodies=4, voxels=8, steps=300, every=100)


@pytest.mark.slow
def test_fifty_random_bodies_of_up_to_sixty_four_voxels_move_as_in_jax() -> None:
    compare_random_bodies(bodies=50, voxels=64, steps=2000, every=100)


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_kernels_with_fused_arithmetic_give_the_same_bits(dtype: Any) -> None:
    if len(FUSED) < 2:
        pytest.skip("this processor has not both")
    shape, steps, count = body(RING), 300, 19
    start = in_type(at_rest(shape, Material(), (count,)), dtype)
    edges = waves(shape, steps, count)
    one, other = (moved(shape, start, edges, pulls(steps), kernel=name) for name in FUSED)
    assert_same_bits(one, other)


@pytest.mark.parametrize("kernel", USABLE)
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_a_robot_has_the_same_bits_in_any_company(dtype: Any, kernel: str) -> None:
    shape, steps, count = body(RING), 200, 19
    start = in_type(at_rest(shape, Material(), (count,)), dtype)
    edges = waves(shape, steps, count)
    together = moved(shape, start, edges, pulls(steps), kernel=kernel)
    order = np.random.default_rng(0).permutation(count)[:11]
    mixed = moved(shape, robots(start, order), edges[..., order], pulls(steps), kernel=kernel)
    assert_same_bits(mixed, robots(together, order))
    alone = moved(shape, robots(start, 4), edges[..., 4], pulls(steps), kernel=kernel)
    assert_same_bits(alone, robots(together, 4))


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_one_call_has_the_same_bits_as_a_call_for_each_step(dtype: Any) -> None:
    shape, steps, count = body(RING), 200, 5
    start = in_type(at_rest(shape, Material(), (count,)), dtype)
    edges, gravity = waves(shape, steps, count).astype(dtype), pulls(steps).astype(dtype)
    at_once = moved(shape, start, edges, gravity)
    assert (at_once.clearance > 0).any(), "contacts are not looked for in every step"
    assert_same_bits(at_once, moved_step_by_step(shape, start, edges, gravity))


def closing(count: int) -> tuple[Lattice, State, Array]:
    """Rings that swing until they touch themselves."""
    shape = body(RING)
    return shape, at_rest(shape, Material(), (count,)), waves(shape, 300, count, 0.7)


def thrown(count: int) -> tuple[Lattice, State, Array]:
    """Two voxels that do not change, one of which is thrown at the other."""
    shape = body([(0, 0, 0), (3, 0, 0)])
    start = at_rest(shape, Material(), (count,))
    speed = jnp.linspace(2.0, 9.0, count)
    start = dataclasses.replace(start, momentum=start.momentum.at[0, 0].set(speed))
    return shape, start, jnp.full((300, 2, count), 0.01)


def swelling(count: int) -> tuple[Lattice, State, Array]:
    """Two voxels that grow where they are, until one reaches the other."""
    shape = body([(0, 0, 0), (3, 0, 0)])
    grown = jnp.linspace(0.01, 0.03, 300)[:, None, None] * jnp.linspace(0.8, 1.0, count)
    return shape, at_rest(shape, Material(), (count,)), jnp.broadcast_to(grown, (300, 2, count))


@pytest.mark.parametrize("case", [closing, thrown, swelling])
def test_no_contact_is_missed_for_want_of_looking(case: Any) -> None:
    """The same with all pairs looked at in every step."""
    count = 8
    shape, start, edges = case(count)
    gravity = pulls(len(edges))

    @jax.jit
    def looking(start: State) -> tuple[State, Array]:
        def advance(state: State, now: tuple[Array, Array]) -> tuple[State, Array]:
            edge, pull = now
            state = dataclasses.replace(state, clearance=jnp.zeros(count))
            after = simulate(shape, Material(), state, edge[None], pull[None], kernel=BEST)
            return after, after.clearance

        return lax.scan(advance, start, (edges, gravity))

    found = moved(shape, start, edges, gravity)
    always, clearance = looking(start)
    assert (clearance < -1e-4).any(), "they touched"
    assert (clearance > 1e-3).any(), "they were apart"
    np.testing.assert_array_equal(found.position, always.position)


def test_vmap_is_the_same_bits_as_lanes_and_nests() -> None:
    shape, steps = body(ELL), 30
    edges = waves(shape, steps, 6).reshape(steps, 3, 2, 3)
    gravity = pulls(steps)
    start = at_rest(shape, Material())

    def alone(edges: Array, gravity: Array) -> State:
        return simulate(shape, Material(), start, edges, gravity, kernel=BEST)

    together = simulate(
        shape, Material(), at_rest(shape, Material(), (2, 3)), edges, gravity, kernel=BEST
    )
    inner = jax.vmap(alone, (-1, None), -1)
    nested = jax.jit(jax.vmap(inner, (2, None), -2))(edges, gravity)
    np.testing.assert_array_equal(nested.position, together.position)
    first = jax.vmap(jax.vmap(alone, (-1, None)), (2, None))(edges, gravity)
    np.testing.assert_array_equal(jnp.moveaxis(first.position, (0, 1), (2, 3)), together.position)
    own = jnp.stack([gravity, gravity + 1.0])
    pulled = jax.vmap(inner, (2, 0), -2)(edges, own)
    np.testing.assert_array_equal(pulled.position[:, :, 0], together.position[:, :, 0])
    each = jax.vmap(alone, (None, 0))(edges[:, :, 1, 0], own)
    np.testing.assert_array_equal(each.position[1], pulled.position[:, :, 1, 0])


def test_vmap_over_bodies_and_materials_takes_each_with_its_robots() -> None:
    shapes, steps = [body(ELL), body(RING)], 40
    frictions = jnp.array([0.1, 0.9])
    stacked = stack(shapes)
    edges = waves(shapes[1], steps, 5)

    def run(shape: Lattice, friction: Array, edges: Array, kernel: str = BEST) -> Array:
        material = Material(static_friction=friction, dynamic_friction=friction)
        start = at_rest(shape, material)
        return simulate(shape, material, start, edges, pulls(steps), kernel=kernel).position

    over_robots = jax.vmap(run, (None, None, -1))
    over_both = jax.jit(jax.vmap(jax.vmap(over_robots, (0, None, None)), (None, 0, None)))
    found = over_both(stacked, frictions, edges)
    assert found.shape == (2, 2, 5, 3, 7)
    outside = jax.vmap(jax.vmap(jax.vmap(run, (0, None, None)), (None, 0, None)), (None, None, -1))
    np.testing.assert_array_equal(
        outside(stacked, frictions, edges).transpose(1, 2, 0, 3, 4), found
    )
    for number, shape in enumerate(shapes):
        for which, friction in enumerate(frictions):
            alone = run(shape, friction, edges[:, : shape.voxels, 3])
            place = found[which, number, 3, :, : shape.voxels]
            np.testing.assert_array_equal(place, alone)


@given(
    lane=st.integers(0, 18),
    step=st.integers(0, 39),
    voxel=st.integers(0, 6),
    unsound=st.sampled_from([np.nan, np.inf, -np.inf, 1e300, -1.0, 0.0, 5.0]),
)
@settings(max_examples=40)
def test_a_robot_that_diverges_harms_no_other(
    lane: int, step: int, voxel: int, unsound: float
) -> None:
    shape, steps, count = body(RING), 60, 19
    start, edges = at_rest(shape, Material(), (count,)), waves(shape, steps, count)
    sound = moved(shape, start, edges, pulls(steps))
    broken = moved(shape, start, edges.at[step, voxel, lane].set(unsound), pulls(steps))
    others = np.delete(np.arange(count), lane)
    assert_same_bits(robots(broken, others), robots(sound, others))
    if not abs(unsound) < 1e300:
        assert broken.diverged[lane]


def test_a_strain_beyond_a_hundred_is_flagged_as_in_jax() -> None:
    shape, steps = body(ELL), 4
    edges = jnp.full((steps, 3, 3), 0.01).at[2, :, 1].set(0.00004)
    start = at_rest(shape, Material(), (3,))
    for kernel in (BEST, "none"):
        found = moved(shape, start, edges, pulls(steps), kernel=kernel)
        np.testing.assert_array_equal(found.diverged, [False, True, False])


def gone(edges: Array, friction: Array, kernel: str) -> Array:
    """How far a pair of voxels gets, all in one call."""
    shape, material = body([(0, 0, 0), (1, 0, 0)]), Material(dynamic_friction=friction)
    start, gravity = at_rest(shape, material), pulls(len(edges))
    return simulate(shape, material, start, edges, gravity, kernel=kernel).position[0].sum()


def gone_in_steps(edges: Array, friction: Array, kernel: str) -> Array:
    """The same by a call for each step."""
    shape, material = body([(0, 0, 0), (1, 0, 0)]), Material(dynamic_friction=friction)

    def advance(state: State, now: Any) -> tuple[State, None]:
        edge, pull = now
        return simulate(shape, material, state, edge[None], pull[None], kernel=kernel), None

    start = at_rest(shape, material)
    return lax.scan(advance, start, (edges, pulls(len(edges))))[0].position[0].sum()


def vmap_of_grad(way: Any, edges: Array, friction: Array) -> Any:
    return jax.vmap(jax.grad(way, (0, 1)), (-1, None))(edges, friction)


def grad_of_vmap(way: Any, edges: Array, friction: Array) -> Any:
    return jax.grad(lambda each: jax.vmap(way, (-1, None))(each, friction).sum())(edges)


def forward(way: Any, edges: Array, friction: Array) -> Any:
    return jax.jvp(way, (edges[..., 0], friction), (jnp.ones_like(edges[..., 0]), friction))


FAST = [(gone, vmap_of_grad)]
SLOW = [
    (gone, grad_of_vmap),
    (gone, forward),
    (gone_in_steps, vmap_of_grad),
    (gone_in_steps, forward),
]


@pytest.mark.parametrize(
    ("way", "derivative"),
    [*FAST, *(pytest.param(*each, marks=pytest.mark.slow) for each in SLOW)],
)
def test_derivatives_are_those_of_jax(way: Any, derivative: Any) -> None:
    edges = waves(body([(0, 0, 0), (1, 0, 0)]), 3, 3)

    @partial(jax.jit, static_argnames="kernel")
    def of(kernel: str) -> Any:
        return derivative(partial(way, kernel=kernel), edges, jnp.asarray(0.5))

    ours, theirs = of(BEST), of("none")
    assert jnp.abs(jax.tree.leaves(theirs)[0]).max() > 0
    for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-15)


def test_what_is_wrong_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # which would come first
    shape = body(ELL)
    start, edges, gravity = at_rest(shape, Material(), (4,)), jnp.full((2, 3, 4), 0.01), pulls(2)
    for wrong, message in (
        ((edges[:, :2], gravity), r"edge has the shape \(2, 2, 4\).*allowed: \(2, 3, 4\)"),
        ((edges, gravity[:1]), r"gravity has the shape \(1, 3\).*\(2, 3\) or \(2, 3, 4\)"),
        ((edges > 0, gravity), r"edge has .* the type bool"),
    ):
        with pytest.raises(InvalidSettings, match=message):
            simulate(shape, Material(), start, *wrong)
    with pytest.raises(EthogramError, match="fastest"):
        simulate(shape, Material(), start, edges, gravity, kernel="fastest")


def test_the_kernel_itself_refuses_what_is_wrong() -> None:
    from ethogram.physics.beams3d.kernel import call, target

    shape, name = body(ELL), target(jnp.float64, BEST)
    start, edges, gravity = at_rest(shape, Material(), (4,)), jnp.full((2, 3, 4), 0.01), pulls(2)
    beyond = eqx.tree_at(lambda s: s.second.voxel, shape, shape.second.voxel + 5)
    narrow = edges.astype(jnp.float32)
    for arguments, message in (
        ((shape, Material(), start, edges[..., :3], gravity), "edge: it has 3 robots.* have 4"),
        ((shape, Material(), start, edges, gravity[:, :2]), "gravity: it has 2 entries"),
        ((beyond, Material(), start, edges, gravity), "lattice.second.voxel: there is no voxel"),
        ((shape, Material(), start, narrow, gravity), "edge: it should be of type f64"),
    ):
        with pytest.raises(Exception, match=message):
            jax.block_until_ready(call(name, *arguments, floor=True).position)


def test_other_platforms_than_cpus_get_the_steps_in_jax(monkeypatch: pytest.MonkeyPatch) -> None:
    from ethogram.physics import kernel_calls

    shape = body([(0, 0, 0), (1, 0, 0)])
    start, edges, gravity = at_rest(shape, Material()), jnp.full((1, 2), 0.01), pulls(1)
    monkeypatch.setattr(kernel_calls, "backends", lambda: ["cpu", "cuda"])

    def run(edges: Array) -> Array:
        return simulate(shape, Material(), start, edges, gravity, kernel=BEST).position

    traced = jax.jit(jax.vmap(run)).trace(jnp.stack([edges, edges]))
    programs = {
        platform: traced.lower(lowering_platforms=(platform,)).as_text()
        for platform in ("cpu", "cuda")
    }
    assert "ethogram_beams3d" in programs["cpu"]
    assert "ethogram_beams3d" not in programs["cuda"]


@pytest.mark.slow
def test_a_build_that_checks_memory_and_arithmetic_finds_nothing(tmp_path: Path) -> None:
    assert_sound("beams3d", __file__, tmp_path)
