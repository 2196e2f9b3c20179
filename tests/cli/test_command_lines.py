"""Whatever is typed ends in an exit code that is documented, and in no traceback."""

import random
import shutil
from pathlib import Path

import pytest

from ethogram.cli import main

COMMANDS = [
    "list",
    "run",
    "report",
    "replay",
    "claims",
    "compare",
    "digest",
    "reproduce",
    "new",
    "doctor",
]
NUMBERS = ["0", "1", "2", "-1", "1.5", "1e999", "NaN", "9" * 400, "٣", "0x10", "", "two"]
ODD = [
    *(
        "",
        " ",
        "-",
        "--",
        "---",
        "\n",
        "\t",
        "*",
        "~",
        "%s",
        "{}",
        "\x00",
        "\x1b[2J",
        "\udcff",
        "é🦜",
    ),
    *("x" * 300, "x" * 5000, "a b " * 900, "[" * 5000, "'", '"', "\\", "=", "==", "a=b=c", "null"),
]
PATHS = [
    *("results", "results/", "./results", "broken", "empty", "file", "file/below", "nowhere", "."),
    *("..", "/dev/null", "/proc/self", "results/toy", "loop", "/".join(["x" * 99] * 50)),
]
STUDIES = ["toy", "Toy", "toi", "sharing", "../toy", "toy/"]
KINDS = ["study", "world", "learner", "plan", "Study"]
CASES = ["a", "b", "c", "d", "A"]
PLANS = ["smoke", "single", "smok", "thesis", "SMOKE"]
KEYS = [
    "letter",
    "walk.steps",
    "walk.stride",
    "walk",
    "detour.steps",
    "pauses",
    "label",
    "seed",
    "x",
]
VALUES = ["a", "a,b", '["c"]', "[]", "{}", "null", "true", "1,2", '{"steps": 3}', *NUMBERS, *ODD]
OPTIONS = {  # the values that each is tried with; none for a flag
    "--plan": PLANS,
    "--out": [*PATHS, "page.html", "page.gif", "file.html", "results/page.html"],
    "--engine": ["inline", "inlin", "ray"],  # those of the pool take a process each
    "--workers": NUMBERS,
    "--set": [],  # see `_changes`
    "--format": ["html", "gif", "webp", "mp3"],
    "--trial": NUMBERS,
    "--json": None,
    "--show": None,
    "--no-show": None,
    "--retry-failed": None,
    "--force": None,
    "--dry-run": None,
    "--help": None,
    "--version": None,
}
TAKEN = {  # arguments, and the options that a command knows
    "list": ([], []),
    "run": ([STUDIES], ["--plan", "--out", "--set", "--workers", "--retry-failed", "--force"]),
    "report": ([PATHS], []),
    "replay": ([PATHS, STUDIES, CASES], ["--out", "--format", "--trial", "--show"]),
    "claims": ([PATHS], ["--json"]),
    "compare": ([PATHS, PATHS], ["--out", "--json", "--no-show"]),
    "digest": ([PATHS], []),
    "reproduce": ([], ["--plan", "--out", "--workers", "--retry-failed"]),
    "doctor": ([], ["--json"]),
    "new": ([KINDS, ["meadow", *PATHS]], []),
}


def _changes(dice):
    return [f"{dice.choice(KEYS)}={dice.choice(VALUES)}" for _ in range(dice.randint(0, 3))]


def _option(dice, name):
    values = OPTIONS[name]
    if name == "--set":
        return [name, *_changes(dice)]
    return [name] if values is None else [name, dice.choice(values)]


def command_line(dice):
    """A line that is right in most of its words: those that are wrong throughout end too soon."""
    command = dice.choice(COMMANDS)
    arguments, options = TAKEN[command]
    # the first of a list is right
    words = [choices[0] if dice.random() < 0.6 else dice.choice(choices) for choices in arguments]
    for name in dice.sample(options, dice.randint(0, min(3, len(options)))):
        words += _option(dice, name)
    if command in ("run", "reproduce"):
        words += ["--engine", "inline"]
    if command == "run" and dice.random() < 0.7:
        words += ["--dry-run"]
    for _ in range(dice.choice([0, 0, 0, 1, 2])):
        words.insert(dice.randint(0, len(words)), dice.choice(ODD))
    for _ in range(dice.choice([0, 0, 1])):
        words += _option(dice, dice.choice(list(OPTIONS)))
    if words and dice.random() < 0.1:
        words.pop(dice.randrange(len(words)))
    return [dice.choice([command] * 9 + [command[:-1]]), *words]


@pytest.fixture
def folders(results, tmp_path, monkeypatch):
    """Results, whole and broken, and what may stand where a folder is expected."""
    inner = tmp_path / "inner"  # so that ".." is ours, too
    inner.mkdir()
    results.rename(inner / "results")
    monkeypatch.chdir(inner)
    results = Path("results")
    shutil.copytree(results, "broken")
    next(Path("broken/toy/arrays").iterdir()).write_bytes(b"nonsense")
    Path("empty").mkdir()
    for file in ("file", "file.html"):
        Path(file).write_text("in the way")
    Path("loop").symlink_to("loop")


@pytest.mark.usefixtures("folders")
@pytest.mark.parametrize(
    "command", [("replay", "results", "toy", "a"), ("compare", "results", "results")]
)
def test_a_file_of_a_users_own_is_not_replaced_by_a_page(command, ethogram):
    for name in ("file", "file.html"):
        code, _, _ = ethogram(*command, "--no-show", "--out", name)
        assert (code, Path(name).read_text()) == (2, "in the way")


@pytest.mark.usefixtures("folders")
@pytest.mark.parametrize(
    "lines", [300, pytest.param(5000, marks=pytest.mark.slow)], ids=["some", "many"]
)
def test_whatever_is_typed_gives_an_exit_code_and_one_answer(lines, monkeypatch, capsys):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setenv("COLUMNS", "60")
    before = set(Path("results").rglob("manifests/*"))
    dice, codes = random.Random(lines), []
    for number in range(lines):
        line = command_line(dice)
        codes.append(main(line))
        out, said = capsys.readouterr()
        assert codes[-1] in (0, 1, 2), (number, line)
        assert "Traceback" not in out + said, (number, line)
        assert (codes[-1] == 0) or said, (number, line)
        assert len(said) < 3000, (number, line)
    assert {0, 2} <= set(codes)
    assert codes.count(0) > lines / 10
    assert before <= set(Path("results").rglob("manifests/*"))
    assert Path("file").read_text() == Path("file.html").read_text() == "in the way"
