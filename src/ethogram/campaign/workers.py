"""A process that computes cases for the one that started it, and dies with it.

Each worker has a pipe of its own and shares nothing else with the others, no queue and no lock.
So one that is killed at any moment takes nothing with it but the case in hand, which the common
process pools do not promise; and stopping is killing, which the store is made for.  A worker is a
program (`ethogram.campaign.worker`) and imports the study by its name, never the module that its
parent's program began with.
"""

import importlib
import logging
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import Pipe, connection
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from types import ModuleType
from typing import NoReturn

from ethogram.campaign import interrupts
from ethogram.campaign.case import Case
from ethogram.campaign.provenance import module_of
from ethogram.campaign.run import Job, Receipt, run_case
from ethogram.core.errors import EthogramError

_PROGRAM = "ethogram.campaign.worker"
_STOP = b""  # the message after which a worker ends at its next checkpoint
_PARENT_SECONDS = 1.0  # between two looks at whether the parent lives
_UNHEARD = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}


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
        luggage = _packed(job)
        self.pipe, theirs = Pipe()
        descriptor = theirs.fileno()
        with _signals_held_back():
            self._process = subprocess.Popen(
                # -P: no module of the current folder stands in for one of ours
                [sys.executable, "-P", "-m", _PROGRAM, str(descriptor), str(os.getpid())],
                env={**os.environ, "PYTHONPATH": _search_path()},
                stdin=subprocess.DEVNULL,  # which may be our own program
                pass_fds=[descriptor],
            )
        theirs.close()
        self._send(luggage)

    def give(self, case: Case) -> None:
        """Hand over a case.  If the worker is gone by now, the next message says so."""
        self.case = case
        self._send(pickle.dumps(case))

    def receive(self) -> Message:
        """The next message; waits for it."""
        try:
            message: Message = self.pipe.recv()
        except (EOFError, OSError):
            return Loss(_cause(self._process.wait()))
        return message

    def dismiss(self) -> None:
        """Ask for an end at the next checkpoint."""
        self._send(_STOP)

    def wait(self, seconds: float) -> None:
        """Wait for the end of the process, but no longer than this."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(seconds)

    def stop(self) -> None:
        """End the process at once.  Whatever it is doing, the store can stand it."""
        self._process.kill()
        self._process.wait()
        self.pipe.close()

    def _send(self, data: bytes) -> None:
        with suppress(OSError):
            self.pipe.send_bytes(data)


def with_messages(crew: Sequence[Worker]) -> list[Worker]:
    """The workers of a crew that have something to say; waits until one has."""
    pipes = connection.wait([worker.pipe for worker in crew])
    return [worker for worker in crew if worker.pipe in pipes]


def serve(descriptor: int, *, parent: int) -> NoReturn:
    """Compute cases as they come; what a worker's process does, until it is killed."""
    logging.lastResort = logging.NullHandler()  # nobody reads what libraries log
    pipe = Connection(descriptor)
    orders: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(pipe, orders, parent), daemon=True).start()
    job = _unpacked(pipe, orders.get())
    _say(pipe, Ready())
    while True:
        case = pickle.loads(orders.get())
        with interrupts.case_in_hand(), suppress(KeyboardInterrupt):
            _say(pipe, _reply(pipe, job, case))
        if interrupts.stop_wanted():
            os._exit(0)


def _listen(pipe: Connection, orders: SimpleQueue[bytes], parent: int) -> NoReturn:
    """Take orders, and end this process as soon as its parent has ended, however it did."""
    while True:
        try:
            # A pipe that a third process has inherited stays open without the parent.
            while not pipe.poll(_PARENT_SECONDS):
                if os.getppid() != parent:
                    os._exit(1)
            order = pipe.recv_bytes()
        except (EOFError, OSError):
            os._exit(1)
        if order != _STOP:
            orders.put(order)
        elif not interrupts.want_stop():
            os._exit(0)


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


def _packed(job: Job) -> bytes:
    """What is common to all cases, as it travels; a study goes by the name of its module."""
    study = job.study
    module = module_of(study)
    if module == "__main__":
        raise EthogramError(
            f"The study {study.NAME!r} is defined in the program itself, which worker processes do "
            "not import. Put it into a module of its own, or use the engine 'inline'."
        )
    reference = module if isinstance(study, ModuleType) else study
    try:
        return pickle.dumps((reference, job.store, job.wait, job.retry_failed, job.force))
    except Exception as error:  # of any type: an object says itself what it cannot do
        raise EthogramError(
            f"The study {study.NAME!r} cannot travel to a worker process: {error}. Make it a "
            "module, or use the engine 'inline'."
        ) from error


def _unpacked(pipe: Connection, luggage: bytes) -> Job:
    try:
        reference, *rest = pickle.loads(luggage)
        study = importlib.import_module(reference) if isinstance(reference, str) else reference
    except Exception as error:
        _say(pipe, Refusal(f"A worker process cannot load the study: {error!r}."))
        raise
    return Job(study, *rest)


def _search_path() -> str:
    """Where this process finds its modules; an empty entry stands for the current folder."""
    return os.pathsep.join(str(entry or Path.cwd()) for entry in sys.path)


@contextmanager
def _signals_held_back() -> Iterator[None]:
    """Start a process that never sees Ctrl-C or what a batch system sends to all processes at once.

    A new process inherits the signals that are blocked in the thread that starts it.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _UNHEARD)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _cause(exit_code: int) -> str:
    if exit_code >= 0:
        return f"exit code {exit_code}"
    hint = ": out of memory?" if exit_code == -signal.SIGKILL else ""
    return f"signal {-exit_code}{hint}"
