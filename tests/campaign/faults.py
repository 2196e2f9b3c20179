"""Faults at a chosen step of writing: a kill, a torn file, a full disk.

A step is a call that changes what is on the disk.  Steps are counted in a file, across all
processes of a run, so that a test can first count those of an undisturbed run and then strike at
any of them.
"""

import errno
import os
import signal
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

STEPS = ("fsync", "link", "rename", "replace", "unlink")
Kind = Literal["none", "kill", "torn", "fail", "full"]


def install(counter: Path, *, at: int = 0, kind: Kind = "none", group: bool = False) -> None:
    """Count the steps of this process and strike when the count reaches `at`.

    Args:
        counter: file in which the steps of all processes are counted, one byte each.
        at: number of the step instead of which something happens, from 1.
        kind: kill this process; the same after cutting the file that was being written in half;
            let this one step fail; or let this and every later synchronisation find the disk full.
        group: kill the whole process group.

    """
    for name in STEPS:
        setattr(os, name, _counted(getattr(os, name), name, counter, at, kind, group))


def from_environment() -> None:
    """Install what `FAULT_COUNTER`, `FAULT_AT` and `FAULT_KIND` ask for, if anything."""
    if "FAULT_COUNTER" in os.environ:
        install(
            Path(os.environ["FAULT_COUNTER"]),
            at=int(os.environ.get("FAULT_AT", "0")),
            kind=os.environ.get("FAULT_KIND", "none"),  # type: ignore[arg-type]
            group=True,
        )


def count(counter: Path) -> int:
    """How many steps were taken."""
    return counter.stat().st_size


def _counted(
    call: Callable[..., Any], name: str, counter: Path, at: int, kind: Kind, group: bool
) -> Callable[..., Any]:
    def step(*arguments: Any, **keywords: Any) -> Any:
        number = _next(counter)
        if kind == "full" and number >= at and name == "fsync":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        if kind == "fail" and number == at:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        if kind in ("kill", "torn") and number == at:
            if kind == "torn" and name == "fsync":
                _tear(arguments[0])
            _kill(group)
        return call(*arguments, **keywords)

    return step


def _next(counter: Path) -> int:
    descriptor = os.open(counter, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    try:
        os.write(descriptor, b".")
        return os.lseek(descriptor, 0, os.SEEK_CUR)
    finally:
        os.close(descriptor)


def _tear(descriptor: int) -> None:
    status = os.fstat(descriptor)
    if stat.S_ISREG(status.st_mode):
        os.ftruncate(descriptor, status.st_size // 2)


def _kill(group: bool) -> None:
    if group:
        os.killpg(os.getpgid(0), signal.SIGKILL)
    os.kill(os.getpid(), signal.SIGKILL)
    signal.pause()  # never to be woken
