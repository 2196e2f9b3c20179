"""How fast soft robots are simulated, beside a loop in NumPy.

    python benchmarks/sensing.py [--cores 2] [--json FILE]

Voxel-steps per second: one voxel through one step of the physics, with its bonds, contacts,
sensors and controller.  A row is a body and a number of robots of it, every one with a controller
of its own; each is simulated for `STEPS` steps on the even surface, again and again.  The distance
of every robot is returned and added up, so that nothing can be optimised away.  Fewer robots than a
block holds are simulated in a block of their own size, and not filled up with copies.

"All cores" is the sum over one such process per core at the same time, each pinned to its core,
which is how a campaign uses the machine.  The loop in NumPy takes one bond and one voxel after the
other: it is the one that the tests hold the physics against (`tests/oracles/beams3d.py`), with the
waves of a non-sensing controller, and its robot must get as far as ours.

A second table sets the kernels for this processor beside JAX, on one core, each in a process of its
own, one after the other, per second of processor time, so that others on the machine matter less:
the physics alone with edges given beforehand, for 256 robots and for one; whole simulations with
non-sensing and with sensing controllers; and a rollout through `World.step`, in which the policies
are these sensing controllers, each robot's its own.
"""

import json
import sys
import time
from pathlib import Path

from common.processes import Place, alone, options, side_by_side

BODIES = {"worm": "worm", "tripod": "tripod", "4x4x3": "|".join(["/".join(["####"] * 3)] * 4)}
ROBOTS = (1, 32, 256, 2048)
KINDS = ("non-sensing", "sensing")
STEPS, SECONDS = 200, 1.5  # of a simulation; of a measurement, at least
KERNELS = ("x86-64-v4", "x86-64-v3", "x86-64", "portable")
LOOPED = 200  # steps of the loop in NumPy
THESIS_VOXEL_STEPS = 3 * 2 * 2 * 30 * 6230 * 10_000 * 6  # six voxels on average


def rates(body: str, kind: str, place: Place) -> list[float]:
    """Voxel-steps per second in this process, for each number of robots."""
    import equinox as eqx
    import jax
    import numpy as np

    from ethogram.worlds.softbody import SoftBody3D
    from ethogram.worlds.softbody.controllers import NonSensing, Sensing
    from ethogram.worlds.softbody.gravity import schedule
    from ethogram.worlds.softbody.simulation import BLOCK_ROBOTS, simulate

    world = SoftBody3D(body=body)
    voxels = len(world.cells)
    controller = NonSensing(voxels) if kind == "non-sensing" else Sensing(voxels)
    gravity = schedule("even", STEPS)
    go = eqx.filter_jit(simulate)
    found = []
    for robots in ROBOTS:
        genes = jax.random.uniform(
            jax.random.key(0), (controller.search_space.size, robots), minval=-1.0, maxval=1.0
        )
        block = robots if robots < BLOCK_ROBOTS else None
        way = go(world, controller, genes, gravity, block_size=block).distance  # compiles
        place.start()
        began, episodes, total = time.perf_counter(), 0, 0.0
        while time.perf_counter() - began < SECONDS:
            way = go(world, controller, genes, gravity, block_size=block).distance
            total += float(np.nansum(np.abs(way)))
            episodes += 1
        spent = time.perf_counter() - began
        if not total > 0:
            raise RuntimeError("nobody moved: the benchmark does not measure robots")
        found.append(episodes * STEPS * robots * voxels / spent)
    return found


def looped(body: str) -> float:
    """Voxel-steps per second of the loop in NumPy, which must go where our robot goes."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    import jax.numpy as jnp
    import numpy as np
    from tests.oracles.beams3d import TIME, Body

    from ethogram.worlds.softbody import SoftBody3D
    from ethogram.worlds.softbody.controllers import NonSensing
    from ethogram.worlds.softbody.gravity import schedule
    from ethogram.worlds.softbody.simulation import simulate

    world = SoftBody3D(body=body)
    cells = world.cells
    phase = np.random.default_rng(0).uniform(-np.pi, np.pi, len(cells))
    genes = np.stack([np.zeros(len(cells)), phase], 1).reshape(-1, 1)
    plain = Body(cells)
    start = np.mean(plain.position, 0)[0]
    began = time.perf_counter()
    for step in range(LOOPED):
        edges = 0.01 * (1 + 0.1 * np.sin(2 * np.pi * 40 * step * TIME + phase))
        plain.step(edges, (0.0, 0.0, -9.81))
    spent = time.perf_counter() - began
    way = np.mean(plain.position, 0)[0] - start
    ours = simulate(world, NonSensing(len(cells)), jnp.asarray(genes), schedule("even", LOOPED))
    if not np.isclose(ours.distance[0], way, rtol=0.02, atol=1e-6):
        raise RuntimeError(f"{body}: the loop goes {way} m, Ethogram {ours.distance[0]} m")
    return LOOPED * len(cells) / spent


def beside_jax(body: str, kernel: str) -> dict[str, float] | None:
    """Voxel-steps per second of processor time by a kernel, or by JAX ("none").

    None if the kernel cannot be used here.
    """
    import equinox as eqx
    import jax
    import jax.numpy as jnp

    from ethogram.core.errors import EthogramError
    from ethogram.core.rollout import rollout
    from ethogram.physics import native
    from ethogram.physics.beams3d import simulate as physics
    from ethogram.worlds.softbody import SoftBody3D
    from ethogram.worlds.softbody.controllers import NonSensing, Sensing, policy
    from ethogram.worlds.softbody.gravity import schedule
    from ethogram.worlds.softbody.simulation import simulate

    try:
        if (native.variant(kernel) or "none") != kernel:
            return None
    except EthogramError:
        return None
    world, robots = SoftBody3D(body=body, kernel=kernel), 256
    voxels = len(world.cells)
    gravity, keys = schedule("even", STEPS), jax.random.split(jax.random.key(0), robots)
    phase = jax.random.uniform(jax.random.key(0), (voxels, robots), minval=-3.0, maxval=3.0)
    edges = 0.01 * (1 + 0.1 * jnp.sin(0.0358 * jnp.arange(STEPS)[:, None, None] + phase))
    controllers = NonSensing(voxels), Sensing(voxels)
    genes = [
        jax.random.uniform(jax.random.key(1), (each.search_space.size, robots), minval=-1.0)
        for each in controllers
    ]

    @eqx.filter_jit
    def alone(world, edges):
        start = world.at_rest(edges.shape[2:])
        return physics(
            world.body, world.material, start, edges, gravity, kernel=world.kernel
        ).position

    @eqx.filter_jit
    def rolled(world, controller, genes):
        def run(key, genome):
            act = policy(controller, genome, world.material.edge)
            return rollout(world, act, key, STEPS, keep=lambda t: t.outcome.reward["robot"])[1]

        return jax.vmap(run, (0, 1))(keys, genes)

    whole = eqx.filter_jit(lambda *of: simulate(*of).distance)

    def rate(go, *arguments, of=robots):
        go(*arguments).block_until_ready()
        began, episodes = time.process_time(), 0
        while time.process_time() - began < SECONDS:
            go(*arguments).block_until_ready()
            episodes += 1
        return episodes * STEPS * of * voxels / (time.process_time() - began)

    return {
        "physics, 256 robots": rate(alone, world, edges),
        "physics, one robot": rate(alone, world, edges[..., 0], of=1),
        "non-sensing": rate(whole, world, controllers[0], genes[0], gravity),
        "sensing": rate(whole, world, controllers[1], genes[1], gravity),
        "rollout": rate(rolled, world, controllers[1], genes[1]),
    }


def kernels_beside_jax() -> list[dict[str, object]]:
    """The second table: a row per body and kernel."""
    rows = []
    for name in ("tripod", "4x4x3"):
        in_jax = alone(beside_jax, BODIES[name], "none")
        for kernel in KERNELS:
            found = alone(beside_jax, BODIES[name], kernel)
            if found is None:
                continue
            if not rows:
                print("\n| body | kernel |", " | ".join(found), "|")
                print("| --- | --- |" + " ---: |" * len(found))
            figures = (f"{found[of] / 1e6:.1f} M/s ({found[of] / in_jax[of]:.1f}x)" for of in found)
            print(f"| {name} | {kernel} |", " | ".join(figures), "|", flush=True)
            rows.append({"body": name, "kernel": kernel, "rates": found, "jax": in_jax})
    return rows


def total(cores: int, body: str, kind: str) -> list[float]:
    """The sum over processes that measure at the same time, for each number of robots."""
    return [sum(same) for same in zip(*side_by_side(cores, rates, body, kind), strict=True)]


def main() -> None:
    """Measure, print a table, and keep the figures where asked."""
    chosen = options(__doc__)
    columns = [f"{kind}, {cores}" for kind in KINDS for cores in ("one core", "all cores")]
    print("| body | robots |", " | ".join(columns), "| a loop in NumPy, one core |")
    print("| --- | ---: |" + " ---: |" * (len(columns) + 1))
    rows = []
    for name, body in BODIES.items():
        loop = alone(looped, body)
        each = [total(cores, body, kind) for kind in KINDS for cores in (1, chosen.cores)]
        for robots, *found in zip(ROBOTS, *each, strict=True):
            figures = " | ".join(f"{rate / 1e6:.2f} M/s" for rate in found)
            print(f"| {name} | {robots} | {figures} | {loop / 1e3:.2f} k/s |", flush=True)
            rows.append(
                {"body": name, "robots": robots, "loop": loop}
                | dict(zip(columns, found, strict=True))
            )
    at = {(row["body"], row["robots"]): row for row in rows}
    speed = min(
        at[body, 256][f"{kind}, all cores"] for body in ("worm", "tripod") for kind in KINDS
    )
    hours = THESIS_VOXEL_STEPS / speed / 3600
    print(
        f"\nThe thesis' campaign, {THESIS_VOXEL_STEPS:.3g} voxel-steps: {hours:.1f} h at the "
        "slowest figure of worm and tripod with 256 robots on all cores. The plan `thesis`, in "
        f"which sensing controllers have two output laws: {1.5 * hours:.1f} h."
    )
    kernels = kernels_beside_jax()
    if chosen.json:
        about = {"cores": chosen.cores, "python": sys.version.split()[0]}
        chosen.json.write_text(json.dumps(about | {"rows": rows, "kernels": kernels}))


if __name__ == "__main__":
    main()
