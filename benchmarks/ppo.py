"""How many samples a second PPO learns from, playing them included.

    python benchmarks/ppo.py [--seconds 5] [--json FILE]

A sample is one agent in one step.  With the settings of the presets `thesis` and `modern`, in the
sharing world with ten agents (a vector of what is observed, one policy for all) and in the language
world with two robots (two roles), one process.  The figure is of the processor's time, the
compilation left out; returns are read after each update, so that nothing can be optimised away.
"""

import argparse
import json
import time
from pathlib import Path

import jax
import jax.numpy as jnp

from ethogram.campaign.threads import limit_threads
from ethogram.core.keys import fold_in
from ethogram.learners.ppo import PPO, PRESETS
from ethogram.worlds.language import Language
from ethogram.worlds.sharing import Sharing

WORLDS = {
    "sharing": Sharing(observe_filling=True, encoding="vector"),
    "language": Language(robots=2, vocabulary_size=4),
}
SAMPLES = 20_000  # in an update, about


def measure(world, preset: str, seconds: float) -> dict[str, float]:
    """Samples per second of the processor, and how many an update has."""
    agents = sum(role.agents for role in world.roles.values())
    episodes = max(1, SAMPLES // (agents * world.horizon))
    learner = PPO(world, **{**PRESETS[preset], "episodes_per_update": episodes})
    update = jax.jit(learner.update, donate_argnums=1)
    key = jax.random.key(0)
    state, done = jax.jit(learner.init)(key), 0

    def run() -> None:
        nonlocal state, done
        state, metrics = update(fold_in(key, done), state)
        if not all(jnp.isfinite(each).all() for each in metrics["episode_return"].values()):
            raise RuntimeError("the learner has diverged: the benchmark does not measure training")
        done += 1

    run()  # compiles
    began, first = time.process_time(), done
    while (took := time.process_time() - began) < seconds:
        run()
    samples = episodes * world.horizon * agents
    return {"samples_per_second": (done - first) * samples / took, "samples": samples}


def main() -> None:
    """Print a table, and write it as JSON if asked."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    limit_threads()  # as in a campaign: one thread per process
    found = {}
    for name, world in WORLDS.items():
        for preset in ("thesis", "modern"):
            row = found[f"{name} {preset}"] = measure(world, preset, options.seconds)
            print(
                f"{name:10} {preset:8} {row['samples']:8,} samples an update"
                f"{row['samples_per_second']:12,.0f} samples/s"
            )
    if options.json:
        options.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
