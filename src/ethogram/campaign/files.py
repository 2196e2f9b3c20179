"""Files that are whole or absent, whatever happens to the process that writes them.

A file is written under a temporary name in the folder it belongs to, synchronised to the disk and
only then given its name.  The temporary name begins with the name of the lock that its writer
holds, so that a later run can tell what a killed writer left behind from work in hand.
"""

import fcntl
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import uuid4

from ethogram.core.errors import EthogramError

_TEMPORARY = re.compile(r"(?P<owner>\w+)\.[0-9a-f]{32}\.tmp")


class StorageError(EthogramError):
    """The file system refused: full, read-only, gone.  What is stored already is not touched."""


@contextmanager
def storing(path: Path) -> Iterator[None]:
    """Turn what the operating system refuses into one clear message."""
    try:
        yield
    except OSError as error:
        raise StorageError(f"Cannot store {path}: {error.strerror or error}.") from error


def write_whole(path: Path, data: bytes, *, owner: str) -> None:
    """Write a file, replacing the one of that name, if any, in a single step."""
    with _temporary(path, data, owner) as temporary:
        temporary.replace(path)


def write_once(path: Path, data: bytes, *, owner: str) -> None:
    """Write a file unless there is one of that name: the first writer wins."""
    with _temporary(path, data, owner) as temporary, suppress(FileExistsError):
        path.hardlink_to(temporary)


def read(path: Path) -> bytes | None:
    """The bytes of a file, or None where there is no such file."""
    try:
        return path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise StorageError(f"Cannot read {path}: {error.strerror or error}.") from error


def remove(path: Path) -> None:
    """Remove a file, if it is there."""
    with storing(path):
        path.unlink(missing_ok=True)


def temporaries(folder: Path) -> Iterator[tuple[str, Path]]:
    """What writers left behind in a folder or are writing now, each with its owner's lock."""
    for path in sorted(folder.glob("*.tmp")):
        match = _TEMPORARY.fullmatch(path.name)
        if match:
            yield match["owner"], path


@contextmanager
def locked(path: Path, *, wait: bool) -> Iterator[bool]:
    """Hold an exclusive lock; gives False at once where another process has it and we do not wait.

    The operating system lets go of it when the process ends, in whatever way.  The lock's file
    stays, since a process might be waiting for that very file.
    """
    with storing(path):
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        yield _lock(descriptor, path, wait=wait)
    finally:
        os.close(descriptor)


def require_folder(path: Path) -> None:
    """Refuse a path at which, or on the way to which, a file stands."""
    for above in (path, *path.parents):
        if above.is_file():
            raise StorageError(f"{str(above)!r} is a file, not a folder.")


def make_folders(root: Path, names: tuple[str, ...]) -> None:
    """Make a folder and those in it, for good."""
    with storing(root):
        for name in names:
            (root / name).mkdir(parents=True, exist_ok=True)
        _synchronise(root)
        _synchronise(root.parent)


@contextmanager
def _temporary(path: Path, data: bytes, owner: str) -> Iterator[Path]:
    """A complete file on the disk beside `path`, to be put in place by the caller."""
    temporary = path.with_name(f"{owner}.{uuid4().hex}.tmp")
    with storing(path):
        try:
            with temporary.open("xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            yield temporary
            _synchronise(path.parent)
        finally:
            temporary.unlink(missing_ok=True)


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
