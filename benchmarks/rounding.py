"""How much the last bits of numbers matter to the way that evolved robots go.

    python benchmarks/rounding.py [docs/results/records] [--block-size 16]

The best robots of the study `sensing`, as stored, travel again as they were evolved, which gives
their fitness to the last bit on the type of machine that evolved them, and in blocks of another
size, which a compiler rounds otherwise.  Not a measure of speed, but of how far a printed distance
depends on the machine that computed it.
"""

import argparse
import time
from pathlib import Path

PUBLISHED = Path(__file__).parents[1] / "docs/results/records"
BLOCK_SIZE = 16


def main() -> None:
    """Simulate the robots of every stored case again, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", default=PUBLISHED, help="of results")
    parser.add_argument("--block-size", type=int, default=BLOCK_SIZE, help="robots in a block")
    options = parser.parse_args()

    from ethogram.campaign.threads import limit_threads

    limit_threads()  # as in a campaign: other threads round otherwise
    import equinox as eqx
    import jax.numpy as jnp
    import numpy as np

    from ethogram.campaign.results import collect, stores
    from ethogram.studies.sensing.compute import learner_of
    from ethogram.studies.sensing.plan import NAME, Settings, controller_of, world_of
    from ethogram.worlds.softbody.simulation import simulate

    began = time.monotonic()
    found = collect(stores(options.folder)[NAME])
    print(
        "| case | runs | mean fitness (mm) | in other blocks (mm) | largest change of a run (mm) |"
    )
    print("| --- | ---: | ---: | ---: | ---: |")
    changed = []
    for manifest in found.manifests:
        case, data = manifest.case, found.records[manifest.case.name]["results"]
        settings = case.parsed(Settings)
        gravity = learner_of(settings).fitness.gravity
        genes = jnp.asarray(data["genome"].values.T)
        go = eqx.filter_jit(simulate)
        same, other = (
            np.asarray(
                go(
                    world_of(settings), controller_of(settings), genes, gravity, block_size=size
                ).distance
            )
            for size in (None, options.block_size)
        )
        fitness = data["fitness"].values[:, -1]
        if not np.array_equal(same, fitness):
            changed.append(case.name)
        print(
            f"| {case.name} | {len(fitness)} | {1000 * fitness.mean():.1f} "
            f"| {1000 * other.mean():.1f} | {1000 * np.abs(other - fitness).max():.1f} |",
            flush=True,
        )
    print(f"\n{time.monotonic() - began:.0f} s")
    if changed:
        print(f"Not as stored, even in the same blocks: {', '.join(changed)}.")


if __name__ == "__main__":
    main()
