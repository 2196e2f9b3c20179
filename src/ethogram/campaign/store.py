"""The records of one study: each whole or absent, whatever happens while it is written.

A record is an array file named by the hash of its bytes, and a manifest named by its case.  The
manifest is put in place last and is the only commit point.  `docs/store.md` lists the promises.
"""

from collections.abc import Iterator
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Literal, TypeVar
from uuid import uuid4

from ethogram.campaign import arrays, files
from ethogram.campaign.arrays import Record
from ethogram.campaign.case import Case
from ethogram.campaign.checkpoints import Checkpoints
from ethogram.campaign.sealed import (
    Damaged,
    Failure,
    Manifest,
    PlannedRun,
    seal,
    sha256,
    unseal,
)

State = Literal["stored", "failed", "missing", "damaged"]
T = TypeVar("T")

PLAN = "plan.json"
_FOLDERS = ("arrays", "manifests", "failures", "checkpoints", "locks", "damaged")


class Store:
    """The folder of one study.  Reading never changes it; writing a case needs its lock."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def create(self) -> None:
        """Make the folders, where they are not there yet."""
        files.make_folders(self.folder, _FOLDERS)

    # -- reading ------------------------------------------------------------------------------

    def state(self, case_id: str) -> State:
        """What there is of a case, every byte of it verified."""
        try:
            if self.verified(case_id) is not None:
                return "stored"
            return "missing" if self.failure(case_id) is None else "failed"
        except Damaged:
            return "damaged"

    def verified(self, case_id: str) -> Manifest | None:
        """The manifest of a whole record, None where there is none, else `Damaged`."""
        manifest = self.manifest(case_id)
        if manifest is not None:
            self._read_arrays(manifest)
        return manifest

    def manifest(self, case_id: str) -> Manifest | None:
        """The description of a record; its arrays are not looked at."""
        path = self._manifest_path(case_id)
        manifest = self._read(Manifest, path)
        if manifest is not None and manifest.case.id != case_id:
            raise Damaged(path, "it describes another case")
        return manifest

    def load(self, case_id: str) -> tuple[Record, Manifest] | None:
        """A record with its description, or None where there is none."""
        manifest = self.manifest(case_id)
        if manifest is None:
            return None
        return arrays.unpack(self._read_arrays(manifest), manifest.layout), manifest

    def failure(self, case_id: str) -> Failure | None:
        """The failure record of a case, or None where there is none."""
        return self._read(Failure, self._failure_path(case_id))

    def planned_run(self) -> PlannedRun | None:
        """What was asked for last, or None in an empty folder."""
        return self._read(PlannedRun, self.folder / PLAN)

    def case_ids(self) -> list[str]:
        """The cases that have a record, of this plan or any other."""
        return sorted(path.stem for path in (self.folder / "manifests").glob("*.json"))

    # -- writing ------------------------------------------------------------------------------

    def lock(self, owner: str, *, wait: bool) -> AbstractContextManager[bool]:
        """Hold the lock of a case; False at once when another process has it, unless waiting."""
        return files.locked(self.folder / "locks" / f"{owner}.lock", wait=wait)

    def save(
        self, case: Case, record: Record, *, started: str, seconds: float, replace: bool = False
    ) -> None:
        """Put a record in place: first its arrays, then the manifest that makes it exist.

        One that is there stays unless it is to be replaced, which the manifest does in one step;
        its arrays, which another record may share, are left.
        """
        data, layout = arrays.pack(record)
        manifest = Manifest(
            case=case, arrays=sha256(data), layout=layout, started=started, seconds=seconds
        )
        files.write_whole(self._arrays_path(manifest), data, owner=case.id)
        write = files.write_whole if replace else files.write_once
        write(self._manifest_path(case.id), seal(manifest), owner=case.id)

    def save_failure(self, failure: Failure) -> None:
        """Put a failure record in place."""
        case_id = failure.case.id
        files.write_whole(self._failure_path(case_id), seal(failure), owner=case_id)

    def forget_failure(self, case_id: str) -> None:
        """Let the next run try a case again."""
        files.remove(self._failure_path(case_id))

    def checkpoints(self, case_id: str) -> Checkpoints:
        """The checkpoint of a case whose lock we hold."""
        return Checkpoints(self.folder / "checkpoints", case_id)

    def save_planned_run(self, planned: PlannedRun) -> None:
        """Say what is being asked for, before the first case."""
        with self.lock("plan", wait=True):
            files.write_whole(self.folder / PLAN, seal(planned), owner="plan")

    # -- care ---------------------------------------------------------------------------------

    def sweep(self) -> None:
        """Remove what killed writers left behind; what a live one needs is locked."""
        halves = {owner for owner, _ in self._temporaries()}
        for owner in halves | self._checkpointed().intersection(self.case_ids()):
            with self.lock(owner, wait=False) as held:
                if held:
                    self.clear(owner)

    def clear(self, owner: str) -> None:
        """Remove half-written files of a case whose lock we hold, and a checkpoint past its use."""
        for found, path in self._temporaries():
            if found == owner:
                files.remove(path)
        if self._manifest_path(owner).exists():
            self.checkpoints(owner).clear()

    def set_aside_damaged(self, case_id: str) -> list[str]:
        """Move damaged files of a case, whose lock we hold, out of the way; says which."""
        notes = []
        try:
            self.verified(case_id)
        except Damaged as damage:
            notes.append(str(damage))
            self._set_aside(self._manifest_path(case_id))  # first: from here on there is no record
            self._set_aside(damage.path)
        try:
            self.failure(case_id)
        except Damaged as damage:
            notes.append(str(damage))
            self._set_aside(damage.path)
        return notes

    def _set_aside(self, path: Path) -> None:
        with files.storing(path), suppress(FileNotFoundError):
            path.rename(self.folder / "damaged" / f"{path.name}.{uuid4().hex[:8]}")

    def _checkpointed(self) -> set[str]:
        """The cases that have a checkpoint."""
        return {path.name.partition(".")[0] for path in (self.folder / "checkpoints").iterdir()}

    def _temporaries(self) -> Iterator[tuple[str, Path]]:
        yield from files.temporaries(self.folder)
        for name in _FOLDERS:
            yield from files.temporaries(self.folder / name)

    def _read(self, kind: type[T], path: Path) -> T | None:
        data = files.read(path)
        return None if data is None else unseal(kind, data, path)

    def _read_arrays(self, manifest: Manifest) -> bytes:
        path = self._arrays_path(manifest)
        data = files.read(path)
        if data is None:
            raise Damaged(path, "it is missing")
        if sha256(data) != manifest.arrays:
            raise Damaged(path, "its bytes do not match its name")
        return data

    def _manifest_path(self, case_id: str) -> Path:
        return self.folder / "manifests" / f"{case_id}.json"

    def _arrays_path(self, manifest: Manifest) -> Path:
        return self.folder / "arrays" / f"{manifest.arrays}.npz"

    def _failure_path(self, case_id: str) -> Path:
        return self.folder / "failures" / f"{case_id}.json"
