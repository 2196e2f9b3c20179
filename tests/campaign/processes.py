"""Runs of the toy in this process and in others that may be killed.

Children are forked from a server that has imported everything and started no thread, so that one
costs milliseconds.
"""

import multiprocessing
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.campaign import faults, toy

from ethogram.campaign import context
from ethogram.campaign.engines import inline
from ethogram.campaign.launch import Summary, launch
from ethogram.core.errors import EthogramError

PATIENCE = 60.0  # seconds after which something that must happen has not
REFUSED, SOME_FAILED = 2, 10  # exit codes of `toy_in_child`

_server = multiprocessing.get_context("forkserver")
_server.set_forkserver_preload(["pytest", __name__])


class Recorder:
    """A monitor that remembers what it was told."""

    def __init__(self) -> None:
        self.to_do: list[str] = []
        self.receipts: dict[str, Any] = {}
        self.fractions: list[float] = []
        self.notes: list[str] = []

    def begin(self, study: Any, planned: int, to_do: Sequence[Any], workers: int) -> None:
        del study, planned, workers
        self.to_do = [prospect.case.name for prospect in to_do]

    def advance(self, case: Any, fraction: float) -> None:
        del case
        self.fractions.append(fraction)

    def finish(self, case: Any, receipt: Any) -> None:
        self.receipts[case.name] = receipt

    def note(self, text: str) -> None:
        self.notes.append(text)


class ToyObject:
    """The toy as an object, which is no module."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(toy, name)


def run_toy(folder: Path, *changes: str, plan: str = "smoke", **options: Any) -> Summary:
    """Run the toy in this process."""
    options = {"engine": inline, "monitor": Recorder(), **options}
    return launch(toy, toy.PLANS[plan].override(changes), folder, **options)


def start_child(target: Callable[..., None], *arguments: Any) -> Any:
    """Start a function in a process of its own."""
    process = _server.Process(target=target, args=arguments, daemon=True)
    process.start()
    return process


def toy_in_child(folder: Path, environment: Mapping[str, str], fault: Mapping[str, Any]) -> None:
    """Run the toy with a fault and a checkpoint after each chunk; its exit code says the rest."""
    os.environ.update(environment)
    context.CHECKPOINT_SECONDS = 0.0
    faults.install(**fault)
    try:
        summary = run_toy(folder)
    except EthogramError:
        sys.exit(REFUSED)
    sys.exit(SOME_FAILED if summary.failures else 0)


def toy_with_small_files_only(folder: Path, *changes: str) -> None:
    """Run the toy where no file may have more than 8 kB; leaves the message."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (8000, 8000))
    try:
        run_toy(folder, *changes)
    except EthogramError as error:
        (folder / "message").write_text(str(error))
        sys.exit(REFUSED)


def ended(process: Any) -> int:
    """The exit code of a child; negative for the signal that killed it."""
    process.join(PATIENCE)
    assert process.exitcode is not None
    return int(process.exitcode)


def start_command(*arguments: str | Path, **environment: str) -> subprocess.Popen[str]:
    """Start the command line in a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "tests.campaign.command", *arguments],
        cwd=Path(__file__).parents[2],
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def until(condition: Callable[[], bool]) -> None:
    """Wait for something that must happen soon."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.01)
