"""The commands.

Whatever loads slowly (JAX, xarray, matplotlib) is imported inside the commands, so that `--help`
answers at once.
"""

import json
import sys
import webbrowser
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from cyclopts import App, CycloptsError
from rich.console import Console

from ethogram import __version__
from ethogram.campaign.interrupts import certain_interrupts, exit_code, reason
from ethogram.campaign.threads import one_thread
from ethogram.cli.gather import (
    claims_of,
    comparison_of,
    gathered,
    held_in,
    page_of,
    trials_in,
)
from ethogram.cli.new import write_package
from ethogram.cli.parameters import (
    AsJson,
    CaseName,
    Changes,
    CompareOut,
    DryRun,
    EngineName,
    Folder,
    FolderA,
    FolderB,
    Force,
    Format,
    Name,
    NewFolder,
    NewKind,
    Out,
    PageSize,
    PlanName,
    ReplayFormat,
    ReplayOut,
    ReplayTrial,
    ReportOut,
    Retry,
    Show,
    Workers,
)
from ethogram.cli.printing import (
    claim_lines,
    finite,
    plain_comparison,
    show_comparison,
    show_prospects,
)
from ethogram.cli.streams import readable, say, tell, tolerant_streams
from ethogram.core.errors import EthogramError, UnknownName

if TYPE_CHECKING:
    from ethogram.campaign.engines import Engine
    from ethogram.campaign.launch import Summary
    from ethogram.campaign.plan import Plan
    from ethogram.campaign.study import Study

DONE, FAILED, WRONG, INTERRUPTED = 0, 1, 2, 130  # exit codes

_CONTINUES = "Every finished case is stored; the same command continues from there."

app = App(
    name="ethogram",
    help="Worlds in which artificial agents learn, and studies of what behaviour emerges.",
    version=__version__,
    suppress_keyboard_interrupt=False,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line, also from Python: `main(["run", "sharing", "--plan", "smoke"])`.

    Takes the words of `sys.argv` where none are given.  Signal handlers, environment variables and
    streams are afterwards as they were before.  In a thread other than the main one, in which
    Python handles no signals, Ctrl-C is left to the caller.

    Returns:
        The exit code: 0 when all is done; 1 when a case failed or something was left out of what
        is shown; 2 for what the user or the machine has to mend, after one message; 128 and the
        number of the signal after SIGINT, SIGTERM or SIGHUP (130, 143, 129).

    Raises:
        Exception: a defect of Ethogram, of whatever type, with its traceback.

    """
    typed = sys.argv[1:] if arguments is None else list(map(str, arguments))
    with one_thread(), tolerant_streams() as output:  # before a command loads NumPy and JAX
        try:
            with certain_interrupts():
                code = app(
                    typed, exit_on_error=False, print_error=False, result_action="return_value"
                )
            output.flush()
        except (CycloptsError, EthogramError) as error:
            say(readable(f"ethogram: {error}", typed))
            return WRONG
        except KeyboardInterrupt as stop:
            say(f"{reason()} {stop}".rstrip())
            return exit_code()
        if output.trouble:
            say(f"ethogram: Cannot print the output: {output.trouble}.")
            return WRONG
    return DONE if code is None else int(code)


@app.command(name="list")
def list_() -> int:
    """List the studies with their plans, the worlds and the learners."""
    from ethogram.learners import LEARNERS
    from ethogram.studies import STUDIES
    from ethogram.worlds import WORLDS

    broken = STUDIES.unreadable()
    for name in STUDIES:
        try:
            study = STUDIES[name]
        except EthogramError as error:
            broken.append(str(error))
            continue
        print(f"{name}: {study.TITLE}. {study.QUESTION}")
        for plan in study.PLANS.values():
            print(f"  --plan {plan.name}: {plan.description}")
    print(f"worlds: {', '.join(WORLDS)}")
    print(f"learners: {', '.join(LEARNERS)}")
    for message in broken:
        say(readable(message))
    return FAILED if broken else DONE


@app.command
def new(kind: NewKind, folder: NewFolder, /) -> int:
    """Write a package to start from: a study, a world or a learner of your own."""
    write_package(kind, folder)
    tell(folder)
    return DONE


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
    force: Force = False,
    dry_run: DryRun = False,
) -> int:
    """Run a plan of a study, or what is missing of it."""
    from ethogram.campaign.engines import engine_named
    from ethogram.campaign.launch import crew_size, survey

    compute = engine_named(engine)
    chosen, chosen_plan = _chosen(study, plan, changes)
    if dry_run:
        prospects = survey(chosen, chosen_plan, out)
        to_do = [
            each for each in prospects if each.is_to_do(retry_failed=retry_failed, force=force)
        ]
        show_prospects(prospects, to_do, crew_size(compute, to_do, workers))
        return DONE
    summary = _carried_out(
        chosen,
        chosen_plan,
        out,
        engine=compute,
        workers=workers,
        retry_failed=retry_failed,
        force=force,
    )
    return _conclude([summary], out)


@app.command
def report(folder: Folder, /, *, out: ReportOut = None, page_size: PageSize = 10.0) -> int:
    """Write the report on a folder of results, from what is stored there."""
    from ethogram.report import page_bytes, write

    most = page_bytes(page_size)
    found = gathered(folder)
    pages = []
    for number, (study, collected) in enumerate(found.studies, 1):
        say(f"{study.NAME}: drawing the page ({number} of {len(found.studies)}).")
        try:
            pages.append(page_of(study, collected))
        except EthogramError as error:
            say(readable(f"{error} It is left out."))
    tell(write(out or folder, pages, page_bytes=most))
    return FAILED if found.damages or len(pages) < len(found.studies) else DONE


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
) -> int:
    """Show the recorded scene of a case, as a page that needs no network or as a video."""
    from ethogram.campaign.files import refuse_link
    from ethogram.campaign.manifests import Damaged
    from ethogram.report import page_bytes, write_replay
    from ethogram.report.render.video import write_video
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
    try:
        trials = trials_in(folder, study, case)
    except Damaged as damage:
        say(str(damage))
        return FAILED
    if trial is not None and trial not in trials:
        raise UnknownName("recorded trial", str(trial), map(str, trials))
    which = f"-trial-{trial}" if trial is not None else ""
    file = out or folder / "report" / f"{slug(study)}-{slug(case)}{which}.{written}"
    if out is None:
        refuse_link(file.parent)
    shown = trials[trial or min(trials)]
    if written == "html":
        replays = list(trials.values()) if trial is None else [shown]
        write_replay(file, study, replays, page_bytes=page_bytes(page_size))
    elif shown.scene is None:
        raise EthogramError(f"The case {case!r} of {study!r} cannot be shown: {shown.error}.")
    else:
        write_video(file, shown.scene)
    tell(file)
    if show and written == "html":
        webbrowser.open(file.resolve().as_uri())
    return DONE


@app.command
def claims(folder: Folder, /, *, as_json: AsJson = False) -> int:
    """Print the claims of the studies with their verdicts."""
    held, found = gathered(folder), {}
    for study, collected in held.studies:
        try:
            found[study.NAME] = claims_of(study, collected.records)
        except EthogramError as error:
            say(readable(f"{error} It is left out."))
    if as_json:
        plain = {
            "claims": {name: [finite(asdict(claim)) for claim in found[name]] for name in found},
            "records": held_in(held),
            "damaged": held.damages,
        }
        print(json.dumps(plain, indent=2, allow_nan=False))
    else:
        for name, verdicts in found.items():
            print(name)
            for claim in verdicts:
                print(claim_lines(claim))
    return FAILED if held.damages or len(found) < len(held.studies) else DONE


@app.command
def compare(
    dir_a: FolderA,
    dir_b: FolderB,
    /,
    *,
    out: CompareOut = None,
    show: Show = True,
    as_json: AsJson = False,
) -> int:
    """Set two runs side by side: settings that differ, claims and, on a page, the tables.

    With --json the page is written as well, but not opened.
    """
    from ethogram.report import write_comparison

    found, damages = comparison_of(dir_a, dir_b)
    page = out or dir_b / "compare.html"
    write_comparison(page, found)
    if as_json:
        plain = {**plain_comparison(found, page), "damaged": damages}
        print(json.dumps(plain, indent=2, allow_nan=False))
    else:
        show_comparison(found)
        print(page)
        if show:
            webbrowser.open(page.resolve().as_uri())
    return FAILED if damages else DONE


@app.command
def digest(folder: Folder, /) -> int:
    """Print one hash over all stored data, the same wherever and whenever it was computed."""
    from ethogram.campaign import results

    try:
        print(results.digest(folder))
    except results.DamagedRecords as damage:
        say(str(damage))
        return FAILED
    return DONE


@app.command
def doctor(*, as_json: AsJson = False) -> int:
    """Say what Ethogram finds here: versions, devices, memory, kernels and optional packages."""
    from ethogram.cli.doctor import diagnosis, lines

    found = diagnosis()
    print(json.dumps(asdict(found), indent=2) if as_json else "\n".join(lines(found)))
    return DONE


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
    from ethogram.campaign.files import StorageError
    from ethogram.studies import STUDIES

    compute = engine_named(engine)
    chosen, troubles = [], []
    for name in STUDIES:
        try:
            chosen.append(_chosen(name, plan))
        except EthogramError as error:
            troubles.append(error)
    if not chosen and troubles:
        raise troubles[0]
    summaries = []
    for study, study_plan in chosen:
        try:
            summaries.append(
                _carried_out(
                    study,
                    study_plan,
                    out,
                    engine=compute,
                    workers=workers,
                    retry_failed=retry_failed,
                )
            )
        except StorageError:
            raise
        except EthogramError as error:
            troubles.append(error)
    code = max(_conclude(summaries, out), report(out))
    for trouble in troubles:
        say(readable(f"Left out: {trouble}"))
    return max(code, FAILED) if troubles else code


def _chosen(
    study_name: str, plan_name: str, changes: Sequence[str] = ()
) -> "tuple[Study, Plan[Any]]":
    """The study and its plan that a user names."""
    from ethogram.studies import STUDIES

    study = STUDIES[study_name]
    if plan_name not in study.PLANS:
        raise UnknownName(f"{study_name} plan", plan_name, study.PLANS)
    return study, study.PLANS[plan_name].override(changes)


def _carried_out(
    study: "Study", plan: "Plan[Any]", out: Path, *, engine: "Engine", **options: Any
) -> "Summary":
    from ethogram.campaign.display import Display
    from ethogram.campaign.launch import launch
    from ethogram.physics import native

    native.variant()  # what cannot be had is refused here, not by every case
    try:
        with Display(Console(stderr=True)) as display:
            return launch(study, plan, out, engine=engine, monitor=display, **options)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(_CONTINUES) from None


def _conclude(summaries: "Sequence[Summary]", out: Path) -> int:
    """Say how runs ended; returns the exit code."""
    planned = sum(summary.planned for summary in summaries)
    stored = sum(summary.stored for summary in summaries)
    tell(f"{stored} of {planned} cases are stored in {out}.")
    failures = [failure for summary in summaries for failure in summary.failures]
    if not failures:
        return DONE
    say(f"{len(failures)} failed; --retry-failed tries them again:")
    for name, error in failures:
        say(readable(f"  {name}: {error}"))
    return FAILED
