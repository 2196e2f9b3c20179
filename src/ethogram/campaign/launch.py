"""Run a plan of a study on a folder: find what is missing, have it computed, say how it went."""

import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from ethogram.campaign.case import Case, Cost
from ethogram.campaign.engines import Engine, inline
from ethogram.campaign.files import StorageError, require_folder
from ethogram.campaign.manifests import PlannedRun
from ethogram.campaign.plan import Plan
from ethogram.campaign.provenance import now, package_of
from ethogram.campaign.run import Job, Receipt, shortfall
from ethogram.campaign.settings_json import to_json
from ethogram.campaign.store import State, Store
from ethogram.campaign.study import Study, blamed
from ethogram.core.errors import EthogramError, InvalidSettings
from ethogram.core.memory import available_cores, available_memory

_INTACT = (
    "Everything stored before is intact; once there is room and permission, the same command "
    "continues from there."
)


@dataclass(frozen=True)
class Prospect:
    """A case of a plan before the run: what there is of it and what it would take."""

    case: Case
    state: State
    cost: Cost

    def is_to_do(self, *, retry_failed: bool = False, force: bool = False) -> bool:
        """Whether a run would compute it.  A failure stays one until it is to be retried."""
        wanted = ("missing", "damaged", *(["failed"] if retry_failed else []))
        return force or self.state in wanted


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
    """The cases of a plan, in its order, and what there is of each in a results folder.

    Raises `InvalidSettings` where a world or a learner refuses what `Plan.override` let pass.
    """
    try:
        cases, costs = _cases(study, plan)
    except InvalidSettings as error:
        changes = " ".join(_guilty(study, plan))
        raise InvalidSettings(f"{changes}: {error}" if changes else str(error)) from error
    if len({case.name for case in cases}) < len(cases):
        raise EthogramError(f"The study {study.NAME!r} gives two cases the same name.")
    require_folder(folder)
    store = Store(folder / study.NAME)
    states = [store.state(case.id) for case in cases]
    return list(map(Prospect, cases, states, costs))


def _cases(study: Study, plan: Plan[Any]) -> tuple[list[Case], list[Cost]]:
    package = package_of(study)
    with blamed(study, "cases"):
        cases = [replace(case, package=package) for case in study.cases(plan)]
    with blamed(study, "cost"):
        return cases, [study.cost(case) for case in cases]


def _guilty(study: Study, plan: Plan[Any]) -> list[str]:
    """The overrides of a plan without which it could be run; all where none of them alone will."""
    guilty = []
    for change in plan.overrides:
        with suppress(EthogramError):
            _cases(study, plan.without(change))
            guilty.append(change)
    return guilty or list(plan.overrides)


def crew_size(engine: Engine, to_do: Sequence[Prospect], workers: int | None = None) -> int:
    """How many cases are computed at once: by default as many as there are cores and memory for."""
    if engine is inline:
        return 1
    if workers is not None:
        return workers
    largest = max((prospect.cost.bytes for prospect in to_do), default=0)
    fitting = available_memory() // max(largest, 1)
    return max(1, min(available_cores(), len(to_do), fitting))


def launch(
    study: Study,
    plan: Plan[Any],
    folder: Path,
    *,
    engine: Engine,
    monitor: Monitor,
    workers: int | None = None,
    retry_failed: bool = False,
    force: bool = False,
) -> Summary:
    """Compute what a results folder lacks of a plan.  Every record is in place once it is done.

    May be stopped or killed at any moment and called again, also by two processes at once.  With
    `force` every case is computed anew; a record is replaced once the new one is complete, and
    stays where its case fails now.  Raises `StorageError` where the folder cannot be written.
    """
    store = Store(folder / study.NAME)
    prospects = survey(study, plan, folder)
    to_do = [found for found in prospects if found.is_to_do(retry_failed=retry_failed, force=force)]
    crew = crew_size(engine, to_do, workers)
    job = Job(study, store, wait=False, retry_failed=retry_failed, force=force)
    try:
        store.create()
        store.save_planned_run(_planned_run(study, plan, prospects))
        notes = store.sweep()
        monitor.begin(study, len(prospects), to_do, crew)
        for note in notes:
            monitor.note(note)
        failed = _compute(engine, job, [found.case for found in to_do], crew, monitor)
    except StorageError as error:
        raise StorageError(f"{error} {_INTACT}") from error
    return _summary(store, [prospect.case for prospect in prospects], failed)


def _compute(
    engine: Engine, job: Job, cases: Sequence[Case], workers: int, monitor: Monitor
) -> dict[str, str]:
    """Have cases computed, last those that another run is computing; returns what failed, by id."""
    by_id = {case.id: case for case in cases}
    failed: dict[str, str] = {}
    busy = []
    for receipt in engine(job, cases, workers, monitor.advance):
        case = by_id[receipt.case_id]
        for note in receipt.notes:
            monitor.note(note)
        if receipt.state == "busy":
            busy.append(case)
            continue
        monitor.finish(case, receipt)
        if receipt.state == "failed":
            failed[case.id] = receipt.error
    if busy:
        monitor.note(f"Another run is computing {len(busy)} of the cases; waiting for it.")
        failed |= _compute(engine, Job(job.study, job.store, wait=True), busy, workers, monitor)
    return failed


def _planned_run(study: Study, plan: Plan[Any], prospects: Sequence[Prospect]) -> PlannedRun:
    changes = [word for override in plan.overrides for word in ("--set", override)]
    return PlannedRun(
        study=study.NAME,
        version=study.VERSION,
        plan=plan.name,
        description=plan.description,
        overrides=plan.overrides,
        settings=to_json(plan.settings),
        grid=plan.axes,
        cases=tuple((prospect.case.name, prospect.case.id) for prospect in prospects),
        command=shlex.join(["ethogram", "run", study.NAME, "--plan", plan.name, *changes]),
        started=now(),
    )


def _summary(store: Store, cases: Sequence[Case], failed: Mapping[str, str]) -> Summary:
    """How it ended; `failed` are the errors of this run, also where an older record stays."""
    lacks = {case.id: shortfall(store, case.id) for case in cases}
    errors = [(case.name, lacks[case.id] or failed.get(case.id)) for case in cases]
    return Summary(
        planned=len(cases),
        stored=sum(lack is None for lack in lacks.values()),
        failures=tuple((name, error) for name, error in errors if error is not None),
    )
