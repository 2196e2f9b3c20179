"""Sides that take turns: what a machine does meanwhile is the same for all.

Seconds are those of the processor: the clock's, since no process ever waits, unless other programs
run.
"""

import statistics
import time
from collections.abc import Callable

from common.processes import Place

Run = Callable[[], int]  # does a chunk of work and says how much it was


def in_turn(
    runs: dict[str, Run], place: Place, rounds: int, seconds: float
) -> list[dict[str, float]]:
    """Work per second of each side in this process, round by round.

    Args:
        runs: the sides, each of which first runs once, to compile.
        place: where this is; all processes have the same side's turn at the same time.
        rounds: how many turns a side has.
        seconds: of the processor, of a turn, at least.

    """
    for run in runs.values():
        run()
    found = []
    for _ in range(rounds):
        rates = {}
        for side, run in runs.items():
            place.start()
            began, done = time.process_time(), 0
            while (spent := time.process_time() - began) < seconds:
                done += run()
            rates[side] = done / spent
        found.append(rates)
    return found


def summed(found: list[list[dict[str, float]]]) -> dict[str, list[float]]:
    """Per side: the sum over all processes in each round."""
    return {
        side: [sum(rates[side] for rates in same) for same in zip(*found, strict=True)]
        for side in found[0][0]
    }


def in_words(rates: list[float], unit: float, decimals: int = 1) -> str:
    """The median of all rounds and their range, in units."""
    median, low, high = (
        f"{rate / unit:,.{decimals}f}"
        for rate in (statistics.median(rates), min(rates), max(rates))
    )
    return f"{median} ({low} to {high})"
