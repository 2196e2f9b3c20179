"""The records of one study: each whole or absent, whatever happens while it is written.

A record is an array file named by the hash of its bytes, and a manifest named by its case.  The
manifest is put in place last and is the only commit point.  `docs/store.md` lists the promises.
"""

import os
from collections.abc import Mapping
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Literal, TypeVar
from uuid import uuid4

from ethogram.campaign import arrays, files
from ethogram.campaign.arrays import Record, Unfitting
from ethogram.campaign.case import Case
from ethogram.campaign.checkpoints import Checkpoints
from ethogram.campaign.manifests import (
    Damaged,
    Failure,
    Manifest,
    OtherFormat,
    PlannedRun,
    seal,
    sha256,
    unseal,
)
from ethogram.campaign.untrusted import MOST_BYTES, is_hash

State = Literal["stored", "failed", "missing", "damaged", "of another version"]
T = TypeVar("T")

_NONE: Mapping[str, str] = {}
_LONGEST = 200  # bytes of a name that is kept of what is set aside

PLAN = "plan.json"
MANIFESTS = "manifests"
_FOLDERS = ("arrays", MANIFESTS, "failures", "checkpoints", "locks", "damaged")


class Store:
    """The folder of one study, which has its name.

    Reading never changes it and takes no lock; writing a case needs its lock.  A name that stands
    in a file becomes part of a path in `_path` alone, and only if it has the form of a hash.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def create(self) -> None:
        """Make the folders, where they are not there yet."""
        files.make_folders(self.folder, _FOLDERS)

    # -- reading ------------------------------------------------------------------------------

    def state(self, case_id: str) -> State:
        """What there is of a case, every byte of it verified."""
        try:
            if self.load(case_id) is not None:
                return "stored"
            return "missing" if self.failure(case_id) is None else "failed"
        except Damaged:
            return "damaged"
        except OtherFormat:
            return "of another version"

    def manifest(self, case_id: str) -> Manifest | None:
        """The description of a record, None where there is none; its arrays are not looked at.

        Raises:
            Damaged: it is not what was written, or not of this case.
            OtherFormat: a later version of Ethogram wrote it.

        """
        path = self._manifest_path(case_id)
        manifest = self._read(Manifest, path)
        if manifest is not None:
            self._require_case(path, manifest.case, case_id)
        return manifest

    def load(self, case_id: str) -> tuple[Record, Manifest] | None:
        """A record with its description, or None where there is none; raises as `manifest` does."""
        manifest = self.manifest(case_id)
        if manifest is None:
            return None
        data = self._read_arrays(manifest)
        try:
            return arrays.unpack(data, manifest.layout), manifest
        except Unfitting as error:
            # the arrays have the right hash and may be those of another record
            path = self._manifest_path(case_id)
            raise Damaged(path, f"in {manifest.arrays}.npz, {error}") from error

    def failure(self, case_id: str) -> Failure | None:
        """The failure record of a case, None where there is none; raises as `manifest` does."""
        path = self._path("failures", case_id, ".json")
        failure = self._read(Failure, path)
        if failure is not None:
            self._require_case(path, failure.case, case_id)
        return failure

    def planned_run(self) -> PlannedRun | None:
        """What was asked for last, or None in an empty folder; raises as `manifest` does."""
        files.refuse_link(self.folder)
        path = self.folder / PLAN
        planned = self._read(PlannedRun, path)
        if planned is not None:
            self._require_study(path, planned.study)
            if (
                not len(planned.cases)
                == len(dict(planned.cases))
                == len({*dict(planned.cases).values()})
            ):
                raise Damaged(path, "it has a case twice")
        return planned

    def case_ids(self) -> list[str]:
        """The cases that have a record, of this plan or any other, whole or damaged."""
        return [name.removesuffix(".json") for name in self._manifest_names() if _is_record(name)]

    def strays(self) -> list[Damaged]:
        """What lies among the manifests like one and has a name that none can have."""
        folder = self.folder / MANIFESTS
        return [
            Damaged(folder / name, "its name is not that of a record")
            for name in self._manifest_names()
            if name.endswith(".json") and not _is_record(name)
        ]

    # -- writing ------------------------------------------------------------------------------

    def lock(self, owner: str, *, wait: bool) -> AbstractContextManager[bool]:
        """Hold the lock of a case; False at once when another process has it, unless waiting."""
        return files.locked(self._folder("locks") / f"{owner}.lock", wait=wait)

    def save(
        self,
        case: Case,
        record: Record,
        *,
        started: str,
        seconds: float,
        kernels: Mapping[str, str] = _NONE,
        replace: bool = False,
    ) -> None:
        """Put a record in place: first its arrays, then the manifest that makes it exist.

        One that is there stays unless it is to be replaced, which the manifest does in one step;
        its arrays, which another record may share, are left.
        """
        data, layout = arrays.pack(record)
        manifest = Manifest(
            case=case,
            arrays=sha256(data),
            layout=layout,
            started=started,
            seconds=seconds,
            kernels=dict(kernels),
        )
        sealed = seal(manifest)
        self._write(self._path("arrays", manifest.arrays, ".npz"), data)
        write = files.write_whole if replace else files.write_once
        write(self._manifest_path(case.id), sealed)

    def save_failure(self, failure: Failure) -> None:
        """Put a failure record in place."""
        self._write(self._path("failures", failure.case.id, ".json"), seal(failure))

    def forget_failure(self, case_id: str) -> None:
        """Let the next run try a case again."""
        files.remove(self._path("failures", case_id, ".json"))

    def checkpoints(self, case_id: str) -> Checkpoints:
        """The checkpoint of a case whose lock we hold."""
        return Checkpoints(self._folder("checkpoints"), case_id)

    def save_planned_run(self, planned: PlannedRun) -> None:
        """Say what is being asked for, before the first case."""
        with self.lock("plan", wait=True):
            self._write(self.folder / PLAN, seal(planned))

    # -- care ---------------------------------------------------------------------------------

    def sweep(self) -> list[str]:
        """Remove what killed writers left behind and set strays aside; says which.

        What a live writer needs is locked.
        """
        for folder in (self.folder, *map(self._folder, _FOLDERS)):
            files.sweep(folder)
        for case_id in self._checkpointed().intersection(self.case_ids()):
            with self.lock(case_id, wait=False) as held:
                if held:
                    self.clear(case_id)
        strays = self.strays()
        for stray in strays:
            self._set_aside(stray.path)
        return [f"{stray} It is set aside." for stray in strays]

    def clear(self, case_id: str) -> None:
        """Remove the checkpoint of a case whose lock we hold, once its record is there."""
        if files.is_file(self._manifest_path(case_id)):
            self.checkpoints(case_id).clear()

    def set_aside_damaged(self, case_id: str) -> list[str]:
        """Move damaged files of a case, whose lock we hold, out of the way; says which."""
        damages = self.checkpoints(case_id).unusable()
        try:
            self.load(case_id)
        except Damaged as error:
            damages.append(error)
            self._set_aside(self._manifest_path(case_id))  # first: from here on there is no record
        try:
            self.failure(case_id)
        except Damaged as error:
            damages.append(error)
        for damage in damages:
            self._set_aside(damage.path)
        return [f"{damage} It is set aside." for damage in damages]

    def _set_aside(self, path: Path) -> None:
        name = os.fsdecode(os.fsencode(path.name)[:_LONGEST])
        with files.storing(path), suppress(FileNotFoundError):
            path.rename(self._folder("damaged") / f"{name}.{uuid4().hex[:8]}")

    def _checkpointed(self) -> set[str]:
        """The cases that have a checkpoint."""
        names = files.names_in(self._folder("checkpoints"))
        return {name.partition(".")[0] for name in names}

    def _manifest_names(self) -> list[str]:
        return files.names_in(self._folder(MANIFESTS))

    def _read(self, kind: type[T], path: Path) -> T | None:
        data = self._bytes(path, MOST_BYTES)
        return None if data is None else unseal(kind, data, path)

    def _read_arrays(self, manifest: Manifest) -> bytes:
        path = self._path("arrays", manifest.arrays, ".npz")
        data = self._bytes(path, files.LARGEST)
        if data is None:
            raise Damaged(path, "it is missing")
        if sha256(data) != manifest.arrays:
            raise Damaged(path, "its bytes do not match its name")
        return data

    def _bytes(self, path: Path, most: int) -> bytes | None:
        """The bytes of a file; one that cannot be read is as good as damaged."""
        try:
            return files.read(path, most=most)
        except files.Unreadable as error:
            raise Damaged(path, error.reason) from error

    def _write(self, path: Path, data: bytes) -> None:
        """Put a file in place, also where something stands that is no file."""
        if files.is_there(path) and not files.is_file(path):
            self._set_aside(path)
        files.write_whole(path, data)

    def _require_case(self, path: Path, case: Case, case_id: str) -> None:
        if case.id != case_id:
            raise Damaged(path, "it describes another case")
        self._require_study(path, case.study)

    def _require_study(self, path: Path, study: str) -> None:
        name = self.folder.absolute().name
        if study != name:
            raise Damaged(path, f"it is of the study {study!r} and lies in the folder of {name!r}")

    def _manifest_path(self, case_id: str) -> Path:
        return self._path(MANIFESTS, case_id, ".json")

    def _path(self, folder: str, name: str, suffix: str) -> Path:
        """The file of a case or of arrays."""
        if not is_hash(name):
            raise ValueError(f"{name!r} is no sha256")
        return self._folder(folder) / f"{name}{suffix}"

    def _folder(self, name: str) -> Path:
        """One of the folders of the store, in which it stays: none of them is a link."""
        files.refuse_link(self.folder)
        files.refuse_link(self.folder / name)
        return self.folder / name


def _is_record(name: str) -> bool:
    """Whether this is the name of a manifest's file."""
    return name.endswith(".json") and is_hash(name.removesuffix(".json"))
