"""How fast cars drive in the traffic world, and drivers learn, beside the packages people use.

    pip install -e '.[bench]' stable-baselines3  # the peers; one that is missing is left out
    python benchmarks/traffic.py [--cores 2] [--json FILE]

Driving: car-steps per second.  A car-step is one car for one step of 0.2 s: its action is carried
out, and all that its driver goes by is looked up.  Here that is the observation (the car, the road,
the nearest cars ahead in three lanes and their speeds), collisions with what follows from them, the
three rules and the reward; all are summed into the scan's carry and out to the caller, so that
nothing can be optimised away.  The peers drive as many cars on the same graph: in every step each
car's speed, position, lane, and the car ahead with the gap to it are read through the package's own
functions, and its acceleration and lane are written (`benchmarks/peers`).  Actions are drawn
beforehand on all sides.  SUMO (through libsumo) is also timed for its steps alone.  Copies of our
world are made by `vmap`; the peers have one.

Up to 80 cars drive on the usual one-way grid, with sections of 100 m; for more, sections are so
much longer that cars meet as often as 40 on the usual one.

Learning: samples per second of whole updates of PPO, playing and learning.  40 drivers, one episode
of 500 steps an update, 10 epochs, two networks of 2 x 64: ours, and Stable-Baselines3's in the
same world, one compiled program per step, whose drivers are its vector of environments.  It brings
PyTorch, which is some gigabytes, and so is in no extra.

The sides take turns, `ROUNDS` times; a figure is the median, followed by the range.  It is the sum
over one process per core, each with one thread, at the same time, which is how a campaign uses the
machine.  Seconds are those of the processor.  Compiling is not counted.
"""

import json
import statistics
import sys
import time
from importlib.metadata import version
from importlib.util import find_spec
from itertools import count
from typing import Any

from common.processes import Place, options, side_by_side
from common.rounds import Run, in_turn, in_words, summed

CARS, COPIES = (10, 40, 80, 200, 500, 1000), (1, 64, 1024)
LENGTH = 100.0  # m, of the usual grid's sections
USUAL, CROWD = 40, 80  # cars on the usual grid; the most on it
STEPS = 200_000  # car-steps of a call, about; so many that the price of a call vanishes
ROUNDS, SECONDS = 3, 0.5  # of the processor, for each side in a round
TABLE = 97  # rows of actions, used in turn
MINIBATCHES = (2000, 256, 64)  # the last one is the default of Stable-Baselines3
MODULES = {
    "libsumo": "libsumo",
    "highway-env": "highway_env",
    "stable-baselines3": "stable_baselines3",
}
THAT_READ = ("libsumo", "highway-env")


def world_of(cars: int):
    """Cars on the usual one-way grid, or on one on which they meet as often as `USUAL` there."""
    from ethogram.worlds.traffic import Traffic
    from ethogram.worlds.traffic.graph import grid_oneway

    graph = grid_oneway(LENGTH if cars <= CROWD else LENGTH * cars / USUAL)
    return Traffic(graph=graph, cars=cars, max_cars=cars)


def ethogram(cars: int, copies: int) -> Run:
    """Our world, in some copies."""
    import jax
    import jax.numpy as jnp
    from jax import lax

    from ethogram.core.keys import branch

    world = world_of(cars)
    steps = max(1, STEPS // (cars * copies))
    actions = jax.random.randint(jax.random.key(1), (TABLE, cars, 2), 0, 3)
    keys = jax.random.split(jax.random.key(0), copies)

    @jax.jit
    def chunk(carry, first):
        def advance(carry, number):
            state, total = carry
            action = {"driver": actions[number % TABLE]}

            def one(key, state):
                after, outcome = world.step(branch(key, number), state, action)
                seen = outcome.observation["driver"].sum() + outcome.reward["driver"].sum()
                return after, seen + outcome.metrics["breaches"].sum()

            state, seen = jax.vmap(one)(keys, state)
            return (state, total + seen), None

        return lax.scan(advance, carry, first + jnp.arange(steps))[0]

    carry = jax.jit(jax.vmap(lambda key: world.reset(key)[0]))(keys), jnp.zeros(copies)
    calls = count()

    def run() -> int:
        nonlocal carry
        carry = chunk(carry, next(calls) * steps)
        if not jnp.abs(carry[1]).min() > 0:
            raise RuntimeError("nothing was seen: the benchmark does not measure driving")
        return steps * copies * cars

    return run


def driving(cars: int, peers: list[str], place: Place) -> tuple[list[dict[str, float]], int]:
    """Car-steps per second of each side, round by round; and how many cars came into SUMO."""
    world, came = world_of(cars), cars
    runs = {name_of(copies): ethogram(cars, copies) for copies in COPIES}
    if "libsumo" in peers:
        from peers.sumo import sumo

        names, runs["libsumo"], runs["SUMO's steps alone"] = sumo(world, cars, place.core)
        came = len(names)
    if "highway-env" in peers:
        from peers.highway import highway

        runs["highway-env"] = highway(world, cars, place.core)
    return in_turn(runs, place, ROUNDS, SECONDS), came


def name_of(copies: int) -> str:
    """Of a side."""
    return "1 copy" if copies == 1 else f"{copies} copies"


def learning(peers: list[str], place: Place) -> list[dict[str, float]]:
    """Samples per second of each side, round by round."""
    runs = {f"ethogram, {size}": ours(size) for size in MINIBATCHES}
    if "stable-baselines3" in peers:
        from peers.stable_baselines import updates

        for size in MINIBATCHES:
            runs[f"stable-baselines3, {size}"] = updates(world_of(USUAL), size, place.core)
    return in_turn(runs, place, ROUNDS, SECONDS)


def ours(minibatch_size: int) -> Run:
    """An update of our PPO, with the objective that Stable-Baselines3 has."""
    import jax
    import jax.numpy as jnp

    from ethogram.core.keys import fold_in
    from ethogram.learners.ppo import PPO

    world = world_of(USUAL)
    learner = PPO(world, episodes_per_update=1, epochs=10, minibatch_size=minibatch_size)
    update = jax.jit(learner.update, donate_argnums=1)
    key, calls = jax.random.key(0), count()
    state = jax.jit(learner.init)(key)

    def run() -> int:
        nonlocal state
        state, metrics = update(fold_in(key, next(calls)), state)
        if not jnp.isfinite(metrics["value_loss"]["driver"]).all():
            raise RuntimeError("the learner has diverged: the benchmark does not measure training")
        return world.horizon * USUAL

    return run


def world_speed(cores: int, peers: list[str]) -> list[dict[str, Any]]:
    """Print the tables of driving; return every round."""
    rows, medians = [], {}
    for cars in CARS:
        found = side_by_side(cores, driving, cars, peers, quiet=True)
        rounds = summed([rates for rates, _ in found])
        came = min(came for _, came in found)
        if not rows:
            sides = list(rounds)
            heading("thousand car-steps/s, all cores", [*sides, "cars in SUMO"])
        line(cars, [*(in_words(rounds[side], 1e3, 0) for side in sides), str(came)])
        medians[cars] = {side: statistics.median(rates) for side, rates in rounds.items()}
        rows.append({"cars": cars, "cars_in_sumo": came, "rounds": rounds})
    heading("ns of a core for a car-step", sides)
    for cars, rates in medians.items():
        line(cars, [f"{1e9 * cores / rates[side]:,.0f}" for side in sides])
    pairs = [(ours, peer) for peer in THAT_READ if peer in sides for ours in map(name_of, COPIES)]
    heading("times as fast", [f"{ours} / {peer}" for ours, peer in pairs])
    for cars, rates in medians.items():
        line(cars, [f"{rates[ours] / rates[peer]:,.1f}" for ours, peer in pairs])
    return rows


def heading(title: str, columns: list[str]) -> None:
    """Of a table with a row for each number of cars."""
    print(f"\n{title}\n\n| cars |", " | ".join(columns), "|")
    print("| ---: |" + " ---: |" * len(columns))


def line(cars: int, cells: list[str]) -> None:
    """Of such a table."""
    print(f"| {cars} |", " | ".join(cells), "|", flush=True)


def learning_speed(cores: int, peers: list[str]) -> dict[str, list[float]]:
    """Print the table of learning; return every round."""
    rounds = summed(side_by_side(cores, learning, peers, quiet=True))
    print("\n| learner, minibatch | samples/s, all cores |\n| --- | ---: |")
    for side, rates in rounds.items():
        print(f"| {side} | {in_words(rates, 1.0, 0)} |")
    return rounds


def main() -> None:
    """Measure, print tables, and keep the figures where asked."""
    chosen = options(__doc__)
    peers = [peer for peer, module in MODULES.items() if find_spec(module)]
    for peer in sorted(MODULES.keys() - peers):
        print(f"{peer} is left out: it is not installed", file=sys.stderr)
    began = time.monotonic()
    figures = {
        "driving": world_speed(chosen.cores, peers),
        "learning": learning_speed(chosen.cores, peers),
    }
    versions = {package: version(package) for package in ["jax", *peers]}
    minutes = (time.monotonic() - began) / 60
    print(f"\n{chosen.cores} cores, {minutes:.0f} min;", versions)
    if chosen.json:
        figures |= {
            "cores": chosen.cores,
            "python": sys.version.split()[0],
            "minutes": minutes,
            "versions": versions,
        }
        chosen.json.write_text(json.dumps(figures))


if __name__ == "__main__":
    main()
