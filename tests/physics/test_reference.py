"""The physics follows the simulator that the thesis used, step by step."""

import json
from functools import cache, partial
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
ROW = 10  # steps: all recorded rows but the first twenty are multiples of it

KERNELS = ["none", *USABLE]

WITHIN = 1e-8  # m, in 64 bits
DISTANCE_WITHIN = 0.005  # of the distance, in 32 bits


class Body(NamedTuple):
    """A case, padded so that one compiled program runs them all side by side."""

    lattice: Lattice
    swing: Float[Array, "4 voxel"]


@partial(jax.jit, static_argnames=("steps", "floor", "kernel"))
def positions(bodies: Body, steps: int, floor: bool, kernel: str) -> Any:
    """Positions of each body after every step; the start comes first."""
    material, gravity = Material(), jnp.array([0.0, 0.0, -9.81 if floor else 0.0])

    def run(body: Body) -> Any:
        grown, amplitude, frequency, phase = body.swing
        start = at_rest(body.lattice, material)

        def advance(state: Any, k: Any) -> Any:
            time = k * material.time_step
            wave = amplitude * jnp.sin(2 * jnp.pi * frequency * time + phase)
            edge = material.edge * (grown + wave)
            move = partial(simulate, body.lattice, material, floor=floor, kernel=kernel)
            after = move(state, edge[None], gravity[None])
            return after, after.position

        _, places = lax.scan(advance, start, jnp.arange(steps))
        return jnp.concatenate([start.position[None], places])

    return jax.vmap(run)(bodies)


@cache
def simulated(kernel: str, bits: int) -> dict[str, Float[np.ndarray, "step voxel 3"]]:
    """By case, where its voxels are after each of its steps."""
    found = {}
    for free in (False, True):
        cases = {name: case for name, case in CASES.items() if case["free"] == free}
        with jax.enable_x64(bits == 64):
            bodies = stack([lattice(np.array(case["cells"])) for case in cases.values()])
            most = max(len(case["cells"]) for case in cases.values())
            swing = [
                np.pad(np.array(case["swing"]).T, ((0, 0), (0, most - len(case["cells"]))))
                for case in cases.values()
            ]
            steps = max(case["steps"] for case in cases.values())
            places = positions(Body(bodies, jnp.array(swing)), steps, not free, kernel)
        for place, (name, case) in zip(np.asarray(places), cases.items(), strict=True):
            found[name] = place.transpose(0, 2, 1)[: case["steps"] + 1, : len(case["cells"])]
    return found


@pytest.fixture(scope="module")
def recorded() -> dict[str, np.ndarray]:
    with np.load(REFERENCE / "trajectories.npz", allow_pickle=False) as arrays:
        return dict(arrays)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("name", CASES)
def test_every_voxel_is_where_the_original_put_it_within_1e8_m(
    name: str, kernel: str, recorded: dict[str, np.ndarray]
) -> None:
    found = simulated(kernel, bits=64)[name]
    row = recorded[f"{name}.step"]
    assert row[-1] == CASES[name]["steps"], "the whole trajectory is compared"
    np.testing.assert_allclose(found[row], recorded[f"{name}.position"], rtol=0, atol=WITHIN)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("name", [name for name in CASES if not CASES[name]["free"]])
def test_in_32_bits_the_distance_is_the_originals_within_half_a_per_cent(
    name: str, kernel: str, recorded: dict[str, np.ndarray]
) -> None:
    centre = simulated(kernel, bits=32)[name][:, :, 0].mean(1)
    original = recorded[f"{name}.position"][:, :, 0].mean(1)
    distance = original[-1] - original[0]
    assert abs(distance) > 0.01, "a robot that stays where it is proves nothing"
    np.testing.assert_allclose(centre[-1] - centre[0], distance, rtol=DISTANCE_WITHIN)
