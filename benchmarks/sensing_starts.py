"""How many starts it takes to rank soft robots by how far they get.

    python benchmarks/sensing_starts.py [docs/results/records] [--robots 24] [--pool 64]
        [--bodies biped,tripod] [--steps 10000] [--scale 1,10] [--json FILE]

A robot's fitness is the mean distance over k starts that differ slightly from rest, on the even
surface.  Robots are ranked twice, by two sets of k starts that have none in common, and the two
rankings are compared by Spearman's correlation: 1 where fitness is what a robot does, 0 where it is
luck.  Sets are drawn again and again from a pool of starts, and correlations averaged.  Where
robots do not move as the start says, even one start ranks them well.

Two groups of robots are ranked, apart: `random` ones, as an evolution begins, and `evolved` ones,
the best of the stored runs with mutants of theirs, as an evolution goes on.  A row is a controller,
a group, a kind of perturbation and its size.  "Luck" is the standard deviation over starts of how
far a robot gets, in mm, the mean over robots, "spread" that over robots of their means, and "mean"
the mean of these.

Not a measure of speed, but of what `starts` and `start` of the study `sensing` should be.
"""

import argparse
import dataclasses
import json
import time
from pathlib import Path

PUBLISHED = Path(__file__).parents[1] / "docs/results/records"
NUMBERS = (1, 2, 4, 8, 16, 32)  # k
PERTURBATIONS = {  # kind -> its smallest size
    "phase": {"phase": 0.01},  # rad
    "height": {"height": 1e-5},  # m
    "speed": {"speed": 1e-3},  # m/s, along x
    "in plane": {"phase": 0.01, "height": 1e-5, "speed": 1e-3},
    "sideways": {"sideways": 1e-3},  # m/s, along y
}
DRAWS = 200  # pairs of sets of starts
ROBOTS, POOL = 16, 32  # in a group; starts


def main() -> None:
    """Simulate robots from many starts, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", default=PUBLISHED, help="of results")
    parser.add_argument("--robots", type=int, default=ROBOTS, help="in a group")
    parser.add_argument("--pool", type=int, default=POOL, help="starts of every robot")
    parser.add_argument("--bodies", default="biped", help="with commas")
    parser.add_argument("--laws", default="shrink_limited,tanh,unbounded", help="with commas")
    parser.add_argument("--kinds", default=",".join(PERTURBATIONS), help="with commas")
    parser.add_argument("--scale", default="1,10", help="of the sizes, with commas")
    parser.add_argument("--steps", type=int, default=10_000, help="of a simulation")
    parser.add_argument("--json", type=Path, help="file for the table")
    options = parser.parse_args()

    from ethogram.campaign.threads import limit_threads

    limit_threads()
    import equinox as eqx
    import jax
    import jax.numpy as jnp
    import numpy as np

    from ethogram.campaign.results import collect, stores
    from ethogram.studies.sensing.compute import learner_of, simulate_starts
    from ethogram.studies.sensing.plan import NAME, Settings, controller_of, world_of
    from ethogram.worlds.softbody.gravity import schedule
    from ethogram.worlds.softbody.starts import StartDistribution

    began = time.monotonic()
    found = collect(stores(options.folder)[NAME])
    gravity = schedule("even", options.steps)
    go = eqx.filter_jit(simulate_starts)
    numbers = [number for number in NUMBERS if 2 * number <= options.pool]
    rows = []
    header = ("body", "law", "robots", "kind", "scale", "mean", "spread", "luck", *numbers)
    print("| " + " | ".join(map(str, header)) + " |\n" + "| --- " * len(header) + "|")
    for body in options.bodies.split(","):
        for law in options.laws.split(","):
            stored = [
                (each.case.parsed(Settings), found.records[each.case.name]["results"])
                for each in found.manifests
            ]
            ours = [(s, data) for s, data in stored if (s.world.body, s.law) == (body, law)]
            settings = dataclasses.replace(ours[0][0], surface="even")
            learner = learner_of(settings)
            best = np.concatenate([data["genome"].values for _, data in ours])[: options.robots]
            mutants = learner.ask(
                jax.random.key(1), _population(np.resize(best, (options.robots, best.shape[1])))
            )
            groups = {
                "random": learner.search_space.sample(jax.random.key(2), options.robots),
                "evolved": jnp.concatenate([best, mutants[: options.robots - len(best)]]),
            }
            genomes = jnp.concatenate([*groups.values()])
            for kind in options.kinds.split(","):
                for scale in map(float, options.scale.split(",")):
                    sizes = {name: scale * size for name, size in PERTURBATIONS[kind].items()}
                    none = dict.fromkeys(("phase", "height", "speed", "sideways"), 0.0)
                    distribution = StartDistribution(**(none | sizes))
                    starts = distribution.sample(jax.random.key(0), options.pool)
                    way = 1000 * np.asarray(
                        go(
                            world_of(settings), controller_of(settings), genomes.T, gravity, starts
                        ).distance,
                        float,
                    )
                    for number, group in enumerate(groups):
                        mine = way[number * options.robots :][: options.robots]
                        mine = mine[np.isfinite(mine).all(1)]
                        row = (
                            body,
                            law,
                            group,
                            kind,
                            scale,
                            mine.mean(),
                            mine.mean(1).std(ddof=1),
                            mine.std(1, ddof=1).mean(),
                            *(_agreement(mine, each) for each in numbers),
                        )
                        rows.append(dict(zip(map(str, header), row, strict=True)))
                        print("| " + " | ".join(map(_cell, row)) + " |", flush=True)
    print(f"\n{time.monotonic() - began:.0f} s")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))


def _agreement(way, number: int) -> float:
    """Spearman's correlation of robots' means over two sets of starts, the mean over draws."""
    import numpy as np
    from scipy.stats import spearmanr

    rng = np.random.default_rng(0)
    found = []
    for _ in range(DRAWS):
        chosen = rng.permutation(way.shape[1])[: 2 * number].reshape(2, number)
        found.append(spearmanr(*(way[:, each].mean(1) for each in chosen)).statistic)
    return float(np.mean(found))


def _population(genomes):
    """Genomes as a population whose mutants can be asked for."""
    import jax.numpy as jnp

    from ethogram.learners.evolution import Population

    size = len(genomes)
    return Population(
        jnp.asarray(genomes), jnp.zeros(size, int), jnp.zeros(size), jnp.zeros((), int)
    )


def _cell(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    main()
