import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.oracles import beams3d as oracle

from ethogram.physics.beams3d import Material, at_rest, lattice, step

RING = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 0, 1), (2, 0, 2), (1, 0, 2), (0, 0, 2)]
BLOCK = [(x, y, z) for z in range(2) for y in range(2) for x in range(2)]
STEPS = 400


@pytest.mark.parametrize(
    ("cells", "swing"),
    [
        pytest.param(RING, 0.6, id="a ring that closes on itself"),
        pytest.param(BLOCK, 0.3, id="a block that is thrown about"),
    ],
)
def test_bodies_move_as_they_do_one_bond_after_the_other(cells, swing):
    """With bends large and small, self-collision, friction and gravity that tilts."""
    rng = np.random.default_rng(1)
    phase = rng.uniform(-np.pi, np.pi, len(cells))
    time = np.arange(STEPS)[:, None] * oracle.TIME
    edges = 0.01 * (1 + swing * np.sin(2 * np.pi * 40 * time + phase))
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
