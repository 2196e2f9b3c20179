"""The command line: runs studies, shows what they found.

Whatever loads slowly (JAX, xarray, matplotlib) is imported inside the commands, so that `--help`
answers at once.
"""

import json
import math
import os
import sys
import webbrowser
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CycloptsError, Parameter
from cyclopts.validators import Number
from rich.console import Console
from rich.table import Table

from ethogram import __version__
from ethogram.campaign.interrupts import certain_interrupts
from ethogram.campaign.threads import limit_threads
from ethogram.core.errors import EthogramError, UnknownName

if TYPE_CHECKING:
    import xarray as xr

    from ethogram.campaign.engines import Engine
    from ethogram.campaign.launch import Prospect, Summary
    from ethogram.campaign.plan import Plan
    from ethogram.campaign.results import Collected
    from ethogram.campaign.study import Records, Study
    from ethogram.core.findings import Claim
    from ethogram.report import Replay, StudyPage

DONE, FAILED, WRONG, INTERRUPTED = 0, 1, 2, 130  # exit codes

app = App(
    name="ethogram",
    help="Worlds in which artificial agents learn, and studies of what behaviour emerges.",
    version=__version__,
    suppress_keyboard_interrupt=False,
)

Name = Annotated[str, Parameter(help="Name of the study; `ethogram list` shows them.")]
PlanName = Annotated[str, Parameter(name="--plan", help="Name of the plan: smoke, quick, thesis.")]
Folder = Annotated[Path, Parameter(help="Folder of the results, where `ethogram run` put them.")]
Out = Annotated[Path, Parameter(help="Folder of the results; a run continues from what is there.")]
EngineName = Annotated[
    str, Parameter(name="--engine", help="pool (several processes) or inline (this one).")
]
Workers = Annotated[
    int | None,
    Parameter(
        validator=Number(gte=1),
        help="Cases to compute at once; by default as many as cores and memory admit.",
    ),
]
Changes = Annotated[
    tuple[str, ...],
    Parameter(
        name="--set",
        negative=(),
        consume_multiple=True,
        show_default=False,
        help="key=value, any number of them: change a setting of the plan, or restrict an axis to "
        "one value or a list (strategy=always,none).",
    ),
]
Retry = Annotated[bool, Parameter(negative=(), help="Try cases again that failed before.")]
DryRun = Annotated[bool, Parameter(negative=(), help="List the cases, with time and memory.")]
CaseName = Annotated[str, Parameter(help="Name of the case; `ethogram run --dry-run` shows them.")]
ReplayOut = Annotated[
    Path | None, Parameter(name="--out", help="File to write; by default one in the report.")
]
Show = Annotated[bool, Parameter(name="--show", negative="--no-show", help="Open it in a browser.")]
AsJson = Annotated[bool, Parameter(name="--json", negative=(), help="Print JSON, not text.")]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns its exit code."""
    limit_threads()  # before a command loads NumPy and JAX
    try:
        with certain_interrupts():
            code = app(
                arguments, exit_on_error=False, print_error=False, result_action="return_value"
            )
        sys.stdout.flush()
    except (CycloptsError, EthogramError) as error:
        _say(f"ethogram: {error}")
        return WRONG
    except KeyboardInterrupt:
        _say("Interrupted. Every finished case is stored; the same command continues from there.")
        return INTERRUPTED
    except BrokenPipeError:  # the reader of our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    return DONE if code is None else int(code)


@app.command(name="list")
def list_() -> None:
    """List the studies with their plans, the worlds and the learners."""
    from ethogram.learners import LEARNERS
    from ethogram.studies import STUDIES
    from ethogram.worlds import WORLDS

    for name in STUDIES.names():
        study = STUDIES.get(name)
        print(f"{name}: {study.TITLE}. {study.QUESTION}")
        for plan in study.PLANS.values():
            print(f"  --plan {plan.name}: {plan.description}")
    print(f"worlds: {', '.join(WORLDS.names())}")
    print(f"learners: {', '.join(LEARNERS.names())}")


@app.command
def run(
    study: Name,
    /,
    *,
    plan: PlanName = "quick",
    out: Out = Path("results"),
    engine: EngineName = "pool",
    workers: Workers = None,
    changes: Changes = (),
    retry_failed: Retry = False,
    dry_run: DryRun = False,
) -> int:
    """Run a plan of a study, or what is missing of it."""
    from ethogram.campaign.engines import engine_named
    from ethogram.campaign.launch import crew_size, survey

    compute = engine_named(engine)
    chosen, chosen_plan = _chosen(study, plan, changes)
    if dry_run:
        prospects = survey(chosen, chosen_plan, out)
        to_do = [found for found in prospects if found.is_to_do(retry_failed=retry_failed)]
        _show(prospects, to_do, crew_size(compute, to_do, workers))
        return DONE
    summary = _carried_out(chosen, chosen_plan, out, compute, workers, retry_failed)
    return _conclude([summary], out)


@app.command
def report(folder: Folder, /) -> int:
    """Write the report on a folder of results, from what is stored there."""
    from ethogram.report import write

    found = _collected(folder)
    index = write(folder, [_page(study, collected) for study, collected in found])
    print(index)
    return FAILED if any(collected.damages for _, collected in found) else DONE


@app.command
def replay(
    folder: Folder, study: Name, case: CaseName, /, *, out: ReplayOut = None, show: Show = True
) -> None:
    """Show the recorded scene of a case, as a page that needs no network."""
    from ethogram.report import write_replay
    from ethogram.report.site import slug

    names = {found.NAME: collected for found, collected in _collected(folder)}
    if study not in names:
        raise UnknownName("study with results here", study, names)
    records = names[study].records
    if case not in records:
        raise UnknownName("case that was run", case, records)
    if "scene" not in records[case]:
        raise EthogramError(f"The case {case!r} of {study!r} has no scene.")
    file = out or folder / "report" / f"{slug(study)}-{slug(case)}.html"
    write_replay(file, study, _replay(case, records[case]["scene"]))
    print(file)
    if show:
        webbrowser.open(file.resolve().as_uri())


@app.command
def claims(folder: Folder, /, *, as_json: AsJson = False) -> None:
    """Print the thesis' claims with their verdicts."""
    found = {study.NAME: study.claims(collected.records) for study, collected in _collected(folder)}
    if as_json:
        plain = {name: [_finite(asdict(claim)) for claim in found[name]] for name in found}
        print(json.dumps(plain, indent=2, allow_nan=False))
        return
    for name, verdicts in found.items():
        print(name)
        for claim in verdicts:
            print(_claim_lines(claim))


@app.command
def digest(folder: Folder, /) -> None:
    """Print one hash over all stored data, the same wherever and whenever it was computed."""
    from ethogram.campaign import results

    print(results.digest(folder))


@app.command
def reproduce(
    *,
    plan: PlanName = "quick",
    out: Out = Path("results"),
    engine: EngineName = "pool",
    workers: Workers = None,
    retry_failed: Retry = False,
) -> int:
    """Run a plan of every study there is, then write the report."""
    from ethogram.campaign.engines import engine_named
    from ethogram.studies import STUDIES

    compute = engine_named(engine)
    chosen = [_chosen(name, plan) for name in STUDIES.names()]
    summaries = [
        _carried_out(study, study_plan, out, compute, workers, retry_failed)
        for study, study_plan in chosen
    ]
    return max(_conclude(summaries, out), report(out))


def _chosen(
    study_name: str, plan_name: str, changes: Sequence[str] = ()
) -> "tuple[Study, Plan[Any]]":
    """The study and its plan that a user names."""
    from ethogram.studies import STUDIES

    study = STUDIES.get(study_name)
    if plan_name not in study.PLANS:
        raise UnknownName(f"{study_name} plan", plan_name, study.PLANS)
    return study, study.PLANS[plan_name].override(changes)


def _carried_out(
    study: "Study",
    plan: "Plan[Any]",
    out: Path,
    engine: "Engine",
    workers: int | None,
    retry_failed: bool,
) -> "Summary":
    from ethogram.campaign.display import Display
    from ethogram.campaign.launch import launch

    with Display(Console(stderr=True)) as display:
        return launch(
            study,
            plan,
            out,
            engine=engine,
            monitor=display,
            workers=workers,
            retry_failed=retry_failed,
        )


def _conclude(summaries: "Sequence[Summary]", out: Path) -> int:
    """Say how runs ended; returns the exit code."""
    planned = sum(summary.planned for summary in summaries)
    stored = sum(summary.stored for summary in summaries)
    print(f"{stored} of {planned} cases are stored in {out}.")
    failures = [failure for summary in summaries for failure in summary.failures]
    if not failures:
        return DONE
    _say(f"{len(failures)} failed; --retry-failed tries them again:")
    for name, error in failures:
        _say(f"  {name}: {error}")
    return FAILED


def _show(prospects: "Sequence[Prospect]", to_do: "Sequence[Prospect]", crew: int) -> None:
    """List the cases of a plan, and what those that a run would compute take together."""
    from ethogram.campaign.display import readable_seconds
    from ethogram.core.memory import available_memory, readable_bytes

    table = Table("case", "state", "time", "memory", box=None)
    for prospect in prospects:
        table.add_row(
            prospect.case.name,
            "to do" if prospect in to_do else prospect.state,
            readable_seconds(prospect.cost.seconds),
            readable_bytes(prospect.cost.bytes),
        )
    Console().print(table)
    seconds = sum(prospect.cost.seconds for prospect in to_do) / crew
    peak = sum(sorted(prospect.cost.bytes for prospect in to_do)[-crew:])
    print(
        f"{len(to_do)} of {len(prospects)} cases to do, {crew} at a time: about "
        f"{readable_seconds(seconds)} and {readable_bytes(peak)} of memory."
    )
    free = available_memory()
    too_large = [prospect.case.name for prospect in to_do if prospect.cost.bytes > free]
    if too_large:
        _say(
            f"{len(too_large)} need more than the {readable_bytes(free)} that are free: "
            "they would fail."
        )


def _collected(folder: Path) -> "list[tuple[Study, Collected]]":
    """What is stored of each study in a folder; says which records are damaged."""
    from ethogram.campaign.results import collect, stores
    from ethogram.studies import STUDIES

    found = []
    known = STUDIES.names()
    for name, store in stores(folder).items():
        if name not in known:
            _say(f"{store.folder} is left out: no study of the name {name!r} is installed.")
            continue
        study, collected = STUDIES.get(name), collect(store)
        if collected.planned.version != study.VERSION:
            raise EthogramError(
                f"{store.folder} was computed by version {collected.planned.version} of the study "
                f"{name!r}; this is version {study.VERSION}. Run its plan again."
            )
        for damage in collected.damages:
            _say(f"{damage} It is left out; the next run of its plan computes it again.")
        found.append((study, collected))
    return found


def _page(study: "Study", collected: "Collected") -> "StudyPage":
    from ethogram.report import StudyPage

    planned, manifests, records = collected.planned, collected.manifests, collected.records
    return StudyPage(
        name=study.NAME,
        title=study.TITLE,
        question=study.QUESTION,
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
        figures=study.figures(records),
        replays=_replays(records),
    )


def _replays(records: "Records") -> "list[Replay]":
    """The scenes that there are, by the names of their cases."""
    return [_replay(name, groups["scene"]) for name, groups in records.items() if "scene" in groups]


def _replay(name: str, stored: "xr.Dataset") -> "Replay":
    """A scene, or why what is stored is none: the rest of a report does without."""
    from ethogram.core.scene import Scene
    from ethogram.report import Replay

    try:
        return Replay(name=name, scene=Scene.from_dataset(stored))
    except (EthogramError, KeyError, TypeError, ValueError) as error:
        reason = str(error) or type(error).__name__
        return Replay(name=name, scene=None, trouble=f"what is stored is no scene ({reason})")


def _claim_lines(claim: "Claim") -> str:
    """A claim as text: the verdict and the statement, and below them the evidence."""
    lines = [f"{claim.number:3}. {claim.verdict:10} {claim.statement}"]
    if claim.effect is not None:
        evidence = f"effect {claim.effect:.3g}"
        if claim.low is not None and claim.high is not None:
            evidence += f" [{claim.low:.3g}, {claim.high:.3g}]"
        evidence += f" {claim.unit}"
        if claim.p_value is not None:
            evidence += f", p = {claim.p_value:.2g}"
        lines.append(f"{'':16}{evidence}; {claim.test}")
    if claim.note:
        lines.append(f"{'':16}{claim.note}")
    return "\n".join(lines)


def _finite(fields: dict[str, Any]) -> dict[str, Any]:
    """Fields as JSON has them, in which a number that is none is null."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in fields.items()
    }


def _say(text: str) -> None:
    """Print for the person at the terminal, apart from what a command gives out."""
    print(text, file=sys.stderr)
