"""The command line: what it prints, its exit codes, and one clear message for what is wrong."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ethogram.core import memory
from ethogram.core.registry import Registry

RUN = ("run", "toy", "--plan", "smoke", "--engine", "inline")


@pytest.fixture(autouse=True)
def alone_with_the_toy(monkeypatch, tmp_path):
    """The toy is the only study and the current folder is empty."""
    studies = Registry("study", "ethogram.studies", {"toy": "tests.campaign.toy"})
    monkeypatch.setattr("ethogram.studies.STUDIES", studies)
    monkeypatch.chdir(tmp_path)


def test_help_loads_nothing_slow_and_the_program_nothing_before_it_listens_to_signals():
    script = (
        "import sys; import ethogram.__main__; print({'cyclopts', 'rich'} & set(sys.modules));"
        "from ethogram.cli import main; main(['--help']); main(['run', '--help']);"
        "print({'jax', 'xarray', 'matplotlib', 'numpy', 'pydantic', 'ctypes'} & set(sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert "reproduce" in done.stdout
    assert (done.stdout.splitlines()[0], done.stdout.splitlines()[-1]) == ("set()", "set()")


def test_list_names_studies_plans_worlds_and_learners(ethogram):
    code, out, _ = ethogram("list")
    assert code == 0
    for part in ("toy: A toy", "--plan smoke: Three walks.", "worlds: ", "learners: "):
        assert part in out


def test_a_run_says_what_it_does_in_plain_lines(ethogram):
    code, out, said = ethogram(*RUN)
    assert code == 0
    assert out == "3 of 3 cases are stored in results.\n"
    assert said.splitlines()[0] == "toy: computing 3 of 3 cases, 1 at a time."
    assert said.splitlines()[-1] == "3/3 c: stored (100%)"
    assert "\x1b" not in said


def test_a_run_continues_from_what_is_there(ethogram):
    ethogram(*RUN, "--set", "letter=b")
    _, _, said = ethogram(*RUN)
    assert "computing 2 of 3 cases" in said
    _, _, said = ethogram(*RUN)
    assert said == "toy: computing 0 of 3 cases.\n"


def test_settings_are_taken_in_one_go_or_one_by_one(ethogram):
    code, out, _ = ethogram(*RUN, "--set", "letter=a,b", "chunks=1", "--set", "seed=3")
    assert (code, out) == (0, "2 of 2 cases are stored in results.\n")
    planned = json.loads(Path("results/toy/plan.json").read_text())["content"]
    assert planned["overrides"] == ["letter=a,b", "chunks=1", "seed=3"]


def test_a_kernel_that_cannot_be_had_is_refused_before_any_case_fails_of_it(ethogram, monkeypatch):
    monkeypatch.setenv("ETHOGRAM_KERNEL", "fastest")
    code, out, said = ethogram(*RUN)
    assert (code, out) == (2, "")
    assert "kernel (ETHOGRAM_KERNEL) 'fastest'" in said
    assert not Path("results").exists()


def test_a_dry_run_lists_cases_time_and_memory_and_writes_nothing(ethogram):
    code, out, _ = ethogram(*RUN, "--dry-run", "--set", "letter=a,b")
    assert code == 0
    assert [line.split()[:3] for line in out.splitlines()[1:3]] == [
        ["a", "to", "do"],
        ["b", "to", "do"],
    ]
    assert "1 kB" in out
    assert out.splitlines()[-1].startswith("2 of 2 cases to do, ")
    assert not Path("results").exists()


def test_a_dry_run_knows_what_is_there(ethogram):
    ethogram(*RUN, "--set", "letter=b")
    _, out, _ = ethogram(*RUN, "--dry-run")
    assert [line.split()[1] for line in out.splitlines()[1:4]] == ["to", "stored", "to"]


def test_a_failure_is_listed_and_gives_exit_code_1(ethogram, monkeypatch):
    mishaps = Path("mishaps")
    mishaps.mkdir()
    (mishaps / "b.raise").touch()
    monkeypatch.setenv("TOY_MISHAPS", str(mishaps.absolute()))
    code, out, said = ethogram(*RUN)
    assert (code, out) == (1, "2 of 3 cases are stored in results.\n")
    assert "b: ValueError: a toy broke" in said
    assert "Traceback" not in said
    code, _, said = ethogram(*RUN)
    assert code == 1
    assert "--retry-failed" in said
    assert ethogram(*RUN, "--retry-failed")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["rum", "toy"], ['Did you mean "run"?']),
        (["run"], ["STUDY"]),
        (["run", "toi"], ["study 'toi'", "Did you mean 'toy'?"]),
        (["run", "toy", "--plan", "smok"], ["Did you mean 'smoke'?", "single, smoke"]),
        (["run", "toy", "--pln", "smoke"], ["--pln", "--plan"]),
        (["run", "toy", "--engine", "pol"], ["'pol'", "Did you mean 'pool'?"]),
        ([*RUN, "--workers", "0"], ["--workers", "1"]),
        ([*RUN, "--workers", "two"], ["--workers", "two"]),
        ([*RUN, "--set", "steps=3"], ["Did you mean 'walk.steps'?"]),
        ([*RUN, "--set", "walk.style=strait"], ["strait", "Did you mean 'straight'?"]),
        ([*RUN, "--set", "walk.steps=0", "label"], ["walk.steps = 0", "'label'", "key=value"]),
        (["report", "resluts"], ["'resluts' is no folder", "Did you mean 'results'?"]),
        (["digest", "results/toy"], ["holds no results", "Did you mean 'results'?"]),
        (["claims", "."], ["holds no results"]),
        (["reproduce", "--plan", "thesis"], ["Unknown toy plan", "'thesis'"]),
    ],
)
def test_what_is_wrong_gets_one_clear_message_and_exit_code_2(ethogram, arguments, parts):
    ethogram(*RUN, "--set", "letter=a", "chunks=1")
    code, out, said = ethogram(*arguments)
    assert (code, out) == (2, "")
    assert said.startswith("ethogram: ")
    for part in parts:
        assert part in said


def test_a_lost_plan_hides_no_record_and_is_made_again_by_a_run(ethogram):
    ethogram(*RUN)
    before = ethogram("digest", "results")[1]
    Path("results/toy/plan.json").unlink()
    assert ethogram("digest", "results")[1] == before
    code, _, said = ethogram("claims", "results")
    assert code == 2
    assert "Run the plan again" in said
    assert "`ethogram run toy --plan smoke --out results` finds 3 of its 3 cases" in said
    ethogram(*RUN)
    assert ethogram("claims", "results")[0] == 0


def test_results_of_a_study_that_is_not_installed_are_left_out_with_a_word(ethogram):
    ethogram(*RUN)
    shutil.copytree("results/toy", "results/other")
    code, out, said = ethogram("claims", "results")
    assert (code, out.splitlines()[0]) == (0, "toy")
    assert "no study of the name 'other'" in said


def test_a_dry_run_says_what_does_not_fit_in_memory(ethogram, monkeypatch):
    monkeypatch.setattr(memory, "available_memory", lambda: 0)
    code, _, said = ethogram(*RUN, "--dry-run")
    assert code == 0
    assert "they would fail" in said


@pytest.mark.parametrize("out", ["file", "file/below"])
def test_a_folder_that_cannot_be_is_named(ethogram, out):
    Path("file").write_text("in the way")
    code, _, said = ethogram(*RUN, "--out", out)
    assert code == 2
    assert "is a file, not a folder" in said
    assert Path("file").read_text() == "in the way"


def test_the_digest_is_one_line_and_the_same_anywhere(ethogram):
    ethogram(*RUN, "--out", "one")
    ethogram(*RUN, "--out", "two")
    code, one, _ = ethogram("digest", "one")
    assert code == 0
    assert len(one.split()) == 1
    assert one == ethogram("digest", "two")[1]


READERS = {
    "digest": ("digest", "results"),
    "claims": ("claims", "results"),
    "claims --json": ("claims", "results", "--json"),
    "report": ("report", "results"),
    "compare": ("compare", "results", "results", "--no-show"),
    "replay": ("replay", "results", "toy", "a", "--no-show"),
}


@pytest.mark.parametrize("reader", READERS)
def test_every_reader_names_a_damaged_record_and_ends_with_exit_code_1(ethogram, reader):
    ethogram(*RUN)
    case_id = dict(json.loads(Path("results/toy/plan.json").read_bytes())["content"]["cases"])["a"]
    manifest = json.loads(Path(f"results/toy/manifests/{case_id}.json").read_bytes())
    path = Path(f"results/toy/arrays/{manifest['content']['arrays']}.npz")
    assert ethogram(*READERS[reader])[0] != 1
    path.write_bytes(b"nonsense")
    code, out, said = ethogram(*READERS[reader])
    assert code == 1
    assert path.name in said
    assert out == "" or reader not in ("digest", "replay")
    ethogram(*RUN)
    assert ethogram(*READERS[reader])[0] != 1


def test_claims_as_json_say_what_is_stored_failed_missing_and_damaged(ethogram, monkeypatch):
    Path("mishaps").mkdir()
    Path("mishaps/b.raise").touch()
    monkeypatch.setenv("TOY_MISHAPS", str(Path("mishaps").absolute()))
    ethogram(*RUN, "--set", "letter=a,b,c,d")
    cases = dict(json.loads(Path("results/toy/plan.json").read_bytes())["content"]["cases"])
    Path(f"results/toy/manifests/{cases['c']}.json").write_bytes(b"nonsense")
    Path(f"results/toy/manifests/{cases['d']}.json").unlink()
    code, out, _ = ethogram("claims", "results", "--json")
    found = json.loads(out)
    held = {"planned": 4, "stored": 1, "failed": ["b"], "missing": ["d"], "damaged": ["c"]}
    assert (code, found["records"]) == (1, {"toy": held})
    assert cases["c"] in found["damaged"][0]
    assert [claim["verdict"] for claim in found["claims"]["toy"]] == ["confirmed", "not run"]


def test_a_report_goes_where_it_is_wanted(ethogram):
    ethogram(*RUN)
    code, out, _ = ethogram("report", "results", "--out", "elsewhere")
    assert (code, out) == (0, "elsewhere/index.html\n")
    assert Path("elsewhere/report/toy.html").exists()
    assert [path.name for path in Path("results").iterdir()] == ["toy"]


def test_claims_come_as_text_and_as_json(ethogram):
    ethogram(*RUN)
    code, text, _ = ethogram("claims", "results")
    assert code == 0
    assert "1. confirmed  Walks end somewhere." in text
    assert "2. not run    Walks return." in text
    _, out, _ = ethogram("claims", "results", "--json")
    first, second = json.loads(out)["claims"]["toy"]
    assert first["verdict"] == "confirmed"
    assert first["low"] == -1.0
    assert first["high"] is None  # JSON has no infinity
    assert second["effect"] is None


def test_reproduce_runs_every_study_and_writes_the_report(ethogram):
    code, out, _ = ethogram("reproduce", "--plan", "smoke", "--out", "r", "--engine", "inline")
    assert code == 0
    assert out.splitlines()[-1] == "r/index.html"
    page = Path("r/report/toy.html").read_text()
    for part in ("A toy", "Three walks.", "Walks end somewhere.", "ethogram run toy --plan smoke"):
        assert part in page


def test_results_of_another_version_of_a_study_are_not_shown(ethogram, monkeypatch):
    ethogram(*RUN)
    monkeypatch.setattr("tests.campaign.toy.VERSION", "2")
    code, _, said = ethogram("report", "results")
    assert code == 2
    assert "version 1 of the study 'toy'; this is version 2" in said
