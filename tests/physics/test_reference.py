"""The physics follows the simulator that the thesis used, step by step."""

import json
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import Array, lax
from jaxtyping import Float
from tests.physics.kernels import USABLE

from ethogram.physics.beams3d import Lattice, Material, at_rest, lattice, simulate, stack

REFERENCE = Path(__file__).parent / "reference"
CASES = json.loads((REFERENCE / "cases.json").read_text())
MOST_STEPS = max(case["steps"] for case in CASES.values())
ROW = 10  # steps: all recorded rows but the first twenty are multiples of it

KERNELS = ["none", *USABLE]

WITHIN = 1e-8  # m, in 64 bits
DISTANCE_WITHIN = 0.005  # of the distance, in 32 bits


class Body(NamedTuple):
    """A case, padded so that one compiled program runs them all."""

    lattice: Lattice
    swing: Float[Array, "4 voxel"]
    gravity: Float[Array, "3"]


@partial(jax.jit, static_argnames="kernel")
def positions(body: Body, free: bool, kernel: str) -> Any:
    """Positions after every step of the longest case; the start comes first."""
    material = Material()
    grown, amplitude, frequency, phase = body.swing
    start = at_rest(body.lattice, material)

    def advance(state: Any, k: Any) -> Any:
        time = k * material.time_step
        wave = amplitude * jnp.sin(2 * jnp.pi * frequency * time + phase)
        edge = material.edge * (grown + wave)
        on = partial(simulate, body.lattice, material, state, edge[None], body.gravity[None])
        after = lax.cond(free, lambda: on(floor=False, kernel=kernel), lambda: on(kernel=kernel))
        return after, after.position

    _, places = lax.scan(advance, start, jnp.arange(MOST_STEPS))
    return jnp.concatenate([start.position[None], places])


def simulated(name: str, kernel: str) -> Float[np.ndarray, "step voxel 3"]:
    """Where the case's voxels are after each of its steps."""
    bodies = {case: lattice(np.array(found["cells"])) for case, found in CASES.items()}
    padded = dict(zip(bodies, _apart(stack(list(bodies.values())), len(bodies)), strict=True))
    case, body = CASES[name], padded[name]
    swing = np.pad(np.array(case["swing"]).T, ((0, 0), (0, body.voxels - len(case["cells"]))))
    gravity = np.array([0.0, 0.0, 0.0 if case["free"] else -9.81])
    found = positions(Body(body, jnp.asarray(swing), jnp.asarray(gravity)), case["free"], kernel)
    return np.asarray(found).transpose(0, 2, 1)[: case["steps"] + 1, : len(case["cells"])]


def _apart(stacked: Lattice, bodies: int) -> list[Lattice]:
    return [jax.tree.map(lambda leaf, i=i: leaf[i], stacked) for i in range(bodies)]


@pytest.fixture(scope="module")
def recorded() -> dict[str, np.ndarray]:
    with np.load(REFERENCE / "trajectories.npz", allow_pickle=False) as arrays:
        return dict(arrays)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("name", CASES)
def test_every_voxel_is_where_the_original_put_it_within_1e8_m(
    name: str, kernel: str, recorded: dict[str, np.ndarray]
) -> None:
    with jax.enable_x64(True):
        found = simulated(name, kernel)
    row = recorded[f"{name}.step"]
    assert row[-1] == CASES[name]["steps"], "the whole trajectory is compared"
    np.testing.assert_allclose(found[row], recorded[f"{name}.position"], rtol=0, atol=WITHIN)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("name", [name for name in CASES if not CASES[name]["free"]])
def test_in_32_bits_the_distance_is_the_originals_within_half_a_per_cent(
    name: str, kernel: str, recorded: dict[str, np.ndarray]
) -> None:
    centre = simulated(name, kernel)[:, :, 0].mean(1)
    original = recorded[f"{name}.position"][:, :, 0].mean(1)
    distance = original[-1] - original[0]
    assert abs(distance) > 0.01, "a robot that stays where it is proves nothing"
    np.testing.assert_allclose(centre[-1] - centre[0], distance, rtol=DISTANCE_WITHIN)
