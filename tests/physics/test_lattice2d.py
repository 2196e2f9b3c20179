"""Soft bodies in the plane: the numbers of the original, a plain oracle, and laws; in JAX."""

import json
from functools import cache
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.oracles.lattice2d import Body

from ethogram.core.errors import InvalidSettings
from ethogram.physics.lattice2d import (
    Material,
    Terrain,
    at_rest,
    avalanches,
    flat,
    lattice,
    lattices,
    simulate,
)
from ethogram.physics.lattice2d.squares import area_ratio, squares

REFERENCE = json.loads((Path(__file__).parent / "reference/softbody2d.json").read_text())
EARTH = 9.8
MOST_VOXELS = 20


@pytest.fixture(autouse=True)
def sixty_four_bits():
    with jax.enable_x64(True):
        yield


def cells_of(rows):
    """Cells of a drawing, the bottom row first."""
    return np.array(
        [(x, y) for y, row in enumerate(reversed(rows)) for x, c in enumerate(row) if c == "#"]
    )


def body(cells):
    """All bodies have the shapes of one, so that they are one program."""
    return jax.tree.map(lambda leaf: leaf[0], lattices([np.asarray(cells)], MOST_VOXELS))


MATERIALS = {"soft": Material.soft, "default": Material}


@cache
def program(springs, grounded):
    """A step that takes bodies, states and controls as data: compiled once for each."""
    del springs  # they make another program of it
    terrain = flat() if grounded else None

    def step(body, state, control, sweeps_material):
        return simulate(
            body,
            sweeps_material,
            state,
            control[None],
            gravity=EARTH if grounded else 0.0,
            terrain=terrain,
        )

    return jax.jit(step)


class Run:
    """A body, stepped with 20 voxels' room."""

    def __init__(self, cells, material="default", *, ground=False, place=(0.0, 0.0)):
        self.cells = np.asarray(cells)
        self.body = body(cells)
        self.material = MATERIALS[material]()
        self.advance = program(material, ground)
        self.state = at_rest(self.body, place=place, terrain=ground)

    def step(self, control=0.0):
        control = np.broadcast_to(control, len(self.cells))
        padded = jnp.asarray(np.pad(control.astype(float), (0, MOST_VOXELS - len(self.cells))))
        self.state = self.advance(self.body, self.state, padded, self.material)
        return self

    @property
    def squares(self):
        return squares(self.body, self.material, self.state.moved, self.state.heading)

    @property
    def area(self):
        return np.asarray(area_ratio(self.material, self.squares))[: len(self.cells)]

    @property
    def middle(self):
        """Centres of voxels, [voxel, 2]."""
        at = self.squares
        return np.asarray((at.moved + at.lever + at.rest).mean(1).T)[: len(self.cells)]


def pulse(step, voxels):
    """Control in a step, counted from 1, of the runs that the reference recorded."""
    control = np.zeros(voxels)
    control[0] = 0.0 if step == 1 else 1.0 if step <= 13 else -1.0 if step <= 25 else 0.0
    return control


TRACES = [name for name in REFERENCE["area_ratio_traces"] if name != "about"]


@pytest.mark.parametrize("name", TRACES)
def test_area_ratios_follow_the_original_at_every_step(name):
    expected = np.array(REFERENCE["area_ratio_traces"][name])
    voxels = expected.shape[1]
    run = Run([(x, 0) for x in range(voxels)], "soft" if "soft" in name else "default")
    found = [run.step(pulse(step, voxels)).area for step in range(1, len(expected) + 1)]
    np.testing.assert_allclose(found, expected, atol=1e-3)


@cache
def find_avalanches():
    return jax.jit(lambda body, tau: avalanches(body, Material.soft(), tau))


THRESHOLD = 6.092750496194226e-3 - 1.4273597198968677e-4 * 20 + 9.238294116972325e-7 * 20**2


@pytest.mark.parametrize("name", ["box", "worm", "revT", "biped"])
def test_avalanches_are_those_of_the_original(name):
    expected = REFERENCE["bodies"][name]
    found = find_avalanches()(body(cells_of(expected["rows_top_to_bottom"])), THRESHOLD)
    differ = np.asarray(found.size) != expected["sizes"]
    # two voxels of the biped are within 1e-5 of the threshold
    assert differ.sum() <= (2 if name == "biped" else 0)
    np.testing.assert_array_equal(found.duration, expected["durations"])


def test_padding_starts_no_avalanche():
    found = find_avalanches()(body([(0, 0), (1, 0)]), 1e-4)
    assert (np.asarray(found.size) > 0).tolist() == [True, True, *[False] * 18]
    assert not found.duration[2:].any()


def test_a_box_settles_at_the_height_of_the_original():
    run = Run([(x, y) for y in range(4) for x in range(5)], ground=True)
    for _ in range(300):
        run.step()
    expected = REFERENCE["settled"]["default"]["centre_y"]
    assert run.middle[:, 1].mean() == pytest.approx(expected, rel=5e-3)


SHAPES = {
    "ell": [(0, 0), (1, 0), (1, 1)],
    "diagonal": [(0, 0), (1, 0), (1, 1), (2, 1), (2, 2), (0, 1)],
    "ring": [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2)],
    "odd": [(1, 1), (2, 1), (2, 2), (3, 2)],
}


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("shape", SHAPES)
def test_free_bodies_move_as_by_impulses_spring_after_spring(shape, material):
    cells, rng = SHAPES[shape], np.random.default_rng(len(shape))
    run, oracle = Run(cells, material), Body(cells, default=material == "default")
    for _ in range(12):
        control = rng.uniform(-1, 1, len(cells))
        run.step(control)
        oracle.step(control, sweeps=60)
    expected = [oracle.middle(voxel) for voxel in range(len(cells))]
    np.testing.assert_allclose(run.middle, expected, atol=3e-6)
    areas = [oracle.area(voxel) for voxel in range(len(cells))]
    np.testing.assert_allclose(run.area, areas, atol=3e-6)


def test_a_body_that_drops_touches_the_ground_as_by_impulses_contact_after_contact():
    cells, place = SHAPES["ell"], (0.0, 0.05)
    run = Run(cells, ground=True, place=place)
    oracle = Body(cells, default=True, place=place, gravity=EARTH, ground=True)
    touched = False
    for _ in range(12):
        run.step()
        oracle.step(np.zeros(3), sweeps=200)
        touched |= bool(oracle.pushes)
    assert touched
    expected = [oracle.middle(voxel) for voxel in range(len(cells))]
    np.testing.assert_allclose(run.middle, expected, atol=2e-4)


def momentum(run):
    squares_of = np.asarray(run.body.squares)
    return (squares_of * np.asarray(run.state.velocity[:2])).sum((1, 2))


def test_springs_give_no_momentum():
    run, rng = Run(SHAPES["diagonal"]), np.random.default_rng(0)
    for _ in range(20):
        run.step(rng.uniform(-1, 1, 6))
    assert np.abs(run.state.velocity).max() > 0.1
    assert np.abs(momentum(run)).max() < 1e-3


def test_a_body_at_rest_stays_at_rest():
    run = Run(SHAPES["ring"]).step().step()
    assert np.abs(run.state.velocity).max() < 1e-12
    np.testing.assert_allclose(run.area, 1.0, atol=1e-12)


def test_impulses_of_contacts_stay_in_the_cone_of_friction_and_nothing_sinks():
    run, rng = Run(SHAPES["ell"], ground=True), np.random.default_rng(1)
    pushed = 0.0
    for step in range(160):
        run.step(rng.uniform(-1, 1, 3) if step < 60 else 0.0)
        pushing, dragging = np.moveaxis(np.asarray(run.state.contact), 1, 0)
        pushed += pushing.sum()
        assert (pushing >= 0).all()
        assert (np.abs(dragging) <= np.sqrt(20) * pushing + 1e-12).all()
    assert pushed > 1.0
    at = run.squares
    half = np.abs(np.asarray(at.across)).sum(0)
    lowest = np.asarray((at.moved + at.lever + at.rest)[1] - half)[:, :3].min()
    assert -0.0051 < lowest <= 0


def test_a_mirrored_body_moves_as_its_mirror_image():
    cells = np.array(SHAPES["diagonal"])
    mirrored = np.stack([2 - cells[:, 0], cells[:, 1]], 1)  # mirrored columns keep their parity
    shifted = np.stack([3 - cells[:, 0], cells[:, 1]], 1)  # and here they do not
    rng = np.random.default_rng(3)
    runs = [Run(each) for each in (cells, mirrored, shifted)]
    for _ in range(20):
        control = rng.uniform(-1, 1, len(cells))
        for run in runs:
            run.step(control)
    one, other, third = (run.middle for run in runs)
    np.testing.assert_allclose(9 - one[:, 0], other[:, 0], atol=1e-5)
    np.testing.assert_allclose(12 - one[:, 0], third[:, 0], atol=1e-5)
    np.testing.assert_allclose(one[:, 1], other[:, 1], atol=1e-5)


def test_the_order_of_voxels_changes_nothing():
    cells, order = np.array(SHAPES["ring"]), np.random.default_rng(4).permutation(7)
    runs = Run(cells, ground=True), Run(cells[order], ground=True)
    rng = np.random.default_rng(5)
    for _ in range(15):
        control = rng.uniform(-1, 1, 7)
        runs[0].step(control)
        runs[1].step(control[order])
    np.testing.assert_allclose(runs[0].middle[order], runs[1].middle, atol=1e-4)


def test_a_rope_keeps_squares_a_side_apart():
    run = Run([(0, 0)])
    towards = run.state.velocity.at[0, 0].set(60.0)  # the squares of one side fly into the others
    run.state = eqx.tree_at(lambda state: state.velocity, run.state, towards)
    run.step()
    at = run.squares
    gap = np.asarray(at.between([0], [1]))[:, 0, 0]
    assert np.linalg.norm(gap) > 0.85


def rigid_bodies_at(cells, vertex):
    """Numbers of squares of the rigid bodies about a vertex."""
    body = lattice(np.array(cells))
    found = np.asarray(body.vertex) == np.array(vertex, float)[:, None, None]
    listed = (np.asarray(body.voxel) < body.voxels).sum(-1)
    return sorted(listed[found.all(0) & (listed > 0)].tolist())


def test_squares_are_welded_through_faces_and_not_through_a_vertex():
    assert rigid_bodies_at([(0, 0), (1, 0), (1, 1)], (1, 1)) == [3]
    assert rigid_bodies_at([(0, 0), (1, 0)], (1, 1)) == [2]
    open_ring = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
    assert rigid_bodies_at(open_ring, (1, 1)) == [3]
    hook = [(0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (1, 0)]  # (1, 0) and (2, 1) touch
    assert rigid_bodies_at(hook, (2, 1)) == [1, 1]


@pytest.mark.parametrize(
    ("cells", "says"),
    [([], "none is given"), ([(0, 0), (0, 0)], "(0, 0)")],
)
def test_no_body_is_made_of_nothing_or_of_one_cell_twice(cells, says):
    with pytest.raises(InvalidSettings, match="at least one cell") as error:
        lattice(np.array(cells, int).reshape(-1, 2))
    assert says in str(error.value)


@pytest.mark.parametrize(
    ("points", "says"),
    [
        ([(0.0, 0.0)], "two points"),
        ([(0.0, 0.0), (0.0, 1.0)], "x increasing"),
        ([(0.0, 0.0), (1.0, np.nan)], "finite"),
    ],
)
def test_a_terrain_that_is_no_polyline_is_refused(points, says):
    with pytest.raises(InvalidSettings, match="Terrain: ground") as error:
        Terrain(np.array(points))
    assert says in str(error.value)


def test_arrays_of_other_shapes_are_refused_by_name():
    one = body([(0, 0)])
    state = at_rest(one, terrain=False)
    with pytest.raises(InvalidSettings, match=r"simulate: control has the shape \(1, 3\)"):
        simulate(one, Material(), state, jnp.zeros((1, 3)), gravity=0.0)
    with pytest.raises(InvalidSettings, match=r"simulate: state.contact has the shape"):
        simulate(one, Material(), state, jnp.zeros((1, 20)), gravity=0.0, terrain=flat())


@pytest.mark.parametrize(
    ("bodies", "voxels", "says"),
    [
        ([], None, "at least one body"),
        ([np.zeros((0, 2), int)], None, "bodies of \\[0\\] voxels"),
        ([np.array([(0, 0), (1, 0)])], 1, "each of 1 to 1 voxels"),
        ([np.array([(0, 0), (0, 0)])], None, "the same cell twice"),
    ],
)
def test_many_bodies_are_refused_as_one_is(bodies, voxels, says):
    with pytest.raises(InvalidSettings, match=says):
        lattices(bodies, voxels)
