"""From a folder of results to what is shown of it."""

import shlex
from collections.abc import Container, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ethogram.cli.streams import readable, say
from ethogram.core.errors import EthogramError, UnknownName

if TYPE_CHECKING:
    import xarray as xr

    from ethogram.campaign.arrays import Record
    from ethogram.campaign.results import Collected
    from ethogram.campaign.store import Store
    from ethogram.campaign.study import Records, Study
    from ethogram.core.findings import Claim
    from ethogram.report import Comparison, Replay, StudyPage


@dataclass(frozen=True)
class Gathered:
    """What a folder of results holds of the studies that are installed."""

    studies: "list[tuple[Study, Collected]]"
    damages: tuple[str, ...]  # what is left out since it cannot be used


def gathered(folder: Path, names: Container[str] | None = None) -> Gathered:
    """What is stored of each study in a folder, or of those named; says what is left out.

    Raises:
        EthogramError: nothing of what is there can be shown.

    """
    from ethogram.campaign.results import stores
    from ethogram.studies import STUDIES

    studies, damages, refusals = [], [], []
    for name, store in stores(folder).items():
        if names is not None and name not in names:
            continue
        if name not in STUDIES:
            say(f"{store.folder} is left out: no study of the name {name!r} is installed.")
            continue
        try:
            study = STUDIES[name]
            collected = _collected(study, store)
        except EthogramError as error:
            refusals.append(str(error))
            continue
        damages += [
            f"{damage} It is left out; the next run of its plan computes it again."
            for _, damage in collected.damages
        ]
        studies.append((study, collected))
    if refusals and not studies:
        raise EthogramError("\n".join(refusals))
    damages += [f"{refusal} The study is left out." for refusal in refusals]
    for damage in damages:
        say(readable(damage))
    return Gathered(studies, tuple(damages))


def _collected(study: "Study", store: "Store") -> "Collected":
    """What is stored of a study, or an error that says how to get at it."""
    from ethogram.campaign.files import StorageError
    from ethogram.campaign.results import collect

    try:
        collected = collect(store)
    except StorageError:
        raise
    except EthogramError as error:
        raise EthogramError(f"{error}{_fitting_plan(study, store)}") from error
    if collected.planned.version != study.VERSION:
        raise EthogramError(
            f"{store.folder} was computed by version {collected.planned.version} of the study "
            f"{study.NAME!r}; this is version {study.VERSION}. Run its plan again."
        )
    return collected


def _fitting_plan(study: "Study", store: "Store") -> str:
    """The command that takes up most of what a store holds, for a store without its plan."""
    from ethogram.campaign.provenance import package_of

    stored, package = set(store.case_ids()), package_of(study)
    found = {}
    for name, plan in study.PLANS.items():
        cases = [replace(case, package=package) for case in study.cases(plan)]
        taken_up = sum(case.id in stored for case in cases)
        found[name] = (taken_up, -len(cases))
    best = max(found, key=lambda name: found[name], default=None)
    if best is None or not found[best][0]:
        return ""
    taken_up, size = found[best]
    out = shlex.quote(str(store.folder.parent))
    return (
        f" `ethogram run {study.NAME} --plan {best} --out {out}` finds {taken_up} of its {-size} "
        "cases there."
    )


def page_of(study: "Study", collected: "Collected") -> "StudyPage":
    """A study's page, with all there is to show."""
    from ethogram.campaign.study import blamed

    records = collected.records
    with blamed(study, "figures"):
        figures = study.figures(records)
    replays = _replays(records)
    return replace(undrawn_page(study, collected), figures=figures, replays=replays)


def undrawn_page(study: "Study", collected: "Collected") -> "StudyPage":
    """A page without what takes time to draw."""
    from ethogram.campaign.study import blamed, introduction_of
    from ethogram.report import StudyPage

    with blamed(study, "tables"):
        tables = study.tables(collected.records)
    planned, manifests, records = collected.planned, collected.manifests, collected.records
    return StudyPage(
        name=study.NAME,
        title=study.TITLE,
        question=study.QUESTION,
        introduction=introduction_of(study),
        plan=planned.plan,
        plan_description=planned.description,
        trials=planned.trials,
        cases_done=len(records),
        cases_planned=len(planned.cases),
        failures=collected.failures,
        date=max((manifest.started for manifest in manifests), default=planned.started)[:10],
        seconds=sum(manifest.seconds for manifest in manifests),
        command=planned.command,
        digest=collected.digest,
        settings=planned.varied_settings,
        versions=collected.versions,
        claims=claims_of(study, records),
        tables=tables,
    )


def claims_of(study: "Study", records: "Records") -> "Sequence[Claim]":
    """A study's claims; an error that names the place where its own code broke."""
    from ethogram.campaign.study import blamed

    with blamed(study, "claims"):
        return study.claims(records)


def comparison_of(dir_a: Path, dir_b: Path) -> "tuple[Comparison, tuple[str, ...]]":
    """The studies that both folders hold, and what is left out; the records of others stay unread.

    Raises:
        EthogramError: there is no study of which both folders can be shown.

    """
    from ethogram.campaign.results import stores
    from ethogram.report import Comparison, compare_pages

    held_a, held_b = stores(dir_a), stores(dir_b)
    shared = held_a.keys() & held_b.keys()
    a, b = (gathered(folder, shared) for folder in (dir_a, dir_b))
    pages_a, pages_b = (
        {study.NAME: undrawn_page(study, collected) for study, collected in side.studies}
        for side in (a, b)
    )
    both = [name for name in pages_a if name in pages_b]
    if not both:
        raise EthogramError(
            f"There is no study to compare: {str(dir_a)!r} holds {', '.join(held_a)}; "
            f"{str(dir_b)!r} holds {', '.join(held_b)}."
        )
    found = Comparison(
        a=str(dir_a),
        b=str(dir_b),
        studies=[compare_pages(pages_a[name], pages_b[name]) for name in both],
        only_a=[name for name in held_a if name not in shared],
        only_b=[name for name in held_b if name not in shared],
    )
    return found, a.damages + b.damages


def held_in(found: Gathered) -> dict[str, Any]:
    """What a folder holds and lacks, by the names of the cases, as JSON has it."""
    return {
        study.NAME: {
            "planned": len(collected.planned.cases),
            "stored": len(collected.records),
            "failed": [name for name, _ in collected.failures],
            "missing": list(collected.missing),
            "damaged": [name for name, _ in collected.damages],
        }
        for study, collected in found.studies
    }


def _replays(records: "Records") -> "list[Replay]":
    """The scenes that there are, case by case."""
    return [replay for name, groups in records.items() for replay in trials_of(name, groups)]


def trials_in(folder: Path, study: str, case: str) -> "dict[int, Replay]":
    """The recorded scenes of a case in a folder, by the numbers of the trials.

    Raises:
        Damaged: the record cannot be used.
        EthogramError: there is no such record, or it has no scene.

    """
    from ethogram.campaign.results import load, planned_in, stores

    held = stores(folder)
    if study not in held:
        raise UnknownName("study with results here", study, held)
    cases = dict(planned_in(held[study]).cases)
    found = load(held[study], case, cases[case]) if case in cases else None
    if found is None:
        there = [name for name in cases if held[study].state(cases[name]) == "stored"]
        raise UnknownName("case that was run", case, there)
    trials = {replay.trial: replay for replay in trials_of(case, found[0])}
    if not trials:
        raise EthogramError(f"The case {case!r} of {study!r} has no scene.")
    return trials


def trials_of(case: str, groups: "Record") -> "list[Replay]":
    """The scenes of a case, those of the first trials."""
    from ethogram.core.recorded import groups_by_trial

    found = groups_by_trial(groups).items()
    return [_replay(case, groups[group], trial) for trial, group in found]


def _replay(name: str, stored: "xr.Dataset", trial: int) -> "Replay":
    """A scene, or why what is stored is none: the rest of a report does without."""
    from ethogram.core.scene import Scene
    from ethogram.report import Replay

    try:
        return Replay(name=name, scene=Scene.from_dataset(stored), trial=trial)
    except (EthogramError, AttributeError, LookupError, TypeError, ValueError) as error:
        reason = str(error) or type(error).__name__
        what = f"what is stored is no scene ({reason})"
        return Replay(name=name, scene=None, error=what, trial=trial)
