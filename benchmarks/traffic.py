"""How fast cars drive in the traffic world, observed and rewarded.

    python benchmarks/traffic.py [--cores 2] [--json FILE]

A row of the output is a number of cars on the one-way grid and of copies of the world, made by
`vmap`.  A car-step is one car for one step, with its observation and its reward; both are summed
into the scan's carry and out to the caller, so that nothing can be optimised away.  Actions are
drawn beforehand.  "All cores" is the sum over one process per core, run at the same time, which is
how a campaign uses the machine.  1000 cars drive on a grid whose sections are 2500 m long, so that
they meet as often as 40 on the usual one.  Compiling is not counted.
"""

import json
import sys
import time

from common.processes import Place, options, side_by_side

CARS, COPIES = (10, 40, 80, 1000), (1, 64, 1024)
LENGTH = 2500.0  # m, of the sections that 1000 cars drive on
STEPS = 2_000_000  # car-steps of a call, about
WARM_UP, SECONDS = 0.5, 4.0  # per measurement
TABLE = 97  # rows of actions, used in turn


def measure(cars: int, copies: int, place: Place) -> float:
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
    place.start()
    carry, rate = run_for(SECONDS, carry)
    if not float(abs(carry[1]).sum()) > 0:
        raise RuntimeError("nothing was seen: the benchmark does not measure driving")
    return rate


def main() -> None:
    """Measure, print a table, and keep the figures where asked."""
    chosen = options(__doc__)
    rows = []
    print("| cars | copies | one core, car-steps/s | all cores | ns per car-step, one core |")
    print("| ---: | ---: | ---: | ---: | ---: |")
    for cars in CARS:
        for copies in COPIES:
            one, every = (
                sum(side_by_side(cores, measure, cars, copies)) for cores in (1, chosen.cores)
            )
            rows.append({"cars": cars, "copies": copies, "one_core": one, "all_cores": every})
            print(
                f"| {cars} | {copies} | {one / 1e6:.2f} M | {every / 1e6:.2f} M "
                f"| {1e9 / one:.0f} |",
                flush=True,
            )
    if chosen.json:
        chosen.json.write_text(
            json.dumps({"cores": chosen.cores, "python": sys.version.split()[0], "rows": rows})
        )


if __name__ == "__main__":
    main()
