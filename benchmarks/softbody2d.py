"""How fast soft robots in the plane are simulated, beside a loop in NumPy and EvoGym.

    python benchmarks/softbody2d.py [--cores 2] [--json FILE]

Voxel-steps per second: one voxel through one step of the physics of 1/60 s.  Soft material floats,
as in avalanches; default material is dropped on level ground, as in tasks, by one call of `STEPS`
steps ("ground") and by `World.step` in a rollout with a phase controller ("rollout").  The body is
the box of 20 voxels; every robot has commands of its own.  What comes out is added up, so that
nothing can be optimised away.  JAX, by `kernel="none"`, is measured for fewer robots.

Avalanches: milliseconds for a body, all its voxels driven, of `BODIES` bodies in one call.

"All cores" is the sum over one such process per core at the same time, each pinned to its core.
The loop in NumPy takes one spring and one contact after the other: it is the one that the tests
hold the physics against (`tests/oracles/lattice2d.py`).  EvoGym is another physics of masses and
springs; where it is installed, its voxels times steps of its environment per second stand beside
ours, for a robot of as many voxels on its flat ground.
"""

import json
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from common.processes import Place, alone, options, side_by_side

BOX = "#####/#####/#####/#####"
VOXELS = 20
ROBOTS = {"auto": (1, 32, 256, 2048), "none": (1, 32, 256)}  # by kernel
STEPS, SECONDS = 60, 1.0  # of a call; of a measurement, at least
BODIES = 256
LOOPED = 30  # steps of the loop in NumPy
KINDS = ("soft, free", "default, ground", "default, rollout")
THESIS_VOXEL_STEPS = 34 * 3 * 2 * 10 * 10_000 * 1800 * 20  # tasks: 1800 steps on average


def rates(kernel: str, place: Place) -> list[list[float]]:
    """Voxel-steps per second in this process, for each kind and number of robots."""
    place.start()
    return [[_rate(kind, robots, kernel) for robots in ROBOTS[kernel]] for kind in KINDS]


def _rate(kind: str, robots: int, kernel: str) -> float:
    import jax
    import jax.numpy as jnp
    import numpy as np

    from ethogram.core.rollout import rollout
    from ethogram.physics.lattice2d import Material, at_rest, flat, simulate
    from ethogram.worlds.softbody import SoftBody2D

    world = SoftBody2D(body=BOX, kernel=kernel)
    genes = jax.random.uniform(jax.random.key(0), (robots, VOXELS), minval=-1.0, maxval=1.0)
    time_of = jnp.arange(STEPS) / 60
    waves = jnp.sin(-2 * jnp.pi * time_of[:, None, None] + jnp.pi * genes.T)
    is_free = kind == "soft, free"
    material = Material.soft() if is_free else Material()
    terrain = None if is_free else flat()
    start = at_rest(world.body, (robots,), terrain=not is_free)

    @jax.jit
    def whole(state: Any) -> Any:
        return simulate(
            world.body,
            material,
            state,
            waves,
            gravity=0.0 if is_free else 9.8,
            terrain=terrain,
            kernel=kernel,
        )

    def act(gene: Any) -> Any:
        def phase_controller(key: Any, observation: Any) -> Any:
            del key
            sine, cosine = observation["robot"][:, -2:].T
            turned = jnp.pi * gene
            return {"robot": cosine * jnp.sin(turned)[None] - sine * jnp.cos(turned)[None]}

        return phase_controller

    def reward(transition: Any) -> Any:
        return transition.outcome.reward["robot"]

    @jax.jit
    def rolled(state: Any) -> Any:
        del state

        def one(gene: Any) -> Any:
            key = jax.random.key(0)
            return rollout(world, act(gene), key, STEPS, keep=lambda t: t.outcome.reward["robot"])[
                1
            ]

        return jax.vmap(one)(genes)

    go = rolled if kind == "default, rollout" else whole
    result = jax.block_until_ready(go(start))  # compiles
    began, calls, total = time.perf_counter(), 0, 0.0
    while time.perf_counter() - began < SECONDS:
        result = jax.block_until_ready(go(start))
        calls += 1
        total += float(np.abs(np.asarray(jax.tree.leaves(result)[0])).sum())
    spent = time.perf_counter() - began
    if not total > 0:
        raise RuntimeError(f"{kind}: nobody moved: the benchmark does not measure robots")
    return calls * STEPS * robots * VOXELS / spent


def avalanche_milliseconds() -> float:
    """For the avalanches of a body, in a call with many."""
    import numpy as np

    from ethogram.worlds.softbody.criticality import avalanches_of
    from ethogram.worlds.softbody.growth import walked_body

    rng = np.random.default_rng(0)
    bodies = [walked_body(rng, VOXELS) for _ in range(BODIES)]
    avalanches_of(bodies[:64])  # compiles
    best = np.inf
    for _ in range(3):
        began = time.perf_counter()
        avalanches_of(bodies)
        best = min(best, time.perf_counter() - began)
    return float(1e3 * best / BODIES)


def looped() -> float:
    """Voxel-steps per second of the loop in NumPy."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    import numpy as np
    from tests.oracles.lattice2d import Body

    body = Body(
        [(x, y) for y in range(4) for x in range(5)], default=True, gravity=9.8, ground=True
    )
    rng = np.random.default_rng(0)
    began = time.perf_counter()
    for _ in range(LOOPED):
        body.step(rng.uniform(-1, 1, VOXELS))
    return LOOPED * VOXELS / (time.perf_counter() - began)


def evogym() -> float | None:
    """Voxels times steps of its simulator per second of EvoGym; None where it is not installed."""
    if find_spec("evogym") is None:
        return None
    import gymnasium
    import numpy as np
    from evogym import get_full_connectivity
    from evogym.envs import WalkingFlat  # noqa: F401  (it registers its environments)

    soft = np.full((4, 5), 3)  # horizontal actuators
    env = gymnasium.make("Walker-v0", body=soft, connections=get_full_connectivity(soft))
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    began, steps = time.perf_counter(), 0
    while time.perf_counter() - began < 5 * SECONDS:
        _, _, ended, cut, _ = env.step(rng.uniform(0.6, 1.6, env.action_space.shape))
        steps += 1
        if ended or cut:
            env.reset()
    return steps * VOXELS / (time.perf_counter() - began)


def main() -> None:
    """Measure, print a table, and keep the figures where asked."""
    chosen = options(__doc__)
    series: dict[str, list[list[float]]] = {"kernel, one core": alone(_alone, "auto")}
    if chosen.cores > 1:
        parts = zip(*side_by_side(chosen.cores, rates, "auto"), strict=True)
        summed = [[sum(cell) for cell in zip(*kind, strict=True)] for kind in parts]
        series["kernel, all cores"] = summed
    series["JAX, one core"] = alone(_alone, "none")
    columns = [(number, name) for number in range(len(KINDS)) for name in series]
    print("| robots |", " | ".join(f"{KINDS[number]}: {name}" for number, name in columns), "|")
    print("| ---: |" + " ---: |" * len(columns))
    for place, robots in enumerate(ROBOTS["auto"]):
        rows = [series[name][number] for number, name in columns]
        cells = (f"{row[place] / 1e6:.2f} M/s" if place < len(row) else "" for row in rows)
        print(f"| {robots} |", " | ".join(cells), "|", flush=True)
    others = {
        "loop in NumPy, voxel-steps per second": alone(looped),
        "EvoGym, voxel-steps per second": alone(evogym),
        "avalanches of a body, milliseconds": alone(avalanche_milliseconds),
    }
    for name, value in others.items():
        print(f"{name}: {'not installed' if value is None else f'{value:,.3g}'}")
    best = max(series.get("kernel, all cores", series["kernel, one core"])[-1])
    hours = THESIS_VOXEL_STEPS / best / 3600
    print(f"the tasks of the thesis, by rollouts at the best rate: {hours:.1f} h, extrapolated")
    if chosen.json:
        chosen.json.write_text(json.dumps(series | others, indent=1))


def _alone(kernel: str) -> list[list[float]]:
    return [[_rate(kind, robots, kernel) for robots in ROBOTS[kernel]] for kind in KINDS]


if __name__ == "__main__":
    main()
