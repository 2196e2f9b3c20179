"""How fast tabular Q-learning trains in the sharing world.

    python benchmarks/sharing.py [--cores 2] [--json FILE]

Optional communication with the filling observed, ten agents, two resources: the largest table.
A row of the output is a number of trials trained side by side in one process, at one exploration
rate; "all cores" is the sum over one such process per core, run at the same time, which is how a
campaign uses the machine.  Every return goes into the scan's carry and out to the caller, so
that nothing can be optimised away.
"""

import json
import resource
import sys
import time

from common.processes import Place, options, side_by_side

TRIALS = (1, 20, 80)
EPSILONS = (1.0, 0.01)
WARM_UP, SECONDS = 1.0, 8.0  # per measurement
THESIS_AGENT_STEPS = 24 * 20 * 20_000 * 100 * 10


def measure(trials: int, epsilon: float, place: Place) -> dict[str, float]:
    """Agent-steps per second in this process, and its peak memory in bytes."""
    import equinox as eqx
    import jax.numpy as jnp
    from jax import lax

    from ethogram.core.keys import fold_in, trial_keys
    from ethogram.learners.qlearning import QLearning
    from ethogram.learners.schedules import Constant
    from ethogram.worlds.sharing import Sharing

    world = Sharing(communication="optional", observe_filling=True)
    learner = QLearning(world, Constant(epsilon))
    episodes = max(1, 1000 // trials)

    def chunk(fixed, carry):
        learner, keys, first = fixed

        def episode(carry, number):
            state, total = carry
            state, metrics = learner.update(fold_in(keys, number), state)
            return (state, total + metrics["episode_return"]["agent"].sum()), None

        return lax.scan(episode, carry, first + jnp.arange(episodes))[0]

    chunk = eqx.filter_jit(chunk, donate="all-except-first")
    keys = trial_keys(0, "benchmark", trials)
    carry = learner.init(keys), jnp.float32(0)
    done = 0

    def run_for(seconds, carry, done):
        began, chunks = time.perf_counter(), 0
        while time.perf_counter() - began < seconds:
            carry = chunk((learner, keys, jnp.int32(done)), carry)
            carry[1].block_until_ready()
            chunks, done = chunks + 1, done + episodes
        return carry, done, chunks * episodes / (time.perf_counter() - began)

    carry, done, _ = run_for(WARM_UP, carry, done)  # compiles
    place.start()
    carry, done, rate = run_for(SECONDS, carry, done)
    if not float(carry[1]) > 0:
        raise RuntimeError("nothing was earned: the benchmark does not measure training")
    return {
        "agent_steps_per_second": rate * trials * world.steps * world.agents,
        "peak_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
    }


def total(cores: int, trials: int, epsilon: float) -> dict[str, float]:
    """The sum over processes that measure at the same time."""
    found = side_by_side(cores, measure, trials, epsilon)
    return {name: sum(each[name] for each in found) for name in found[0]}


def main() -> None:
    """Measure, print a table, and keep the figures where asked."""
    chosen = options(__doc__)
    rows = []
    print("| trials | epsilon | one core | all cores | peak memory, one process | thesis plan |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: |")
    for trials in TRIALS:
        for epsilon in EPSILONS:
            one, every = (total(cores, trials, epsilon) for cores in (1, chosen.cores))
            minutes = THESIS_AGENT_STEPS / every["agent_steps_per_second"] / 60
            rows.append(
                {
                    "trials": trials,
                    "epsilon": epsilon,
                    "one_core": one["agent_steps_per_second"],
                    "all_cores": every["agent_steps_per_second"],
                    "peak_bytes": one["peak_bytes"],
                    "thesis_plan_minutes": minutes,
                }
            )
            print(
                f"| {trials} | {epsilon} | {one['agent_steps_per_second'] / 1e6:.1f} M/s "
                f"| {every['agent_steps_per_second'] / 1e6:.1f} M/s "
                f"| {one['peak_bytes'] / 1e9:.2f} GB | {minutes:.1f} min |",
                flush=True,
            )
    if chosen.json:
        chosen.json.write_text(
            json.dumps({"cores": chosen.cores, "python": sys.version.split()[0], "rows": rows})
        )


if __name__ == "__main__":
    main()
