"""One case, from its lock to its record.  What happens here happens alike in every engine."""

import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ethogram.campaign.case import Case
from ethogram.campaign.context import Context
from ethogram.campaign.files import StorageError
from ethogram.campaign.provenance import module_of, now
from ethogram.campaign.sealed import Failure
from ethogram.campaign.store import Store
from ethogram.campaign.study import Study
from ethogram.core.errors import EthogramError, place_of


@dataclass(frozen=True)
class Job:
    """What the cases of a run have in common."""

    study: Study
    store: Store
    wait: bool  # for cases that another run is computing, instead of leaving them to it
    retry_failed: bool = False  # those that failed in an earlier run
    force: bool = False  # those, too, that are stored


@dataclass(frozen=True, kw_only=True)
class Receipt:
    """What became of a case; its data stays in the store."""

    case_id: str
    state: Literal["stored", "failed", "busy"]  # busy: another run is computing it
    error: str = ""  # one line
    notes: tuple[str, ...] = ()  # for the user


def run_case(job: Job, case: Case, *, report: Callable[[float], None]) -> Receipt:
    """Compute a case and store its record or its failure, unless that is there already.

    A case that another run holds is waited for or left to it.  Only `StorageError` comes out:
    a store that cannot be written ends the run, a case that fails does not.
    """
    store = job.store
    with store.lock(case.id, wait=job.wait) as held:
        if not held:
            return Receipt(case_id=case.id, state="busy")
        store.clear(case.id)
        notes = [f"{note} It is set aside." for note in store.set_aside_damaged(case.id)]
        if job.retry_failed or job.force:
            store.forget_failure(case.id)
        there = store.manifest(case.id) is not None or store.failure(case.id) is not None
        if job.force or not there:
            notes += _compute(job, case, report)
        failure = store.failure(case.id)
        if failure and store.manifest(case.id) is not None:
            store.forget_failure(case.id)  # the record of before stays, and is what there is
    return Receipt(
        case_id=case.id,
        state="failed" if failure else "stored",
        error=failure.error if failure else "",
        notes=tuple(notes),
    )


def give_up(store: Store, case: Case, reason: str) -> Receipt:
    """Record that a case failed in a way that its own process could not record."""
    with store.lock(case.id, wait=True):
        failure = Failure(case=case, error=reason, traceback=reason, started=now(), seconds=0.0)
        store.save_failure(failure)
    return Receipt(case_id=case.id, state="failed", error=reason)


def _compute(job: Job, case: Case, report: Callable[[float], None]) -> list[str]:
    """Run the study on a case and store what comes of it; returns notes for the user."""
    store = job.store
    started, clock = now(), time.monotonic()
    checkpoints = store.checkpoints(case.id)
    context = Context(report, checkpoints)
    try:
        record = job.study.run(case, context)
        seconds = time.monotonic() - clock
        store.save(case, record, started=started, seconds=seconds, replace=job.force)
        checkpoints.clear()
    except StorageError:
        raise
    except Exception as error:
        store.save_failure(
            Failure(
                case=case,
                error=_in_one_line(error, job.study, checkpoints.newest()),
                traceback=traceback.format_exc(),
                started=started,
                seconds=time.monotonic() - clock,
            )
        )
    return context.notes


def _in_one_line(error: Exception, study: Study, checkpoint: Path | None) -> str:
    message = (str(error).strip() or "no message").splitlines()[0]
    if not isinstance(error, EthogramError):
        message = f"{type(error).__name__}: {message} ({place_of(error, module_of(study))})"
    return message if checkpoint is None else f"{message} (last checkpoint: {checkpoint})"
