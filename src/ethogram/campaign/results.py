"""A results folder: one store for each study that was run into it."""

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ethogram.campaign.arrays import Record
from ethogram.campaign.sealed import Damaged, Manifest, PlannedRun, sha256
from ethogram.campaign.store import PLAN, Store
from ethogram.campaign.trees import canonical
from ethogram.core.errors import EthogramError

_RUN_AGAIN = "Run the plan again: what is stored is taken up as it is."
_DAMAGED_AGAIN = (
    "A run of the plan that a damaged record belongs to computes it again; a record that is no "
    "longer wanted is removed with its manifest's file."
)


def stores(folder: Path) -> dict[str, Store]:
    """The stores in a results folder by study, or an error with the folder likely meant."""
    try:
        found = {path.name: Store(path) for path in _planned(folder)}
        if not found:
            what = "holds no results" if folder.is_dir() else "is no folder"
            raise EthogramError(f"{str(folder)!r} {what}.{_likely(folder)}")
    except OSError as error:
        raise EthogramError(f"Cannot read {str(folder)!r}: {error.strerror}.") from error
    return found


@dataclass(frozen=True)
class Collected:
    """What a store holds of the run that was asked for last, in its order."""

    planned: PlannedRun
    records: dict[str, Record]  # by the case's name
    manifests: tuple[Manifest, ...]  # of the records
    failures: tuple[tuple[str, str], ...]  # the case's name, its error in one line
    damages: tuple[str, ...]  # what is wrong with records that are left out

    @property
    def digest(self) -> str:
        """One hash over the records."""
        return digest_of(self.manifests)

    @property
    def versions(self) -> dict[str, str]:
        """Versions of the packages, all of them where records were computed by several."""
        found: dict[str, set[str]] = {}
        for manifest in self.manifests:
            plugin = [tuple(manifest.case.package.rsplit(" ", 1))] if manifest.case.package else []
            for package, version in (*manifest.versions.items(), *plugin):
                found.setdefault(package, set()).add(version)
        return {package: ", ".join(sorted(versions)) for package, versions in found.items()}


def collect(store: Store) -> Collected:
    """Read the records of the run that was asked for last, every byte of them verified."""
    try:
        planned = store.planned_run()
    except Damaged as damage:
        raise EthogramError(f"{damage} {_RUN_AGAIN}") from damage
    if planned is None:
        raise EthogramError(f"{str(store.folder / PLAN)!r} is missing. {_RUN_AGAIN}")
    records, manifests, failures, damages = {}, [], [], []
    for name, case_id in planned.cases:
        try:
            found = store.load(case_id)
            failure = store.failure(case_id)
        except Damaged as damage:
            damages.append(str(damage))
            continue
        if found is not None:
            records[name], manifest = found
            manifests.append(manifest)
        elif failure is not None:
            failures.append((name, failure.error))
    return Collected(planned, records, tuple(manifests), tuple(failures), tuple(damages))


def digest(folder: Path) -> str:
    """One hash over all records in a results folder; an error names those that are damaged."""
    manifests, damages = [], []
    for store in stores(folder).values():
        for case_id in store.case_ids():
            try:
                manifest = store.verified(case_id)
            except Damaged as damage:
                damages.append(str(damage))
            else:
                manifests += [] if manifest is None else [manifest]
    if damages:
        raise EthogramError("\n".join([*damages, _DAMAGED_AGAIN]))
    return digest_of(manifests)


def digest_of(manifests: Iterable[Manifest]) -> str:
    """One hash over cases and data, not over when, where and in which order they were computed."""
    return sha256(canonical(sorted(manifest.identity for manifest in manifests)))


def _planned(folder: Path) -> list[Path]:
    """The stores in a folder, known by a plan or by records."""
    marks = (f"*/{PLAN}", "*/manifests")
    return sorted({path.parent for mark in marks for path in folder.glob(mark)})


def _likely(folder: Path) -> str:
    """The folder that a user most likely meant, as a question, or nothing."""
    if (folder / PLAN).is_file():
        return f" Did you mean {str(folder.parent)!r}?"
    beside = [path.name for path in folder.parent.glob("*") if _planned(path)]
    near = difflib.get_close_matches(folder.name, beside, n=1, cutoff=0.5) or beside[:1]
    return f" Did you mean {str(folder.parent / near[0])!r}?" if near else ""
