"""Where cases are computed: one after another in this process, or side by side in several."""

import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence

from ethogram.campaign import interrupts
from ethogram.campaign.case import Case
from ethogram.campaign.files import StorageError
from ethogram.campaign.run import Job, Receipt, give_up, run_case
from ethogram.campaign.threads import one_thread
from ethogram.campaign.workers import (
    Loss,
    Message,
    Progress,
    Ready,
    Refusal,
    Worker,
    with_messages,
)
from ethogram.core.errors import EthogramError, UnknownName

ATTEMPTS = 3  # at a case whose worker is killed each time, and at starting workers
_STARTING = "starting"  # counts the workers that were lost before they had a case


Report = Callable[[Case, float], None]  # takes the fraction of a case that is done
Engine = Callable[[Job, Sequence[Case], int, Report], Iterator[Receipt]]  # int: workers


def inline(job: Job, cases: Sequence[Case], workers: int, report: Report) -> Iterator[Receipt]:
    """Compute the cases one after another in this process."""
    del workers
    with one_thread():
        for case in cases:

            def report_case(fraction: float, case: Case = case) -> None:
                report(case, fraction)

            with interrupts.case_in_hand():
                receipt = run_case(job, case, report=report_case)
            yield receipt


def pool(job: Job, cases: Sequence[Case], workers: int, report: Report) -> Iterator[Receipt]:
    """Compute the cases in several processes; the case of one that is killed is run again."""
    crew = _Crew(job, cases, report)
    try:
        with one_thread():
            yield from crew.receipts(workers)
    except (KeyboardInterrupt, GeneratorExit):
        crew.dismiss()
        raise
    finally:
        crew.stop()


ENGINES: dict[str, Engine] = {"inline": inline, "pool": pool}


def engine_named(name: str) -> Engine:
    """The engine of that name, or `UnknownName` with the nearest."""
    if name not in ENGINES:
        raise UnknownName("engine", name, ENGINES)
    return ENGINES[name]


class _Crew:
    """The workers of a run, and the cases that wait for one."""

    def __init__(self, job: Job, cases: Sequence[Case], report: Report) -> None:
        self._job = job
        self._report = report
        self._waiting = deque(cases)
        self._losses = Counter[str]()
        self._workers: list[Worker] = []

    def receipts(self, workers: int) -> Iterator[Receipt]:
        """Compute all cases with so many workers."""
        for _ in range(min(workers, len(self._waiting))):
            self._hire()
        while self._workers:
            for worker in with_messages(self._workers):
                yield from self._answer(worker, worker.receive())

    def dismiss(self) -> None:
        """Let workers come to a checkpoint, for a moment, and end."""
        for worker in self._workers:
            worker.dismiss()
        end = time.monotonic() + interrupts.GRACE_SECONDS
        for worker in self._workers:
            worker.wait(max(0.0, end - time.monotonic()))

    def stop(self) -> None:
        """End all workers at once."""
        for worker in self._workers:
            worker.stop()

    def _answer(self, worker: Worker, message: Message) -> Iterator[Receipt]:
        match message:
            case Ready():
                self._employ(worker)
            case Progress(case, fraction):
                self._report(case, fraction)
            case Receipt():
                self._employ(worker)
                yield message
            case Refusal(reason):
                raise (StorageError if worker.case else EthogramError)(reason)
            case Loss(cause):
                yield from self._replace(worker, cause)

    def _hire(self) -> None:
        self._workers.append(Worker(self._job))

    def _employ(self, worker: Worker) -> None:
        if self._waiting:
            worker.give(self._waiting.popleft())
        else:
            worker.stop()
            self._workers.remove(worker)

    def _replace(self, worker: Worker, cause: str) -> Iterator[Receipt]:
        """Run the case of a worker that was killed again, unless it has cost too many by now."""
        self._workers.remove(worker)
        case = worker.case
        lost = case.id if case else _STARTING
        self._losses[lost] += 1
        if case is None:
            if self._losses[lost] >= ATTEMPTS:
                raise EthogramError(f"Worker processes cannot start; the last had {cause}.")
        else:
            self._report(case, 0.0)
            if self._losses[lost] < ATTEMPTS:
                self._waiting.append(case)
            else:
                reason = f"Its worker process ended {ATTEMPTS} times, last with {cause}"
                yield give_up(self._job.store, case, reason)
        if self._waiting:
            self._hire()
