"""A results folder: one store for each study that was run into it."""

import difflib
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ethogram.campaign import files
from ethogram.campaign.arrays import Record
from ethogram.campaign.manifests import Damaged, Manifest, PlannedRun, Unusable, sha256
from ethogram.campaign.settings_json import canonical
from ethogram.campaign.store import MANIFESTS, PLAN, Store
from ethogram.core.errors import EthogramError, shown
from ethogram.core.kernels import JAX

RUN_AGAIN = "Run the plan again: what is stored is taken up as it is."
_DAMAGED_AGAIN = (
    "A run of the plan that a damaged record belongs to computes it again; a record that is no "
    "longer wanted is removed with its manifest's file."
)


class DamagedRecords(EthogramError):
    """Some records of a folder cannot be used; the message names each."""


def stores(folder: Path) -> dict[str, Store]:
    """The stores in a results folder by study, or an error with the folder likely meant."""
    try:
        is_folder = folder.is_dir()
    except OSError as error:
        raise EthogramError(f"Cannot read {shown(str(folder))}: {error.strerror}.") from error
    names = _stores_in(folder) if is_folder else []
    if not names:
        what = "holds no results" if is_folder else "is no folder"
        raise EthogramError(f"{str(folder)!r} {what}.{_likely(folder)}")
    return {name: Store(folder / name) for name in names}


@dataclass(frozen=True)
class Collected:
    """What a store holds of the run that was asked for last, in its order."""

    planned: PlannedRun
    records: dict[str, Record]  # by the case's name
    manifests: tuple[Manifest, ...]  # of the records
    failures: tuple[tuple[str, str], ...]  # the case's name, its error in one line
    damages: tuple[tuple[str, str], ...]  # the name of a case left out, what is wrong with it

    @property
    def missing(self) -> tuple[str, ...]:
        """The cases of which there is nothing."""
        known = {*self.records, *dict(self.failures), *dict(self.damages)}
        return tuple(name for name, _ in self.planned.cases if name not in known)

    @property
    def digest(self) -> str:
        """One hash over the records."""
        return digest_of(self.manifests)

    @property
    def versions(self) -> dict[str, str]:
        """Versions of packages and kernels, all of them where records were computed by several."""
        found: dict[str, set[str]] = {}
        for manifest in self.manifests:
            plugin = [tuple(manifest.case.package.rsplit(" ", 1))] if manifest.case.package else []
            for package, version in (*manifest.versions.items(), *plugin):
                found.setdefault(package, set()).add(version)
        for kernel in {name for manifest in self.manifests for name in manifest.kernels}:
            found[f"kernel {kernel}"] = {
                manifest.kernels.get(kernel, JAX) for manifest in self.manifests
            }
        return {package: ", ".join(sorted(versions)) for package, versions in found.items()}


def collect(store: Store) -> Collected:
    """Read the records of the run that was asked for last, every byte of them verified."""
    planned = planned_in(store)
    records, manifests, failures, damages = {}, [], [], []
    for name, case_id in planned.cases:
        try:
            found = load(store, name, case_id)
            failure = None if found else store.failure(case_id)
        except Unusable as damage:
            damages.append((name, str(damage)))
            continue
        if found is not None:
            records[name], manifest = found
            manifests.append(manifest)
        elif failure is not None:
            failures.append((name, failure.error))
    return Collected(planned, records, tuple(manifests), tuple(failures), tuple(damages))


def planned_in(store: Store) -> PlannedRun:
    """What was asked for last of a store, or an error that says how to get it back."""
    try:
        planned = store.planned_run()
    except Damaged as damage:
        raise EthogramError(f"{damage} {RUN_AGAIN}") from damage
    if planned is None:
        raise EthogramError(f"{str(store.folder / PLAN)!r} is missing. {RUN_AGAIN}")
    return planned


def load(store: Store, name: str, case_id: str) -> tuple[Record, Manifest] | None:
    """The record of a case that a plan gives this name, or None; raises as `Store.load` does."""
    found = store.load(case_id)
    if found is not None and found[1].case.name != name:
        raise Damaged(store.folder / PLAN, f"it calls the case {found[1].case.name!r} {name!r}")
    return found


def digest(folder: Path) -> str:
    """One hash over all records in a results folder.

    Raises:
        DamagedRecords: some records cannot be used.
        EthogramError: a store has no record, or cannot be read.

    """
    manifests: list[Manifest] = []
    damages: list[Unusable] = []
    for store in stores(folder).values():
        damages += store.strays()
        case_ids = store.case_ids()
        if not case_ids:
            raise EthogramError(f"{str(store.folder)!r} holds no record.")
        for case_id in case_ids:
            try:
                found = store.load(case_id)
            except Unusable as damage:
                damages.append(damage)
            else:
                manifests += [found[1]] if found else []
    if damages:
        raise DamagedRecords("\n".join([*map(str, damages), _DAMAGED_AGAIN]))
    return digest_of(manifests)


def digest_of(manifests: Iterable[Manifest]) -> str:
    """One hash over cases and data, not over when, where and in which order they were computed."""
    return sha256(canonical(sorted(manifest.identity for manifest in manifests)))


def _stores_in(folder: Path) -> list[str]:
    """The stores in a folder, known by a plan or by records."""
    return [name for name in files.names_in(folder) if _is_store(folder / name)]


def _is_store(folder: Path) -> bool:
    """Whether a folder is a store, or does not let us see: whoever reads it then says so."""
    try:
        if not files.is_folder(folder):
            return False
        return any(files.is_there(folder / mark) for mark in (PLAN, MANIFESTS))
    except files.StorageError:
        return True


def _holds_stores(folder: Path) -> bool:
    try:
        return files.is_folder(folder) and bool(_stores_in(folder))
    except files.StorageError:
        return False


def _likely(folder: Path) -> str:
    """The folder that a user most likely meant, as a question, or nothing."""
    if files.is_file(folder / PLAN):
        return f" Did you mean {str(folder.parent)!r}?"
    beside = []
    with suppress(files.StorageError):  # it is a guess
        for name in files.names_in(folder.parent):
            if _holds_stores(folder.parent / name):
                beside.append(name)
    near = difflib.get_close_matches(folder.name, beside, n=1, cutoff=0.5) or beside[:1]
    return f" Did you mean {str(folder.parent / near[0])!r}?" if near else ""
