"""What any such physics must do, whatever the original does."""

import dataclasses
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import Array, lax
from jaxtyping import Float

from ethogram.core.errors import InvalidSettings
from ethogram.physics.beams3d import (
    Lattice,
    Material,
    Size,
    State,
    at_rest,
    centre,
    lattice,
    pad,
    sensed_scale,
    simulate,
    stack,
)
from ethogram.physics.beams3d.bonds import bond_forces
from ethogram.physics.beams3d.motion import step

VOXEL = [(0, 0, 0)]
ELL = [(0, 0, 0), (1, 0, 0), (1, 0, 1)]
WORM = [(x, 0, 0) for x in range(4)]
EARTH = (0.0, 0.0, -9.81)
NOWHERE = (0.0, 0.0, 0.0)


def no_drag() -> Material:
    return Material(global_damping=0.0)


def body(cells: list[tuple[int, int, int]]) -> Lattice:
    return lattice(np.array(cells))


class Wave(NamedTuple):
    """Edges at rest, in edges: mean + amplitude sin(0.0358 k + phase) at step k."""

    mean: Any = 1.0
    amplitude: Any = 0.0
    phase: Any = 0.0

    def edge(self, material: Material, k: Array, like: Array) -> Array:
        scale = self.mean + self.amplitude * jnp.sin(0.0358 * k + self.phase)
        return jnp.broadcast_to(material.edge * scale, like.shape)


STILL = Wave()


def after(
    shape: Lattice,
    material: Material,
    state: State,
    steps: int,
    gravity: tuple[float, float, float] = EARTH,
    *,
    floor: bool = True,
    wave: Wave = STILL,
) -> State:
    """The state some steps later."""
    wave = Wave(*(jnp.asarray(part) for part in wave))
    return _after(shape, material, state, jnp.asarray(steps), jnp.array(gravity), floor, wave)


@partial(jax.jit, static_argnames="floor")
def _after(
    shape: Lattice,
    material: Material,
    state: State,
    steps: Array,
    gravity: Array,
    floor: bool,
    wave: Wave,
) -> State:
    def advance(k: Array, state: State) -> State:
        edge = wave.edge(material, k, state.edge)
        return step(shape, material, state, edge, gravity, floor=floor)

    return lax.fori_loop(0, steps, advance, state)


def simulated(
    edges: Array, gravity: Array, shape: Lattice, material: Material, kernel: str = "auto"
) -> State:
    return simulate(shape, material, at_rest(shape, material), edges, gravity, kernel=kernel)


@pytest.fixture(autouse=True)
def sixty_four_bits() -> Any:
    with jax.enable_x64(True):
        yield


def swinging(shape: Lattice) -> Wave:
    return Wave(amplitude=0.1, phase=jnp.arange(shape.voxels) * 1.3)


def test_bonds_alone_neither_make_nor_take_momentum() -> None:
    shape = body(ELL)
    start = at_rest(shape, Material())
    end = after(
        shape, Material(global_damping=0.0), start, 400, NOWHERE, floor=False, wave=swinging(shape)
    )
    assert jnp.abs(end.momentum).max() > 1e-3, "bodies that do not move prove nothing"
    np.testing.assert_allclose(end.momentum.sum(1), 0.0, atol=1e-12)
    np.testing.assert_allclose(centre(shape, end), centre(shape, start), atol=1e-15)


def test_a_falling_voxel_falls_as_it_should() -> None:
    shape, material = body(VOXEL), no_drag()
    start = at_rest(shape, material)
    lifted = changed(start, position=start.position.at[2].add(1.0))
    end = after(shape, material, lifted, 1000)
    time = float(material.time_step)
    np.testing.assert_allclose(end.momentum[:, 0], [0, 0, -9.81 * 1000 * time], rtol=1e-12)
    fallen = 9.81 * time**2 * 1000 * 1001 / 2  # momentum first, then place
    np.testing.assert_allclose(end.position[2, 0], 1.005 - fallen, rtol=1e-12)


def test_drag_slows_a_fall_to_a_steady_speed() -> None:
    heavy_air = Material(global_damping=1.0)
    shape = body(VOXEL)
    start = at_rest(shape, heavy_air)
    lifted = changed(start, position=start.position.at[2].add(1.0))
    end = after(shape, heavy_air, lifted, 1000)
    np.testing.assert_allclose(end.momentum[2, 0], -9.81 / float(heavy_air.contact_dashpot))


@pytest.mark.parametrize("height", [1, 3])
def test_a_resting_body_sinks_to_its_analytic_depth(height: int) -> None:
    """The floor carries n m g with 2 E L, each bond what is above it with E L."""
    shape = body([(0, 0, z) for z in range(height)])
    end = after(shape, Material(), at_rest(shape, Material()), 6000)
    stiffness = 5e6 * 0.01
    depth = height * 9.81 / (2 * stiffness)
    above = np.arange(height - 1, 0, -1)
    gaps = 0.01 - above * 9.81 / stiffness
    expected = 0.005 - depth + np.concatenate([[0.0], np.cumsum(gaps)])
    np.testing.assert_allclose(end.position[2], expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize(("sideways", "moves"), [(9.7, False), (9.9, True)])
def test_static_friction_holds_up_to_the_weight(sideways: float, moves: bool) -> None:
    shape = body(VOXEL)
    resting = after(shape, Material(), at_rest(shape, Material()), 3000)
    end = after(shape, Material(), resting, 300, (sideways, 0.0, -9.81))
    assert bool(end.position[0, 0] != resting.position[0, 0]) == moves


def test_a_sliding_voxel_brakes_with_half_its_weight_and_stops() -> None:
    shape, material = body(VOXEL), no_drag()
    time = float(material.time_step)
    resting = after(shape, material, at_rest(shape, material), 3000)
    pushed = changed(resting, momentum=resting.momentum.at[0, 0].set(0.5))
    slower = after(shape, material, pushed, 300)
    lost = 0.5 * 9.81 * 300 * time
    np.testing.assert_allclose(slower.momentum[0, 0], 0.5 - lost, rtol=1e-6)
    stopped = after(shape, material, pushed, 1000)
    assert stopped.momentum[0, 0] == 0.0
    slid = stopped.position[0, 0] - pushed.position[0, 0]
    np.testing.assert_allclose(slid, 0.5**2 / 9.81 - 0.5 * time / 2, rtol=1e-4)


def test_voxels_that_touch_repel_each_other_and_neighbours_do_not() -> None:
    """A U whose tips are commanded to grow: they touch within 0.75 (S1 + S2), 20 mm at 13.4 mm."""
    cells = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 0, 1), (2, 0, 1), (0, 0, 2), (2, 0, 2)]
    shape = body(cells)
    pairs = {
        (int(left), int(right))
        for left, right in zip(shape.left.voxel, shape.right.voxel, strict=True)
    }
    assert pairs == {(3, 4), (3, 6), (4, 5), (5, 6), (0, 6), (2, 5)}, "along 5 3 0 1 2 4 6"
    grown = jnp.full(7, 0.01).at[5:].set(0.0135)
    start = at_rest(shape, Material())
    near = step(
        shape, Material(), start, jnp.full(7, 0.01).at[5:].set(0.0133), jnp.zeros(3), floor=False
    )
    apart = step(shape, Material(), start, grown, jnp.zeros(3), floor=False)
    assert near.force[0, 5] == 0.0
    push = 5e4 * (0.75 * 2 * 0.0135 - 0.02)
    np.testing.assert_allclose(apart.force[0, 5:], [-push, push], rtol=1e-9)


def test_distances_have_the_gradient_that_differences_show_also_under_vmap() -> None:
    shape, steps = body(WORM), 150

    def gone(phase: Float[Array, "voxel"]) -> Float[Array, ""]:
        time = jnp.arange(steps)[:, None]
        edges = Wave(amplitude=0.1, phase=phase).edge(Material(), time, jnp.zeros((steps, 4)))
        return centre(
            shape, simulated(edges, jnp.tile(jnp.array(EARTH), (steps, 1)), shape, Material())
        )[0]

    phase = jnp.array([0.3, -1.1, -2.0, -3.5])
    (slope,) = jax.jit(jax.vmap(jax.grad(gone)))(phase[None])
    assert jnp.isfinite(slope).all()
    nudge = 1e-6 * jnp.eye(4)
    more, less = jax.jit(jax.vmap(gone))(jnp.concatenate([phase + nudge, phase - nudge])).reshape(
        2, 4
    )
    assert jnp.abs(slope).max() > 1e-5
    np.testing.assert_allclose(slope, (more - less) / 2e-6, rtol=1e-4, atol=1e-9)


def test_a_robot_that_diverges_is_flagged_and_harms_no_other() -> None:
    shape = body(WORM)

    def run(commanded: float) -> State:
        scales = jnp.ones((4, 3)).at[0, 1].set(commanded)
        start = at_rest(shape, Material(), (3,))
        return after(shape, Material(), start, 50, wave=Wave(mean=scales))

    for unsound in (jnp.nan, -0.99):  # the second leaves a bond 0.05 mm: a strain of 199
        sound, broken = run(1.01), run(unsound)
        np.testing.assert_array_equal(sound.diverged, [False, False, False])
        np.testing.assert_array_equal(broken.diverged, [False, True, False])
        for robot in (0, 2):
            np.testing.assert_array_equal(broken.position[..., robot], sound.position[..., robot])


def test_a_batch_along_the_last_axis_is_each_robot_alone_and_so_is_vmap() -> None:
    shape = body(WORM)
    phase = jnp.linspace(0, 3, 12).reshape(4, 3)

    def alone(phase: Array, batch: tuple[int, ...]) -> Array:
        start = at_rest(shape, Material(), batch)
        return after(shape, Material(), start, 60, wave=Wave(amplitude=0.1, phase=phase)).position

    together = alone(phase, (3,))
    mapped = jax.vmap(lambda phase: alone(phase, ()), in_axes=-1, out_axes=-1)(phase)
    np.testing.assert_allclose(mapped, together, rtol=0, atol=1e-15)
    for robot in range(3):
        np.testing.assert_allclose(alone(phase[:, robot], ()), together[..., robot], atol=1e-15)


@pytest.mark.parametrize("kernel", ["auto", "none"])
def test_a_simulation_is_its_steps_and_vmap_over_robots_is_lanes_however_deep(kernel: str) -> None:
    """Robots of two sets, each under a gravity of its own, against one step after the other."""
    shape, material = body(WORM), Material()
    edges = 0.01 * (1 + 0.1 * jnp.sin(jnp.arange(2 * 3 * 2 * 4.0).reshape(2, 3, 2, 4)))
    pulls = jnp.array(EARTH) + jnp.array([0.0, 1.0])[:, None, None] * jnp.array([1.0, 0, 0])
    pulls = jnp.broadcast_to(pulls, (2, 2, 3))

    @jax.jit
    def nested(edges: Array, pulls: Array) -> State:
        robots = jax.vmap(
            lambda edge, pull: simulated(edge, pull, shape, material, kernel), (0, None)
        )
        return jax.vmap(robots)(edges, pulls)

    found = nested(edges, pulls)
    if kernel == "none":  # a kernel takes robots where they are
        assert "f64[3,4,3,2]" in str(jax.make_jaxpr(nested)(edges, pulls)), "robots come last"
    go = jax.jit(partial(step, shape, material))
    for run, robot in ((0, 0), (1, 2)):
        state = at_rest(shape, material)
        for k in range(2):
            state = go(state, edges[run, robot, k], pulls[run, k])
        for name in ("position", "momentum", "strain"):
            alone = getattr(found, name)[run, robot]
            np.testing.assert_allclose(alone, getattr(state, name), rtol=1e-9, atol=1e-13)


def test_a_simulation_can_be_swept_over_materials_within_and_without_robots() -> None:
    shape = body([(0, 0, 0), (1, 0, 0)])
    edges = 0.01 * (1 + 0.1 * jnp.sin(jnp.arange(12.0).reshape(2, 3, 2)))
    pull = jnp.tile(jnp.array([3.0, 0.0, -9.81]), (3, 1))

    def gone(edges: Array, friction: Array) -> Array:
        material = Material(static_friction=friction, dynamic_friction=friction)
        return centre(shape, simulated(edges, pull, shape, material))[0]

    by_robot = jax.vmap(jax.vmap(gone, (None, 0)), (0, None))
    by_friction = jax.vmap(jax.vmap(gone, (0, None)), (None, 0))
    found, turned = jax.jit(lambda *both: (by_robot(*both), by_friction(*both)))(
        edges, jnp.array([0.0, 0.5])
    )
    assert abs(found[0, 0] - found[0, 1]) > 1e-8, "friction matters"
    np.testing.assert_allclose(found, turned.T, rtol=1e-12)


def test_padding_is_large_enough_for_every_body_of_as_many_voxels() -> None:
    """Rods, plates, cubes, and what grows at random."""
    rng = np.random.default_rng(0)
    full = [list(np.ndindex(sides)) for sides in ((9, 1, 1), (3, 3, 1), (2, 2, 2), (3, 3, 3))]
    for _ in range(3):
        cells = {(0, 0, 0)}
        while len(cells) < 12:
            cell = list(sorted(cells)[rng.integers(len(cells))])
            cell[rng.integers(3)] += rng.choice([-1, 1])
            cells.add(tuple(cell))
        full.append(sorted(cells))
    for cells in full:
        shape = body(cells)
        most = Size.for_voxels(shape.voxels)
        assert all(have <= room for have, room in zip(Size.of(shape), most, strict=True))
    assert Size.of(pad(shape, most)) == most


def test_bodies_made_equal_in_size_move_as_they_do_alone() -> None:
    shapes = [body(WORM), body(ELL), body(VOXEL)]

    def moved(shape: Lattice) -> tuple[Array, Array, Array]:
        start = at_rest(shape, Material())
        end = after(shape, Material(), start, 60, wave=swinging(shape))
        return end.position, centre(shape, end), sensed_scale(shape, end)

    places, centres, scales = jax.vmap(moved)(stack(shapes))
    for number, shape in enumerate(shapes):
        alone, middle, scale = moved(shape)
        np.testing.assert_allclose(places[number][:, : shape.voxels], alone, atol=1e-15)
        np.testing.assert_allclose(centres[number], middle, atol=1e-15)
        np.testing.assert_allclose(scales[number][: shape.voxels], scale, atol=1e-12)


def test_the_sensed_scale_is_the_mean_over_a_voxels_bonds() -> None:
    shape = body(ELL)
    state = changed(at_rest(shape, Material()), strain=jnp.array([0.2, -0.1]))
    np.testing.assert_allclose(sensed_scale(shape, state), [1.2, 1.05, 0.9])
    alone = body(VOXEL)
    np.testing.assert_array_equal(sensed_scale(alone, at_rest(alone, Material())), [1.0])


@pytest.mark.parametrize(
    ("cells", "message"), [([], "none is given"), ([(0, 0, 0), (0, 0, 0)], r"\(0, 0, 0\)")]
)
def test_cells_must_be_there_each_once(cells: list[tuple[int, int, int]], message: str) -> None:
    with pytest.raises(InvalidSettings, match=message):
        lattice(np.array(cells, int).reshape(-1, 3))


def changed(state: State, **changes: Any) -> State:
    return dataclasses.replace(state, **changes)


def test_a_bond_that_is_large_from_the_first_step_is_damped_next_against_no_deformation():
    shape, material = body([(0, 0, 0), (1, 0, 0)]), Material()
    start = at_rest(shape, material)
    pose = start.position, start.orientation  # held there
    forces = jax.jit(partial(bond_forces, shape, material, pose))

    def two_steps(edge):
        edges = jnp.full(2, edge)
        first, memory = forces(edges, start.memory, jnp.asarray(True))
        second, _ = forces(edges, memory, jnp.asarray(False))
        return float(first.force[0, 0]), float(second.force[0, 0]), memory

    edge = float(material.edge)
    stretch = 0.4 * edge
    first, second, memory = two_steps(edge - stretch)
    assert not memory.small.any()
    assert (memory.deformation == 0).all()
    assert first == pytest.approx(float(material.beam.axial) * stretch, rel=1e-5)
    damping = float(material.bond_dashpot.axial / material.time_step) * stretch
    assert second - first == pytest.approx(damping, rel=1e-5)
    first, second, memory = two_steps(0.75 * edge)  # above 1 / 1.43
    assert memory.small.all()
    assert second == pytest.approx(first, rel=1e-5)
