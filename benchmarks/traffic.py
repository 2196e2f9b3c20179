"""How fast cars drive in the traffic world, observed and rewarded.

    python benchmarks/traffic.py [--cores 2] [--json FILE]

A row of the output is a number of cars on the one-way grid and of copies of the world, made by
`vmap`.  A car-step is one car for one step, with its observation and its reward; both are summed
into the scan's carry and out to the caller, so that nothing can be optimised away.  Actions are
drawn beforehand.  "All cores" is the sum over one process per core, run at the same time, which is
how a campaign uses the machine.  1000 cars drive on a grid whose sections are 2500 m long, so that
they meet as often as 40 on the usual one.  Compiling is not counted.
"""

import argparse
import json
import multiprocessing
import os
import sys
import time
from pathlib import Path

CARS, COPIES = (10, 40, 80, 1000), (1, 64, 1024)
LENGTH = 2500.0  # m, of the sections that 1000 cars drive on
STEPS = 2_000_000  # car-steps of a call, about
WARM_UP, SECONDS = 0.5, 4.0  # per measurement
PATIENCE = 600.0  # seconds
TABLE = 97  # rows of actions, used in turn


def measure(cars: int, copies: int, start: "multiprocessing.Barrier") -> dict[str, float]:
    """Car-steps per second in this process."""
    import jax
    import jax.numpy as jnp
    from jax import lax

    from ethogram.core.keys import branch
    from ethogram.worlds.traffic import Traffic
    from ethogram.worlds.traffic.graph import grid_oneway

    graph = grid_oneway(LENGTH if cars > max(CARS[:-1]) else 100.0)
    world = Traffic(graph=graph, cars=cars, max_cars=cars)
    steps = max(1, STEPS // (cars * copies))
    actions = jax.random.randint(jax.random.key(1), (TABLE, cars, 2), 0, 3)
    keys = jax.random.split(jax.random.key(0), copies)

    @jax.jit
    def chunk(carry):
        def advance(carry, number):
            state, total = carry
            action = {"driver": actions[number % TABLE]}

            def one(key, state):
                after, outcome = world.step(branch(key, number), state, action)
                seen = outcome.observation["driver"].sum() + outcome.reward["driver"].sum()
                return after, seen + outcome.metrics["breaches"].sum()

            state, seen = jax.vmap(one)(keys, state)
            return (state, total + seen), None

        return lax.scan(advance, carry, jnp.arange(steps))[0]

    carry = jax.jit(jax.vmap(lambda key: world.reset(key)[0]))(keys), jnp.zeros(copies)

    def run_for(seconds, carry):
        began, chunks = time.perf_counter(), 0
        while time.perf_counter() - began < seconds:
            carry = jax.block_until_ready(chunk(carry))
            chunks += 1
        return carry, chunks * steps * copies * cars / (time.perf_counter() - began)

    carry, _ = run_for(WARM_UP, carry)  # compiles
    start.wait()
    carry, rate = run_for(SECONDS, carry)
    if not float(abs(carry[1]).sum()) > 0:
        raise RuntimeError("nothing was seen: the benchmark does not measure driving")
    return {"car_steps_per_second": rate}


def _worker(cars, copies, start, answers):
    answers.put(measure(cars, copies, start))


def side_by_side(processes: int, cars: int, copies: int) -> float:
    """The sum over processes that measure at the same time."""
    context = multiprocessing.get_context("spawn")
    start, answers = context.Barrier(processes), context.Queue()
    crew = [
        context.Process(target=_worker, args=(cars, copies, start, answers))
        for _ in range(processes)
    ]
    for process in crew:
        process.start()
    found = [answers.get(timeout=PATIENCE) for _ in crew]  # a process that died never answers
    for process in crew:
        process.join()
    return sum(each["car_steps_per_second"] for each in found)


def main() -> None:
    """Measure, print a table, and keep the figures where asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cores", type=int, default=os.cpu_count())
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()

    from ethogram.campaign.threads import limit_threads

    limit_threads()  # as in a campaign: one thread per process
    rows = []
    print("| cars | copies | one core, car-steps/s | all cores | ns per car-step, one core |")
    print("| ---: | ---: | ---: | ---: | ---: |")
    for cars in CARS:
        for copies in COPIES:
            one = side_by_side(1, cars, copies)
            every = side_by_side(options.cores, cars, copies)
            rows.append({"cars": cars, "copies": copies, "one_core": one, "all_cores": every})
            print(
                f"| {cars} | {copies} | {one / 1e6:.2f} M | {every / 1e6:.2f} M "
                f"| {1e9 / one:.0f} |",
                flush=True,
            )
    if options.json:
        options.json.write_text(
            json.dumps({"cores": options.cores, "python": sys.version.split()[0], "rows": rows})
        )


if __name__ == "__main__":
    main()
