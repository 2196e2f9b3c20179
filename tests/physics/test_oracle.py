import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.oracles import beams3d as oracle

from ethogram.physics.beams3d import Material, at_rest, lattice
from ethogram.physics.beams3d.motion import step
from ethogram.physics.beams3d.rotations import Quaternion, rotation_vector

RING = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 0, 1), (2, 0, 2), (1, 0, 2), (0, 0, 2)]
BLOCK = [(x, y, z) for z in range(2) for y in range(2) for x in range(2)]
STEPS = 400


@pytest.mark.parametrize(
    ("cells", "amplitude"),
    [
        pytest.param(RING, 0.6, id="a ring that closes on itself"),
        pytest.param(BLOCK, 0.3, id="a block that is thrown about"),
    ],
)
def test_bodies_move_as_they_do_one_bond_after_the_other(cells, amplitude):
    """With bends large and small, self-collision, friction and gravity that tilts."""
    rng = np.random.default_rng(1)
    phase = rng.uniform(-np.pi, np.pi, len(cells))
    time = np.arange(STEPS)[:, None] * oracle.TIME
    edges = 0.01 * (1 + amplitude * np.sin(2 * np.pi * 40 * time + phase))
    gravity = np.array([2.0, 0.5, -9.0])
    plain, places = oracle.Body(cells), []
    small = []
    for row in edges:
        plain.step(row, gravity)
        places.append(list(plain.position))
        small.append(list(plain.small))
    assert np.any(small)
    assert not np.all(small), "angles large and small"
    with jax.enable_x64(True):
        body, material = lattice(np.array(cells)), Material()

        @jax.jit
        def moved(start, edges):
            def advance(state, edge):
                after = step(body, material, state, edge, jnp.asarray(gravity))
                return after, (after.position, after.memory.small)

            return jax.lax.scan(advance, start, edges)[1]

        found, found_small = moved(at_rest(body, material), jnp.asarray(edges))
    np.testing.assert_array_equal(found_small, small)
    np.testing.assert_allclose(np.swapaxes(found, 1, 2), places, rtol=0, atol=1e-9)


def test_bodies_with_many_pairs_that_could_touch_move_so_too():
    """A rod that falls: a voxel has a hundred others to touch, and one is where it touches."""
    cells = [(x, 0, 0) for x in range(105)]
    plain = oracle.Body(cells)
    plain.position[100] = plain.position[3] + np.array([0.002, 0.001, 0.012])
    start = np.stack(plain.position)
    edges, pull = np.full(len(cells), 0.01), np.array([0.0, 0.0, -9.81])
    for _ in range(3):
        plain.step(edges, pull)
    with jax.enable_x64(True):
        body, material = lattice(np.array(cells)), Material()
        state = eqx.tree_at(lambda s: s.position, at_rest(body, material), jnp.asarray(start.T))
        edge, gravity = jnp.asarray(edges), jnp.asarray(pull)
        go = jax.jit(lambda state: step(body, material, state, edge, gravity))
        for _ in range(3):
            state = go(state)
    assert np.abs(state.momentum[2, 50]) < 0.2 * np.abs(state.momentum[2, 3]), "they touched"
    np.testing.assert_allclose(state.position.T, plain.position, rtol=0, atol=1e-9)


def test_rotation_vectors_are_the_originals_all_the_way_round():
    half = np.concatenate([np.linspace(0, np.pi, 400), [1e-5, np.pi - 1e-5]])
    axis = np.array([0.48, 0.6, 0.64])
    turns = np.stack([np.cos(half), *(axis[:, None] * np.sin(half))])
    turns[0] = np.clip(turns[0], -1, 1)
    expected = np.stack([oracle.rotation_vector(q) for q in turns.T], 1)
    with jax.enable_x64(True):
        found = np.stack(rotation_vector(Quaternion(*map(jnp.asarray, turns))))
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-9)
