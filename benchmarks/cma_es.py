"""How long a generation of CMA-ES takes, beside the packages people use.

    pip install -e '.[dev]'  # the peers among it; one that is missing is left out
    python benchmarks/cma_es.py [--cores 2] [--json FILE]

A generation asks for 4 + floor(3 ln n) candidates, evaluates the sphere for all at once, and
tells; a full covariance is decomposed as often as each side's rule has it.  Ours goes by a compiled
loop, as in training, alone and, as `10 runs`, side by side; compiling is not counted.  The peers
are used as their pages say, in NumPy.  At 5252 genes, a network that drives a robot of the thesis,
only separable covariances are timed: a full one has 28 million numbers.

The sides take turns, `ROUNDS` times; a figure is the median, followed by the range, in milliseconds
of the processor for a generation of one run.  All cores do the same at the same time, each in one
process with one thread.
"""

import json
import statistics
import sys
from importlib.metadata import version
from importlib.util import find_spec

from common.processes import Place, options, side_by_side
from common.rounds import Run, in_turn, summed

GENES = (20, 100, 1000, 5252)
MOST_FULL = 1000  # genes of a full covariance that is timed
MOST_RUNS, RUNS = 100, 10  # genes up to which some runs are timed side by side, and how many
ROUNDS, SECONDS = 3, 0.5  # of the processor, for each side in a round
GENERATIONS = {20: 400, 100: 100, 1000: 40, 5252: 40}  # of a call of ours
SIGMA = 0.5
PEERS = ("cma", "cmaes")


def ethogram(genes: int, kind: str, runs: int) -> Run:
    """Ours: some generations from the first one on, so that numbers stay as in a real run."""
    import equinox as eqx
    import jax
    import jax.numpy as jnp
    import numpy as np
    from jax import lax

    from ethogram.core.keys import fold_in, trial_keys
    from ethogram.core.search_space import SearchSpace
    from ethogram.learners.base import Trials
    from ethogram.learners.evolution import CMAES, Evaluation

    class Sphere(eqx.Module):
        deterministic: bool = eqx.field(static=True, default=True)

        def __call__(self, key, genomes):
            del key
            return Evaluation(-(genomes**2).sum(-1), jnp.zeros(len(genomes), bool))

    nowhere = np.full(genes, np.inf)
    space = SearchSpace(np.zeros(genes), np.ones(genes), -nowhere, nowhere)
    learner, key = Trials(CMAES(space, Sphere(), covariance=kind)), trial_keys(0, "speed", runs)
    start, generations = jax.jit(learner.init)(key), GENERATIONS[genes]

    @jax.jit
    def evolve(state):
        def update(number, state):
            return learner.update(fold_in(key, number), state)[0]

        return lax.fori_loop(0, generations, update, state).best_ever.fitness

    def run() -> int:
        if not np.isfinite(evolve(start)).all():
            raise RuntimeError("it has diverged: the benchmark does not measure evolution")
        return generations * runs

    return run


def peer(name: str, genes: int, kind: str) -> Run:
    """A generation of a peer's."""
    import numpy as np

    start = np.random.default_rng(0).uniform(size=genes)
    if name == "cma":
        import cma

        chosen = {"verbose": -9, "seed": 1, "CMA_diagonal": kind == "separable"}
        strategy = cma.CMAEvolutionStrategy(start, SIGMA, chosen)

        def run() -> int:
            candidates = strategy.ask()
            strategy.tell(candidates, (np.array(candidates) ** 2).sum(1).tolist())
            return 1

        return run
    import cmaes

    strategy = (cmaes.SepCMA if kind == "separable" else cmaes.CMA)(start, SIGMA, seed=1)

    def run_cmaes() -> int:
        candidates = [strategy.ask() for _ in range(strategy.population_size)]
        values = (np.array(candidates) ** 2).sum(1).tolist()
        strategy.tell(list(zip(candidates, values, strict=True)))
        return 1

    return run_cmaes


def measure(genes: int, kind: str, place: Place) -> list[dict[str, float]]:
    """Generations per second of every side."""
    sides = {"ethogram": ethogram(genes, kind, 1)}
    if genes <= MOST_RUNS:
        sides[f"{RUNS} runs"] = ethogram(genes, kind, RUNS)
    sides |= {name: peer(name, genes, kind) for name in PEERS if find_spec(name)}
    return in_turn(sides, place, ROUNDS, SECONDS)


def main() -> None:
    """Print a table, and write it as JSON if asked."""
    found = options(__doc__)
    there = [name for name in PEERS if find_spec(name)]
    print(", ".join([f"{name} {version(name)}" for name in ("jax", *there)]))
    for name in set(PEERS) - set(there):
        print(f"{name} is not installed and is left out", file=sys.stderr)
    rows = {}
    for genes in GENES:
        for kind in ("full", "separable"):
            if kind == "full" and genes > MOST_FULL:
                continue
            rates = summed(side_by_side(found.cores, measure, genes, kind, quiet=True))
            rows[f"{genes} {kind}"] = rates
            print(f"{genes} genes, {kind}")
            for side, all_rounds in rates.items():
                took = [1000 * found.cores / rate for rate in all_rounds]
                print(
                    f"  {side:10} {statistics.median(took):10.3f} ms "
                    f"({min(took):.3f} to {max(took):.3f})",
                    flush=True,
                )
    if found.json:
        found.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
