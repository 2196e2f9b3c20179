"""A process that computes cases for the one that started it, and dies with it.

Each worker has a pipe of its own and shares nothing else with the others, no queue and no lock.
So one that is killed at any moment takes nothing with it but the case in hand, which the common
process pools do not promise; and stopping is killing, which the store is made for.
"""

import importlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import connection, resource_tracker
from multiprocessing.connection import Connection
from types import ModuleType

from ethogram.campaign.case import Case
from ethogram.campaign.run import Job, Receipt, run_case
from ethogram.campaign.store import Store
from ethogram.campaign.study import Study
from ethogram.core.errors import EthogramError

_SPAWN = multiprocessing.get_context("spawn")  # a fork after JAX has started would deadlock


@dataclass(frozen=True)
class Ready:
    """The worker has loaded the study and waits for its first case."""


@dataclass(frozen=True)
class Progress:
    """How much of a case is done."""

    case: Case
    fraction: float


@dataclass(frozen=True)
class Refusal:
    """What ends the whole run, such as a full disk."""

    message: str


@dataclass(frozen=True)
class Loss:
    """The worker's process has ended; `cause` says how, for a person."""

    cause: str


Message = Ready | Progress | Receipt | Refusal | Loss


class Worker:
    """The end of the pipe that is held by the process which hands out the cases."""

    def __init__(self, job: Job) -> None:
        self.case: Case | None = None  # the case in hand
        self.pipe, theirs = _SPAWN.Pipe()
        # A module cannot travel to another process, but its name can.
        study = job.study.__name__ if isinstance(job.study, ModuleType) else job.study
        self._process = _SPAWN.Process(
            target=_serve,
            args=(theirs, study, job.store, job.wait, job.retry_failed),
            daemon=True,
        )
        with _interrupts_held_back():
            self._process.start()
        theirs.close()

    def give(self, case: Case) -> None:
        """Hand over a case.  If the worker is gone by now, the next message says so."""
        self.case = case
        with suppress(OSError):
            self.pipe.send(case)

    def receive(self) -> Message:
        """The next message; waits for it."""
        try:
            message: Message = self.pipe.recv()
        except (EOFError, OSError):
            self._process.join()
            return Loss(_cause(self._process.exitcode or 0))
        return message

    def stop(self) -> None:
        """End the process at once.  Whatever it is doing, the store can stand it."""
        self._process.kill()
        self._process.join()
        self.pipe.close()


def with_messages(crew: Sequence[Worker]) -> list[Worker]:
    """The workers of a crew that have something to say; waits until one has."""
    pipes = connection.wait([worker.pipe for worker in crew])
    return [worker for worker in crew if worker.pipe in pipes]


def _serve(
    pipe: Connection, reference: Study | str, store: Store, wait: bool, retry_failed: bool
) -> None:
    """Compute cases as they come; the main function of a worker's process."""
    threading.Thread(target=_die_with_parent, daemon=True).start()
    study = importlib.import_module(reference) if isinstance(reference, str) else reference
    job = Job(study, store, wait, retry_failed)
    _say(pipe, Ready())
    while True:
        try:
            case = pipe.recv()
        except (EOFError, OSError):
            return
        _say(pipe, _reply(pipe, job, case))


def _reply(pipe: Connection, job: Job, case: Case) -> Message:
    def report(fraction: float) -> None:
        _say(pipe, Progress(case, fraction))

    try:
        return run_case(job, case, report=report)
    except EthogramError as error:
        return Refusal(str(error))


def _say(pipe: Connection, message: Message) -> None:
    """Send a message; with nobody there to hear it, this process has no more to do."""
    try:
        pipe.send(message)
    except OSError:
        os._exit(1)


def _die_with_parent() -> None:
    """End this process as soon as the one that started it has ended, however it did."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Start a process that never sees Ctrl-C; the terminal sends it to all of them at once.

    A new process inherits the signals that are blocked in the thread that starts it.  The process
    that tracks resources is started first, since starting it unblocks them.
    """
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _cause(exit_code: int) -> str:
    if exit_code >= 0:
        return f"exit code {exit_code}"
    hint = ": out of memory?" if exit_code == -signal.SIGKILL else ""
    return f"signal {-exit_code}{hint}"
