"""The commands.

Whatever loads slowly (JAX, xarray, matplotlib) is imported inside the commands, so that `--help`
answers at once.
"""

import json
import os
import sys
import webbrowser
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from cyclopts import App, CycloptsError, Parameter
from cyclopts.validators import Number
from rich.console import Console

from ethogram import __version__
from ethogram.campaign.interrupts import certain_interrupts
from ethogram.campaign.threads import limit_threads
from ethogram.cli.gather import collected_in, comparison_of, page_of, trials_in
from ethogram.cli.printing import (
    claim_lines,
    finite,
    plain_comparison,
    say,
    show_comparison,
    show_prospects,
)
from ethogram.core.errors import EthogramError, UnknownName

if TYPE_CHECKING:
    from ethogram.campaign.engines import Engine
    from ethogram.campaign.launch import Summary
    from ethogram.campaign.plan import Plan
    from ethogram.campaign.study import Study

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
Format = Literal["html", "gif", "webp", "mp4"]
ReplayFormat = Annotated[
    Format | None,
    Parameter(
        name="--format",
        help="What to write: a page with a player (html), or a film (mp4 needs `ethogram[video]`); "
        "by default what the name of --out ends in, else html.",
    ),
]
ReplayTrial = Annotated[
    int | None,
    Parameter(
        help="Trial to show, from 1; by default all that were recorded, in a film the first."
    ),
]
PageSize = Annotated[
    float,
    Parameter(
        name="--page-size",
        help="Megabytes that a page takes at most; where there is more to replay, frames are left "
        "out, and the page says so.",
    ),
]
FolderA = Annotated[Path, Parameter(help="Folder of the one run's results.")]
FolderB = Annotated[Path, Parameter(help="Folder of the other run's results.")]
CompareOut = Annotated[
    Path | None, Parameter(name="--out", help="File to write; by default compare.html in DIR_B.")
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
        say(f"ethogram: {error}")
        return WRONG
    except KeyboardInterrupt:
        say("Interrupted. Every finished case is stored; the same command continues from there.")
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
        show_prospects(prospects, to_do, crew_size(compute, to_do, workers))
        return DONE
    summary = _carried_out(chosen, chosen_plan, out, compute, workers, retry_failed)
    return _conclude([summary], out)


@app.command
def report(folder: Folder, /, *, page_size: PageSize = 10.0) -> int:
    """Write the report on a folder of results, from what is stored there."""
    from ethogram.report import page_bytes, write

    most = page_bytes(page_size)
    found = collected_in(folder)
    pages = [page_of(study, collected) for study, collected in found]
    index = write(folder, pages, page_bytes=most)
    print(index)
    return FAILED if any(collected.damages for _, collected in found) else DONE


@app.command
def replay(
    folder: Folder,
    study: Name,
    case: CaseName,
    /,
    *,
    out: ReplayOut = None,
    format_: ReplayFormat = None,
    trial: ReplayTrial = None,
    page_size: PageSize = 10.0,
    show: Show = True,
) -> None:
    """Show the recorded scene of a case, as a page that needs no network or as a film."""
    from ethogram.report import page_bytes, write_replay
    from ethogram.report.film import write_film
    from ethogram.report.site import slug

    suffix = out.suffix.lower().removeprefix(".") if out else ""
    if format_ and out and suffix != format_:
        raise EthogramError(
            f"--format {format_} and --out {str(out)!r} disagree: leave one of them out, or let "
            f"the file's name end in .{format_}."
        )
    written = format_ or suffix or "html"
    if written not in get_args(Format):
        raise UnknownName("format", written, get_args(Format))
    trials = trials_in(folder, study, case)
    if trial is not None and trial not in trials:
        raise UnknownName("recorded trial", str(trial), map(str, trials))
    which = f"-trial-{trial}" if trial is not None else ""
    file = out or folder / "report" / f"{slug(study)}-{slug(case)}{which}.{written}"
    shown = trials[trial or min(trials)]
    if written == "html":
        replays = list(trials.values()) if trial is None else [shown]
        write_replay(file, study, replays, page_bytes=page_bytes(page_size))
    elif shown.scene is None:
        raise EthogramError(f"The case {case!r} of {study!r} cannot be shown: {shown.trouble}.")
    else:
        write_film(file, shown.scene)
    print(file)
    if show and written == "html":
        webbrowser.open(file.resolve().as_uri())


@app.command
def claims(folder: Folder, /, *, as_json: AsJson = False) -> None:
    """Print the thesis' claims with their verdicts."""
    found = {
        study.NAME: study.claims(collected.records) for study, collected in collected_in(folder)
    }
    if as_json:
        plain = {name: [finite(asdict(claim)) for claim in found[name]] for name in found}
        print(json.dumps(plain, indent=2, allow_nan=False))
        return
    for name, verdicts in found.items():
        print(name)
        for claim in verdicts:
            print(claim_lines(claim))


@app.command
def compare(
    dir_a: FolderA,
    dir_b: FolderB,
    /,
    *,
    out: CompareOut = None,
    show: Show = True,
    as_json: AsJson = False,
) -> None:
    """Set two runs side by side: settings that differ, claims and, on a page, the tables.

    With --json the page is written as well, but not opened.
    """
    from ethogram.report import write_comparison

    found = comparison_of(dir_a, dir_b)
    page = out or dir_b / "compare.html"
    write_comparison(page, found)
    if as_json:
        print(json.dumps(plain_comparison(found, page), indent=2, allow_nan=False))
        return
    show_comparison(found)
    print(page)
    if show:
        webbrowser.open(page.resolve().as_uri())


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
    say(f"{len(failures)} failed; --retry-failed tries them again:")
    for name, error in failures:
        say(f"  {name}: {error}")
    return FAILED
