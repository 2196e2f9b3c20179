"""One process per core, all at the same time: how a campaign uses a machine is how it is timed."""

import argparse
import multiprocessing
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from threading import Barrier
from typing import Any, NamedTuple

PATIENCE = 600.0  # seconds that a process waits for the others


class Place(NamedTuple):
    """Where a measurement runs."""

    core: int  # the only one that its process uses
    together: Barrier  # broken if a process fails

    def start(self) -> None:
        """Wait until all are ready to measure."""
        self.together.wait()


def options(description: str) -> argparse.Namespace:
    """The options `--cores` and `--json`; each process has one thread from here on."""
    from ethogram.campaign.threads import limit_threads

    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--cores", type=int, default=os.cpu_count())
    parser.add_argument("--json", type=Path)
    found = parser.parse_args()
    limit_threads()
    return found


def side_by_side(
    cores: int, measure: Callable[..., Any], *arguments: Any, quiet: bool = False
) -> list[Any]:
    """What `measure(*arguments, place)` returns in a process on each core.

    Args:
        cores: how many processes.
        measure: a function of the benchmark's module.
        arguments: the same for all.
        quiet: whether what is printed as an error goes with the rest.

    """
    context = multiprocessing.get_context("spawn")
    hushed = {"initializer": os.dup2, "initargs": (2, 1)} if quiet else {}
    with (
        context.Manager() as manager,
        ProcessPoolExecutor(cores, mp_context=context, **hushed) as pool,
    ):
        together = manager.Barrier(cores, timeout=PATIENCE)
        jobs = [
            pool.submit(_pinned, core, measure, *arguments, Place(core, together))
            for core in range(cores)
        ]
        return [job.result() for job in jobs]


def alone(measure: Callable[..., Any], *arguments: Any) -> Any:
    """What `measure(*arguments)` returns in a process of its own, on one core."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(_pinned, 0, measure, *arguments).result()


def _pinned(core: int, measure: Callable[..., Any], *arguments: Any) -> Any:
    os.sched_setaffinity(0, {core})
    return measure(*arguments)
