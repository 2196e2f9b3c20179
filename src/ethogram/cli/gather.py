"""From a folder of results to what is shown of it."""

from collections.abc import Container
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ethogram.cli.printing import say
from ethogram.core.errors import EthogramError, UnknownName

if TYPE_CHECKING:
    import xarray as xr

    from ethogram.campaign.arrays import Record
    from ethogram.campaign.results import Collected
    from ethogram.campaign.study import Records, Study
    from ethogram.report import Comparison, Replay, StudyPage


def collected_in(
    folder: Path, names: Container[str] | None = None
) -> "list[tuple[Study, Collected]]":
    """What is stored of each study in a folder, or of those named; says what is damaged."""
    from ethogram.campaign.results import collect, stores
    from ethogram.studies import STUDIES

    found = []
    known = STUDIES.names()
    for name, store in stores(folder).items():
        if names is not None and name not in names:
            continue
        if name not in known:
            say(f"{store.folder} is left out: no study of the name {name!r} is installed.")
            continue
        study, collected = STUDIES.get(name), collect(store)
        if collected.planned.version != study.VERSION:
            raise EthogramError(
                f"{store.folder} was computed by version {collected.planned.version} of the study "
                f"{name!r}; this is version {study.VERSION}. Run its plan again."
            )
        for damage in collected.damages:
            say(f"{damage} It is left out; the next run of its plan computes it again.")
        found.append((study, collected))
    return found


def page_of(study: "Study", collected: "Collected") -> "StudyPage":
    """A study's page, with all there is to show."""
    records = collected.records
    figures, replays = study.figures(records), _replays(records)
    return replace(undrawn_page(study, collected), figures=figures, replays=replays)


def undrawn_page(study: "Study", collected: "Collected") -> "StudyPage":
    """A page without what takes time to draw."""
    from ethogram.campaign.study import introduction_of
    from ethogram.report import StudyPage

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
        claims=study.claims(records),
        tables=study.tables(records),
    )


def comparison_of(dir_a: Path, dir_b: Path) -> "Comparison":
    """The studies that both folders hold; the records of others are not read."""
    from ethogram.campaign.results import stores
    from ethogram.report import Comparison, compare_pages

    held_a, held_b = stores(dir_a), stores(dir_b)
    shared = held_a.keys() & held_b.keys()
    pages_a, pages_b = (
        [undrawn_page(study, collected) for study, collected in collected_in(folder, shared)]
        for folder in (dir_a, dir_b)
    )
    if not pages_a:
        raise EthogramError(
            f"There is no study to compare: {str(dir_a)!r} holds {', '.join(held_a)}; "
            f"{str(dir_b)!r} holds {', '.join(held_b)}."
        )
    return Comparison(
        a=str(dir_a),
        b=str(dir_b),
        studies=list(map(compare_pages, pages_a, pages_b)),
        only_a=[name for name in held_a if name not in shared],
        only_b=[name for name in held_b if name not in shared],
    )


def _replays(records: "Records") -> "list[Replay]":
    """The scenes that there are, case by case."""
    return [replay for name, groups in records.items() for replay in trials_of(name, groups)]


def trials_in(folder: Path, study: str, case: str) -> "dict[int, Replay]":
    """The recorded scenes of a case in a folder, by the numbers of the trials."""
    from ethogram.campaign.results import stores

    held = stores(folder)
    if study not in held:
        raise UnknownName("study with results here", study, held)
    for _, collected in collected_in(folder, {study}):
        if case not in collected.records:
            raise UnknownName("case that was run", case, collected.records)
        found = {replay.trial: replay for replay in trials_of(case, collected.records[case])}
        if found:
            return found
    raise EthogramError(f"The case {case!r} of {study!r} has no scene.")


def trials_of(case: str, groups: "Record") -> "list[Replay]":
    """The scenes of a case, those of the first trials."""
    from ethogram.core.scene import groups_by_trial

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
        trouble = f"what is stored is no scene ({reason})"
        return Replay(name=name, scene=None, trouble=trouble, trial=trial)
