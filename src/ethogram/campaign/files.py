"""Files that are whole or absent, whatever happens to the process that writes them.

A file is written under a temporary name in the folder it belongs to, synchronised to the disk and
only then given its name.  Its writer holds a lock on the temporary file, so that whoever writes
next into the folder can tell what a killed writer left behind from work in hand.

Nothing here follows a link, waits for a pipe, or takes a refusal of the operating system for an
empty folder or an absent file.
"""

import errno
import fcntl
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO
from uuid import uuid4

from ethogram.core.errors import EthogramError, shown

LARGEST = 2**31 - 1  # bytes of a file, written or read

# 64 digits before the dot: the temporary files of earlier versions
_TEMPORARY = re.compile(r"(?:ethogram|[0-9a-f]{64})\.[0-9a-f]{32}\.tmp")
# what is wrong with this process or machine for now, and not with the file
_PASSING = {errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EINTR, errno.EAGAIN, errno.ETIMEDOUT}


class StorageError(EthogramError):
    """The file system refused: full, read-only, gone.  What is stored already is not touched."""


class Unreadable(StorageError):
    """Something stands where a file should be, and cannot be read as one."""

    def __init__(self, path: Path, reason: str) -> None:
        self.reason = reason
        super().__init__(f"{path} cannot be used: {reason}.")


@contextmanager
def storing(path: Path) -> Iterator[None]:
    """Turn what the operating system refuses into one clear message."""
    try:
        yield
    except OSError as error:
        raise StorageError(f"Cannot store {path}: {error.strerror or error}.") from error


# -- reading --------------------------------------------------------------------------------------


def names_in(folder: Path) -> list[str]:
    """The names in a folder, in order; none where there is no such folder.

    Raises:
        StorageError: it cannot be listed, or is no folder.

    """
    try:
        with os.scandir(folder) as entries:
            return sorted(entry.name for entry in entries)
    except FileNotFoundError:
        return []
    except OSError as error:
        raise StorageError(f"Cannot list {folder}: {error.strerror or error}.") from error


def refuse_link(path: Path) -> None:
    """Refuse a link in a folder of results: it might lead out of it."""
    status = _status(path)
    if status is not None and stat.S_ISLNK(status.st_mode):
        raise StorageError(f"{path} is a link; none is followed in a folder of results.")


def is_there(path: Path) -> bool:
    """Whether anything has that name, a link that leads nowhere included."""
    return _status(path) is not None


def is_file(path: Path) -> bool:
    """Whether a regular file has that name; a link is none."""
    status = _status(path)
    return status is not None and stat.S_ISREG(status.st_mode)


def is_folder(path: Path) -> bool:
    """Whether a folder has that name, also through a link; an error where we may not look."""
    try:
        return stat.S_ISDIR(path.stat().st_mode)
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError as error:
        if error.errno == errno.ELOOP:
            return False
        raise StorageError(f"Cannot read {path}: {error.strerror or error}.") from error


def changed(path: Path) -> int:
    """When a file was last written (ns); 0 where there is none."""
    status = _status(path)
    return 0 if status is None else status.st_mtime_ns


def read(path: Path, *, most: int = LARGEST, first: int | None = None) -> bytes | None:
    """The bytes of a file, or the first so many, or None where there is no such file.

    Raises:
        Unreadable: what has that name is no file, cannot be read, or has more than `most` bytes.
        StorageError: its folder does not let us look, or this process cannot open any file.

    """
    if _status(path) is None:
        return None
    try:
        with _opened(path, most) as file:
            return file.read(-1 if first is None else first)
    except FileNotFoundError:  # it went away between the two looks
        return None
    except OSError as error:
        reason = error.strerror or str(error)
        if error.errno in _PASSING:
            raise StorageError(f"Cannot read {path}: {reason}.") from error
        reason = "it is a link" if error.errno == errno.ELOOP else f"it cannot be read ({reason})"
        raise Unreadable(path, reason) from error


@contextmanager
def _opened(path: Path, most: int) -> Iterator[BinaryIO]:
    """A file for reading; neither a link is followed nor a pipe waited for."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(descriptor, "rb") as file:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise Unreadable(path, "it is no file")
        if status.st_size > most:
            raise Unreadable(path, f"it has {status.st_size} bytes, {most} are allowed")
        yield file


def _status(path: Path) -> os.stat_result | None:
    """What has that name, links not followed; None where nothing has."""
    try:
        return os.lstat(path)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise StorageError(f"Cannot read {path}: {error.strerror or error}.") from error


# -- writing --------------------------------------------------------------------------------------


def write_whole(path: Path, data: bytes) -> None:
    """Write a file, replacing the one of that name, if any, in a single step."""
    with _temporary(path, data) as temporary:
        temporary.replace(path)


def write_once(path: Path, data: bytes) -> None:
    """Write a file unless there is one of that name: the first writer wins."""
    with _temporary(path, data) as temporary, suppress(FileExistsError):
        path.hardlink_to(temporary)


def remove(path: Path) -> None:
    """Remove a file, if it is there."""
    with storing(path):
        path.unlink(missing_ok=True)


def sweep(folder: Path) -> None:
    """Remove the temporary files of writers that are no more."""
    for name in names_in(folder):
        if _TEMPORARY.fullmatch(name):
            with storing(folder / name):
                _remove_abandoned(folder / name)


@contextmanager
def locked(path: Path, *, wait: bool) -> Iterator[bool]:
    """Hold an exclusive lock; gives False at once where another process has it and we do not wait.

    The operating system lets go of it when the process ends, in whatever way.  The lock's file
    stays, since a process might be waiting for that very file.
    """
    with storing(path):
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
    try:
        yield _lock(descriptor, path, wait=wait)
    finally:
        os.close(descriptor)


def require_folder(path: Path) -> None:
    """Refuse a path at which, or on the way to which, a file stands, and one that cannot be."""
    for above in (path, *path.parents):
        try:
            in_the_way = above.is_file()
        except OSError as error:
            reason = error.strerror or error
            raise StorageError(f"Cannot use {shown(str(path))}: {reason}.") from error
        if in_the_way:
            raise StorageError(f"{str(above)!r} is a file, not a folder.")


def make_folders(root: Path, names: tuple[str, ...]) -> None:
    """Make a folder and those in it, for good."""
    refuse_link(root)
    with storing(root):
        for name in names:
            refuse_link(root / name)
            (root / name).mkdir(parents=True, exist_ok=True)
        _synchronise(root)
        _synchronise(root.parent)


@contextmanager
def _temporary(path: Path, data: bytes) -> Iterator[Path]:
    """A complete file on the disk beside `path`, to be put in place by the caller."""
    sweep(path.parent)
    with storing(path):
        temporary, descriptor = _begun(path.parent)
        with os.fdopen(descriptor, "wb") as file:  # its lock is ours until it is closed, at the end
            try:
                file.write(data)
                file.flush()
                os.fsync(descriptor)
                yield temporary
                _synchronise(path.parent)
            finally:
                temporary.unlink(missing_ok=True)


def _begun(folder: Path) -> tuple[Path, int]:
    """An empty temporary file, locked: whoever finds the lock free may remove the file."""
    while True:
        temporary = folder / f"ethogram.{uuid4().hex}.tmp"
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        with suppress(OSError):  # no locks here: then nobody can take the file for abandoned
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        if is_there(temporary):
            return temporary, descriptor
        os.close(descriptor)  # swept away before it was locked


def _remove_abandoned(path: Path) -> None:
    """Remove a temporary file unless its writer holds it."""
    if not is_file(path):
        return
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except (FileNotFoundError, PermissionError):  # put in place by now, or another user's
        return
    try:
        with suppress(OSError):  # held, or there are no locks here
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            path.unlink(missing_ok=True)
    finally:
        os.close(descriptor)


def _lock(descriptor: int, path: Path, *, wait: bool) -> bool:
    with storing(path):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            return False
    return True


def _synchronise(folder: Path) -> None:
    """Make the names in a folder survive a loss of power."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
