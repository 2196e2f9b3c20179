"""Run a plan of a study on a folder: find what is missing, have it computed, say how it went."""

import os
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from ethogram.campaign.case import Case, Cost
from ethogram.campaign.engines import Engine, inline
from ethogram.campaign.files import require_folder
from ethogram.campaign.plan import Plan
from ethogram.campaign.provenance import now
from ethogram.campaign.run import Job, Receipt, shortfall
from ethogram.campaign.sealed import PlannedRun
from ethogram.campaign.store import State, Store
from ethogram.campaign.study import Study
from ethogram.campaign.trees import to_tree
from ethogram.core.errors import EthogramError
from ethogram.core.memory import available_memory


@dataclass(frozen=True)
class Prospect:
    """A case of a plan before the run: what there is of it and what it would take."""

    case: Case
    state: State
    cost: Cost

    def is_to_do(self, *, retry_failed: bool) -> bool:
        """Whether a run would compute it.  A failure stays one until it is to be retried."""
        return self.state in ("missing", "damaged") or (self.state == "failed" and retry_failed)


@dataclass(frozen=True)
class Summary:
    """How a run ended."""

    planned: int
    stored: int
    failures: tuple[tuple[str, str], ...]  # name of a case without a record, and why in one line


class Monitor(Protocol):
    """Is told how a run goes on."""

    def begin(self, study: Study, planned: int, to_do: Sequence[Prospect], workers: int) -> None:
        """So many cases are planned, and these of them are computed now."""

    def advance(self, case: Case, fraction: float) -> None:
        """So much of a case is done."""

    def finish(self, case: Case, receipt: Receipt) -> None:
        """A case is stored, or has failed."""

    def note(self, text: str) -> None:
        """Something that a user should know."""


def survey(study: Study, plan: Plan[Any], folder: Path) -> list[Prospect]:
    """The cases of a plan, in its order, and what there is of each in a results folder."""
    cases = study.cases(plan)
    if len({case.name for case in cases}) < len(cases):
        raise EthogramError(f"The study {study.NAME!r} gives two cases the same name.")
    require_folder(folder)
    store = Store(folder / study.NAME)
    return [Prospect(case, store.state(case.id), study.cost(case)) for case in cases]


def crew_size(engine: Engine, to_do: Sequence[Prospect], workers: int | None = None) -> int:
    """How many cases are computed at once: by default as many as there are cores and memory for."""
    if engine is inline:
        return 1
    if workers is not None:
        return workers
    largest = max((prospect.cost.bytes for prospect in to_do), default=0)
    fitting = available_memory() // max(largest, 1)
    return max(1, min(_cores(), len(to_do), fitting))


def launch(
    study: Study,
    plan: Plan[Any],
    folder: Path,
    *,
    engine: Engine,
    monitor: Monitor,
    workers: int | None = None,
    retry_failed: bool = False,
) -> Summary:
    """Compute what a results folder lacks of a plan.  Every record is in place once it is done.

    May be stopped or killed at any moment and called again, also by two processes at once.
    Raises `StorageError` where the folder cannot be written.
    """
    store = Store(folder / study.NAME)
    prospects = survey(study, plan, folder)
    store.create()
    store.save_planned_run(_planned_run(study, plan, prospects))
    notes = store.sweep()
    to_do = [found for found in prospects if found.is_to_do(retry_failed=retry_failed)]
    crew = crew_size(engine, to_do, workers)
    monitor.begin(study, len(prospects), to_do, crew)
    for note in notes:
        monitor.note(note)
    cases = [prospect.case for prospect in to_do]
    job = Job(study, store, wait=False, retry_failed=retry_failed)
    busy = _compute(engine, job, cases, crew, monitor)
    if busy:
        monitor.note(f"Another run is computing {len(busy)} of the cases; waiting for it.")
        _compute(engine, Job(study, store, wait=True), busy, crew, monitor)
    return _summary(store, [prospect.case for prospect in prospects])


def _compute(
    engine: Engine, job: Job, cases: Sequence[Case], workers: int, monitor: Monitor
) -> list[Case]:
    """Have cases computed; returns those that another run was computing."""
    by_id = {case.id: case for case in cases}
    busy = []
    for receipt in engine(job, cases, workers, monitor.advance):
        case = by_id[receipt.case_id]
        for note in receipt.notes:
            monitor.note(note)
        if receipt.state == "busy":
            busy.append(case)
        else:
            monitor.finish(case, receipt)
    return busy


def _planned_run(study: Study, plan: Plan[Any], prospects: Sequence[Prospect]) -> PlannedRun:
    changes = [word for override in plan.overrides for word in ("--set", override)]
    return PlannedRun(
        study=study.NAME,
        version=study.VERSION,
        plan=plan.name,
        description=plan.description,
        overrides=plan.overrides,
        settings=to_tree(plan.settings),
        grid=plan.axes,
        cases=tuple((prospect.case.name, prospect.case.id) for prospect in prospects),
        command=shlex.join(["ethogram", "run", study.NAME, "--plan", plan.name, *changes]),
        started=now(),
    )


def _summary(store: Store, cases: Sequence[Case]) -> Summary:
    found = [(case.name, shortfall(store, case.id)) for case in cases]
    failures = tuple((name, error) for name, error in found if error is not None)
    return Summary(len(cases), len(cases) - len(failures), failures)


def _cores() -> int:
    """The cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
