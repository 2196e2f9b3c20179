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
from ethogram.campaign.manifests import Failure, OtherFormat, Unusable
from ethogram.campaign.provenance import module_of, now
from ethogram.campaign.store import Store
from ethogram.campaign.study import Study
from ethogram.campaign.untrusted import printable
from ethogram.core.errors import EthogramError, place_of

_LONGEST = 100_000  # characters of an error or traceback that are kept


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

    A case that another run holds is waited for or left to it.  What became of it is read back from
    the disk.  Only `StorageError` comes out: a store that cannot be written ends the run, a case
    that fails does not.
    """
    store = job.store
    with store.lock(case.id, wait=job.wait) as held:
        if not held:
            return Receipt(case_id=case.id, state="busy")
        try:
            notes = _worked_on(job, case, report)
        except OtherFormat as error:
            return Receipt(case_id=case.id, state="failed", error=str(error))
        lack = shortfall(store, case.id) or _setback(store, case.id)
    state: Literal["stored", "failed"] = "stored" if lack is None else "failed"
    return Receipt(case_id=case.id, state=state, error=lack or "", notes=tuple(notes))


def shortfall(store: Store, case_id: str) -> str | None:
    """Why a case has no record, in one line; None where its manifest can be read."""
    try:
        if store.manifest(case_id) is not None:
            return None
        failure = store.failure(case_id)
    except Unusable as error:
        return str(error)
    if failure is None:
        return "Its record is gone from the disk, and there is none of a failure: run it again."
    return failure.error


def _setback(store: Store, case_id: str) -> str | None:
    """Why a case was not computed anew whose record of before stays, and is what there is."""
    failure = store.failure(case_id)
    if failure is None:
        return None
    store.forget_failure(case_id)
    return failure.error


def give_up(store: Store, case: Case, reason: str) -> Receipt:
    """Record that a case failed in a way that its own process could not record."""
    with store.lock(case.id, wait=True):
        failure = Failure(case=case, error=reason, traceback=reason, started=now(), seconds=0.0)
        store.save_failure(failure)
    return Receipt(case_id=case.id, state="failed", error=reason)


def _worked_on(job: Job, case: Case, report: Callable[[float], None]) -> list[str]:
    """Leave a record or a failure of a case whose lock we hold; returns notes for the user."""
    store = job.store
    store.clear(case.id)
    notes = store.set_aside_damaged(case.id)
    if job.retry_failed or job.force:
        store.forget_failure(case.id)
    there = store.manifest(case.id) is not None or store.failure(case.id) is not None
    if job.force or not there:
        notes += _compute(job, case, report)
    return notes


def _compute(job: Job, case: Case, report: Callable[[float], None]) -> list[str]:
    """Run the study on a case and store what comes of it; returns notes for the user."""
    store = job.store
    started, clock = now(), time.monotonic()
    checkpoints = store.checkpoints(case.id)
    context = Context(report, checkpoints)
    try:
        record = job.study.run(case, context)
        seconds = time.monotonic() - clock
        store.save(
            case,
            record,
            started=started,
            seconds=seconds,
            kernels=context.kernels,
            replace=job.force,
        )
        checkpoints.clear()
    except StorageError:
        raise
    except Exception as error:
        store.save_failure(
            Failure(
                case=case,
                error=_in_one_line(error, job.study, checkpoints.newest()),
                traceback=_in_unicode(traceback.format_exc())[-_LONGEST:],
                started=started,
                seconds=time.monotonic() - clock,
            )
        )
    return context.notes


def _in_one_line(error: Exception, study: Study, checkpoint: Path | None) -> str:
    message = (str(error).strip() or "no message").splitlines()[0]
    if not isinstance(error, EthogramError):
        message = f"{type(error).__name__}: {message} ({place_of(error, module_of(study))})"
    if checkpoint is not None:
        message = f"{message} (last checkpoint: {checkpoint})"
    return printable(message[:_LONGEST])


def _in_unicode(text: str) -> str:
    """A text with what is half a character, as in names of files, written out."""
    return text.encode(errors="backslashreplace").decode()
