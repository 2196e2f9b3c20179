"""How fast the language world steps, beside the same game in the packages people use.

    pip install -e '.[bench]'  # the peers; one that is missing is left out
    python benchmarks/language.py [--cores 2] [--json FILE]

The game is two robots, three targets and ten symbols, 25 steps an episode: our Language, JaxMARL's
MPE_simple_reference_v3 and mpe2's simple_reference_v3 (PettingZoo's particle environments), all
with discrete actions.  A robot is two agents to us, a mover and a talker, and one agent that does
both to the peers; so environment steps are counted, not agent steps.  Not all work is the same:
we answer four agents and let a robot hear itself (66 numbers observed a step, against 42), JaxMARL
computes noise and contact forces and then multiplies them by zero.

On all sides a step draws one number from 0 to 49 per robot, move and symbol, inside the loop, and
starts a new episode where one has ended.  In both JAX programs the observations after that, and
the rewards, are folded into the scan's carry, so that nothing can be optimised away; Python
optimises nothing away.  mpe2 steps one copy at a time, so that one stands for any number of them.

"Copies" are those of one process with one thread; there is such a process per core, all at the
same time, which is how a campaign uses the machine, and the figures are sums over them.  Seconds
are those of the processor: the clock's, since no process ever waits, unless other programs run.
The sides take turns, `ROUNDS` times; a figure is the median, followed by the range.

Then how fast MADDPG trains, with the thesis' parameters: environment steps per second, with the
update after every 100 of them; and how long the thesis plan would take, by the estimates of its
cases, corrected by how far those of these two sizes are off.
"""

import json
import statistics
import sys
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from itertools import count
from typing import TYPE_CHECKING, Any

from common.processes import Place, options, side_by_side
from common.rounds import Run, in_turn, in_words, summed

if TYPE_CHECKING:
    from ethogram.learners.maddpg import MADDPG

COPIES = (1, 256, 4096)
ROBOTS, TARGETS, SYMBOLS, STEPS = 2, 3, 10, 25  # what the peers' game has
MOVES = 5
ROUNDS, SECONDS = 5, 1.0  # of the processor, for each side in a round
STEPS_PER_CALL = 10_000  # about; so many that the price of a call vanishes


def ethogram(copies: int) -> Run:
    """Our world, stepped and reset by `rollout`."""
    import jax

    from ethogram.core.rollout import Position, rollout
    from ethogram.worlds.language import Language

    world = Language(
        robots=ROBOTS,
        targets=TARGETS,
        vocabulary_size=SYMBOLS,
        max_vocabulary_size=SYMBOLS,
        steps=STEPS,
    )

    def reset(key):
        return Position(*world.reset(key))

    def advance(key, at, choice):
        action = {
            "mover": jax.nn.one_hot(choice % MOVES, MOVES),
            "talker": jax.nn.one_hot(1 + choice // MOVES, 1 + SYMBOLS),  # word 0 is silence
        }
        after, taken = rollout(world, lambda *_: action, key, 1, at)
        return after, (after.observation, taken.outcome.reward)

    return in_batch(reset, advance, copies)


def jaxmarl(copies: int) -> Run:
    """JaxMARL's environment, whose own `step` resets it."""
    from jaxmarl import make

    environment = make("MPE_simple_reference_v3", max_steps=STEPS - 1)  # it takes one more

    def advance(key, at, choice):
        action = dict(zip(environment.agents, choice, strict=True))
        observation, state, reward, _, _ = environment.step(key, at[1], action)
        return (observation, state), (observation, reward)

    return in_batch(environment.reset, advance, copies)


def in_batch(reset: Callable, advance: Callable, copies: int) -> Run:
    """Random play in many copies of a world written in JAX.

    Args:
        reset: key -> where the world stands.
        advance: (key, where it stands, choice: Int[robot]) -> (where it stands then, all seen).
        copies: how many worlds are stepped together.

    """
    import jax
    import jax.numpy as jnp
    from jax import lax

    from ethogram.core.keys import fold_in, trial_keys

    steps = STEPS * max(1, STEPS_PER_CALL // (STEPS * copies))

    def step(carry, key):
        at, total = carry
        for_choice, for_world = jax.random.split(key)
        choice = jax.random.randint(for_choice, (ROBOTS,), 0, MOVES * SYMBOLS)
        at, seen = advance(for_world, at, choice)
        return (at, total + sum(part.sum() for part in jax.tree.leaves(seen))), None

    @jax.jit
    @jax.vmap
    def chunk(key, carry):
        return lax.scan(step, carry, jax.random.split(key, steps))[0]

    keys = trial_keys(0, "benchmark", copies)
    carry = jax.jit(jax.vmap(reset))(keys), jnp.zeros(copies)
    calls = count()

    def run() -> int:
        nonlocal carry
        carry = chunk(fold_in(keys, next(calls)), carry)
        if not jnp.abs(carry[1]).min() > 0:
            raise RuntimeError("nothing was seen: the benchmark does not measure stepping")
        return steps * copies

    return run


def mpe2(copies: int) -> Run:
    """One copy of mpe2's environment, whatever `copies` is."""
    del copies
    import numpy as np
    from mpe2 import simple_reference_v3

    environment = simple_reference_v3.parallel_env(max_cycles=STEPS)
    environment.reset(seed=0)
    generator = np.random.default_rng(0)

    def run() -> int:
        for _ in range(STEPS):
            choice = generator.integers(MOVES * SYMBOLS, size=ROBOTS)
            environment.step(dict(zip(environment.agents, choice, strict=True)))
            if not environment.agents:
                environment.reset()
        return STEPS

    return run


def training(robots: int, copies: int) -> Run:
    """One learner, in one world at a time.

    Every reward goes through the metrics to the caller, so that nothing can be optimised away.
    """
    del copies
    import jax
    import numpy as np

    from ethogram.learners.train import train

    learner = learner_at(robots)
    key = jax.random.key(0)
    done = CHUNK
    state, _ = train(learner, key, done)  # plays only

    def run() -> int:
        nonlocal state, done
        state, metrics = train(learner, key, done + CHUNK, state=state, start=done)
        if not np.abs(metrics["episode_return"]["mover"]).min() > 0:
            raise RuntimeError("nothing was earned: the benchmark does not measure training")
        if not np.isfinite(metrics["critic_loss"]["mover"]).all():
            raise RuntimeError("nothing was learned: the benchmark does not measure training")
        done += CHUNK
        return CHUNK * PER_UPDATE

    return run


def learner_at(robots: int) -> "MADDPG":
    """The learner of the thesis' smallest and largest game: e = 1 at 2x2, e = 4 at 4x4."""
    from ethogram.learners.maddpg import MADDPG
    from ethogram.worlds.language import Language

    symbols = TRAINED[robots]
    world = Language(
        robots=robots, targets=robots, vocabulary_size=symbols, max_vocabulary_size=symbols
    )
    return MADDPG(world, buffer_size=500_000, learning_starts=CHUNK * PER_UPDATE)


SIDES: dict[str, Callable[[int], Run]] = {"ethogram": ethogram, "jaxmarl": jaxmarl, "mpe2": mpe2}
TRAINED = {2: 4, 4: 64}  # symbols, by the number of robots and of targets
CHUNK = 10  # updates per call
PER_UPDATE = 100  # environment steps
MAKERS = SIDES | {f"{robots}x{robots}": partial(training, robots) for robots in TRAINED}


def measure(sides: list[str], copies: int, place: Place) -> list[dict[str, float]]:
    """Per round: environment steps per second of each side in this process."""
    return in_turn({side: MAKERS[side](copies) for side in sides}, place, ROUNDS, SECONDS)


def rounds_of(cores: int, sides: list[str], copies: int) -> dict[str, list[float]]:
    """Per side: the sum over one process per core in each round."""
    return summed(side_by_side(cores, measure, sides, copies, quiet=True))  # a peer prints


def world_speed(cores: int, sides: list[str]) -> list[dict[str, Any]]:
    """Print the table of environment steps per second; return its rows with every round."""
    peers = sides[1:]
    ratios = [f"ethogram / {peer}" for peer in peers]
    print("| copies a process |", " | ".join([*sides, *ratios]), "|")
    print("| ---: |" + " ---: |" * (len(sides) + len(peers)))
    rows = []
    for copies in COPIES:
        rounds = rounds_of(cores, sides, copies)
        median = {side: statistics.median(rates) for side, rates in rounds.items()}
        figures = [f"{in_words(rates, 1e3)} k/s" for rates in rounds.values()]
        times = [f"{median['ethogram'] / median[peer]:,.1f}" for peer in peers]
        print(f"| {copies} |", " | ".join([*figures, *times]), "|", flush=True)
        rows.append({"copies": copies, "steps_per_second": median, "rounds": rounds})
    return rows


def training_speed(cores: int) -> dict[str, Any]:
    """Print how fast MADDPG trains, and how long the thesis plan takes at that speed."""
    from ethogram.studies import language
    from ethogram.studies.language.compute import update_seconds
    from ethogram.studies.language.plan import Settings, learner_of, plays

    planned = [case.parsed(Settings) for case in language.cases(language.PLANS["thesis"])]
    sweep = sum(one.trials * plays(one) * update_seconds(learner_of(one)) for one in planned)
    print("\n| game | environment steps | a run of 20 000 episodes | the thesis plan |")
    print("| --- | ---: | ---: | ---: |")
    found = {}
    for robots, symbols in TRAINED.items():
        game = f"{robots}x{robots}"
        rates = rounds_of(cores, [game], 1)[game]
        rate = statistics.median(rates)
        seconds = 20_000 * STEPS / rate
        whole = sweep / (update_seconds(learner_at(robots)) * rate / PER_UPDATE)
        print(
            f"| {game}, {symbols} symbols | {rate:,.0f} /s | {seconds:,.1f} s | "
            f"{whole / 3600:,.0f} h |",
            flush=True,
        )
        found[game] = {"steps_per_second": rates, "run_seconds": seconds, "plan_seconds": whole}
    return found


def main() -> None:
    """Measure, print a table, and keep the figures where asked."""
    chosen = options(__doc__)
    sides = [side for side in SIDES if find_spec(side)]
    for side in sorted(SIDES.keys() - sides):
        print(f"{side} is left out: it is not installed (pip install '.[bench]')", file=sys.stderr)
    figures = {
        "worlds": world_speed(chosen.cores, sides),
        "training": training_speed(chosen.cores),
    }
    if chosen.json:
        figures |= {
            "cores": chosen.cores,
            "python": sys.version.split()[0],
            "versions": {package: version(package) for package in ["jax", *sides]},
        }
        chosen.json.write_text(json.dumps(figures))


if __name__ == "__main__":
    main()
