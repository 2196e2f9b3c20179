"""Output that is closed, full or narrow; messages; what a call from Python leaves behind."""

import errno
import io
import logging
import os
import signal
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import pytest
from tests.campaign import toy
from tests.cli.conftest import RUN

from ethogram.campaign.case import Cost
from ethogram.cli import main
from ethogram.cli.streams import Tolerant, readable
from ethogram.core.errors import InvalidSettings

READERS = [("list",), ("digest", "results"), ("claims", "results"), (*RUN, "--dry-run")]


class Full(io.StringIO):
    """A stream on a disk without room."""

    def write(self, text):
        del text
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.fixture(params=["full", "closed", "closed by Python"])
def broken(request):
    """A stream that takes nothing."""
    if request.param == "closed":
        return None
    stream = Full()
    if request.param != "full":
        stream.close()
    return stream


@pytest.mark.usefixtures("results")
@pytest.mark.parametrize("command", READERS)
def test_output_that_cannot_be_given_out_is_said_and_gives_exit_code_2(
    command, broken, monkeypatch, capsys
):
    monkeypatch.setattr(sys, "stdout", broken)
    assert main(command) == 2
    said = capsys.readouterr().err
    assert said.startswith("ethogram: Cannot print the output: ")
    assert said.count("\n") == 1


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_no_run_ends_for_what_it_cannot_print(stream, broken, monkeypatch):
    monkeypatch.setattr(sys, stream, broken)
    assert main(RUN) == 0
    assert len(list(Path("results/toy/manifests").iterdir())) == 3
    assert main(["report", "results"]) == 0


def test_an_error_that_cannot_be_said_is_an_exit_code(broken, monkeypatch):
    monkeypatch.setattr(sys, "stderr", broken)
    assert main(["digest", "nowhere"]) == 2


def test_what_a_stream_has_no_letters_for_becomes_question_marks():
    data = io.BytesIO()
    stream = Tolerant(io.TextIOWrapper(data, encoding="ascii"))
    print("a é b", file=stream, flush=True)
    assert data.getvalue() == b"a ? b\n"
    assert stream.trouble == ""


@pytest.mark.usefixtures("results")
@pytest.mark.parametrize(
    ("output", "code", "says"), [("pipe", 0, ""), ("/dev/full", 2, "No space")]
)
def test_a_program_whose_output_goes_nowhere_ends_without_a_complaint_of_python(output, code, says):
    """Nobody reads the pipe: a reader that has seen enough is no error."""
    reader, pipe = os.pipe()
    os.close(reader)
    file = pipe if output == "pipe" else os.open(output, os.O_WRONLY)
    command = [sys.executable, "-m", "ethogram", "digest", "results"]
    done = subprocess.run(command, stdout=file, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == code
    assert says in done.stderr
    assert done.stderr.count("\n") == (1 if says else 0)


def test_what_libraries_log_reaches_nobody(ethogram, results, monkeypatch):
    def figures(records):
        del records
        library.warning("the folder for my cache is not writable")
        return []

    library = logging.getLogger("a library")
    monkeypatch.setattr(library, "propagate", False)  # to what pytest listens with
    monkeypatch.setattr(toy, "figures", figures)
    code, _, said = ethogram("report", results)
    assert (code, "cache" in said) == (0, False)


@pytest.mark.parametrize("command", [("list",), ("nonsense",), RUN, ("--help",), ("--version",)])
def test_a_call_from_python_returns_a_code_and_leaves_everything_as_it_was(command, ethogram):
    def state():
        numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM)
        handlers = [signal.getsignal(number) for number in numbers]
        streams = sys.stdout, sys.stderr, logging.lastResort, sys.unraisablehook
        return dict(os.environ), handlers, streams

    before = state()
    assert isinstance(ethogram(*command)[0], int)
    assert state() == before


def test_commands_work_in_any_thread():
    codes = []
    thread = threading.Thread(target=lambda: codes.append(main(RUN)))
    thread.start()
    thread.join()
    assert codes == [0]


@pytest.mark.parametrize(
    ("name", "code", "sentence"),
    [("SIGINT", 130, "Interrupted."), ("SIGTERM", 143, "Terminated."), ("SIGHUP", 129, "Ended")],
)
def test_a_signal_ends_a_run_with_one_sentence(name, code, sentence, ethogram, monkeypatch):
    mishaps = Path("mishaps").absolute()
    mishaps.mkdir()
    (mishaps / f"b.{name}").touch()
    monkeypatch.setenv("TOY_MISHAPS", str(mishaps))
    ended, _, said = ethogram(*RUN)
    last = said.splitlines()[-1]
    assert ended == code
    assert last.startswith(sentence)
    assert last.endswith("the same command continues from there.")
    assert "Traceback" not in said


LONG = "x" * 5000
DEEP = "/".join(["x" * 100] * 45)


@pytest.mark.parametrize("path", [LONG, DEEP])
@pytest.mark.parametrize(
    "command",
    [
        [*RUN, "--out", "{}"],
        [*RUN, "--dry-run", "--out", "{}"],
        ["reproduce", "--plan", "smoke", "--out", "{}"],
        ["report", "{}"],
        ["claims", "{}"],
        ["digest", "{}"],
        ["replay", "{}", "toy", "a"],
        ["replay", "results", "toy", "a", "--out", "{}"],
        ["compare", "{}", "results"],
        ["compare", "results", "{}"],
        ["compare", "results", "results", "--out", "{}"],
    ],
)
def test_a_path_that_cannot_be_is_one_message(command, path, ethogram):
    code, out, said = ethogram(*(word.format(path) for word in command))
    assert (code, out, said.count("\n")) == (2, "", 1)
    assert "File name too long" in said
    assert len(said) < 300


@pytest.mark.usefixtures("results")
@pytest.mark.parametrize("word", [LONG, "x y " * 1250])
@pytest.mark.parametrize(
    "command",
    [
        ["{}"],
        ["run", "{}"],
        ["run", "toy", "--plan", "{}"],
        [*RUN, "--engine", "{}"],
        [*RUN, "--workers", "{}"],
        [*RUN, "--{}"],
        [*RUN, "--set", "{}=1"],
        [*RUN, "--set", "walk.steps={}"],
        ["replay", "results", "{}", "a"],
        ["replay", "results", "toy", "{}"],
        ["replay", "results", "toy", "a", "--format", "{}"],
    ],
)
def test_endless_words_are_cut_in_messages(command, word, ethogram):
    code, _, said = ethogram(*(part.format(word) for part in command))
    assert code == 2
    assert len(said) < 1000


def test_escapes_in_a_message_are_shown_and_not_obeyed():
    assert readable("Unknown \x1b[2J\udcff word\n") == "Unknown \\x1b[2J\\udcff word\n"


def test_only_commands_that_store_promise_that_what_is_stored_is_intact(ethogram, results):
    Path("blocked").write_text("in the way")
    for command in (["compare", results, results], ["replay", results, "toy", "a"]):
        code, _, said = ethogram(*map(str, command), "--no-show", "--out", "blocked/page.html")
        assert code == 2
        assert "intact" not in said


def test_on_a_narrow_terminal_the_cases_of_a_dry_run_keep_their_names(ethogram, monkeypatch):
    """In the words that the table has, at any width."""
    cases = toy.cases(toy.PLANS["smoke"])
    named = [replace(case, name=f"{case.name}-{'x' * 30}") for case in cases]
    monkeypatch.setattr(toy, "cases", lambda plan: named)
    monkeypatch.setenv("COLUMNS", "20")
    _, narrow, _ = ethogram(*RUN, "--dry-run")
    assert [line.split(":")[0] for line in narrow.splitlines()[:3]] == [case.name for case in named]
    monkeypatch.setenv("COLUMNS", "200")
    _, wide, _ = ethogram(*RUN, "--dry-run")
    lines = narrow.replace(":", "").replace(",", "").splitlines()[:3]
    assert [line.split() for line in lines] == [line.split() for line in wide.splitlines()[1:4]]


def test_a_setting_that_a_world_refuses_is_named_as_the_user_typed_it(ethogram, monkeypatch):
    def cost(case):
        if case.settings["seed"] + case.settings["chunks"] > 9:
            raise InvalidSettings("Meadow: size = 11988: Input should be less than 10")
        return Cost(seconds=1.0, bytes=1)

    monkeypatch.setattr(toy, "cost", cost)
    _, _, said = ethogram(*RUN, "--set", "letter=a", "seed=5", "label=x", "chunks=5")
    assert said == (
        "ethogram: seed=5 chunks=5: Meadow: size = 11988: Input should be less than 10\n"
    )


def test_a_report_says_whose_figures_it_draws(results, monkeypatch):
    screen, seen = io.StringIO(), []
    figures = toy.figures

    def watched(records):
        seen.append(screen.getvalue().splitlines()[-1])
        return figures(records)

    monkeypatch.setattr(toy, "figures", watched)
    monkeypatch.setattr(sys, "stderr", screen)
    assert main(["report", str(results)]) == 0
    assert main(["reproduce", "--plan", "smoke", "--engine", "inline"]) == 0
    assert seen == ["toy: drawing the page (1 of 1)."] * 2


@pytest.mark.usefixtures("results")
@pytest.mark.parametrize("out", ["", ".", "/"])
@pytest.mark.parametrize(
    "command", [("replay", "results", "toy", "a"), ("compare", "results", "results")]
)
def test_a_folder_where_a_file_is_to_be_written_is_one_message(command, out, ethogram):
    code, _, said = ethogram(*command, "--no-show", "--out", out)
    assert code == 2
    assert "It is a folder; name a file." in said
