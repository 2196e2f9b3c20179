"""The command `compare`: two folders of results, side by side."""

import json
import shutil
from pathlib import Path

import pytest

from ethogram.core.registry import Registry

PUBLISHED = Path(__file__).parent.parent / "docs" / "results"
RUN = ("run", "toy", "--plan", "smoke", "--engine", "inline")


@pytest.fixture(autouse=True)
def empty_folder(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def toys(monkeypatch, ethogram):
    """Runs of the toy in the folders `a` and `b`, which walk twenty steps and ten."""
    studies = Registry("study", "ethogram.studies", {"toy": "tests.campaign.toy"})
    monkeypatch.setattr("ethogram.studies.STUDIES", studies)
    ethogram(*RUN, "--out", "a")
    ethogram(*RUN, "--out", "b", "--set", "walk.steps=10")


@pytest.fixture
def records():
    """Copies of published records: `a` has two studies, `b` one of them, run otherwise."""
    for study in ("language", "sharing"):
        shutil.copytree(PUBLISHED / "records" / study, Path("a", study))
    shutil.copytree(PUBLISHED / "tuned" / "records" / "language", Path("b", "language"))


@pytest.mark.usefixtures("records")
def test_published_runs_are_set_side_by_side(ethogram, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    code, out, said = ethogram("compare", "a", "b", "--no-show")
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert (code, said) == (0, "")
    assert lines[0] == "language"
    assert "learner.updates_per_iteration 1 4" in lines
    assert not any(line.startswith("episodes") for line in lines)
    (claim,) = (line for line in lines if line.startswith("2 "))
    assert "… undecided not run -2.77 standard deviat…" in claim
    assert "*" not in claim
    assert lines[-3:] == ["0 of 7 verdicts differ.", "Only in A: sharing", "b/compare.html"]
    assert max(map(len, out.splitlines())) <= 100
    page = Path("b/compare.html").read_text()
    for part in ("Learning a language", "learner.updates_per_iteration", "Table 2.2", "only in B"):
        assert part in page
    assert "<script" not in page


@pytest.mark.usefixtures("toys")
def test_the_same_folder_twice_differs_in_nothing(ethogram):
    code, out, _ = ethogram("compare", "a", "a", "--no-show", "--out", "same/page.html")
    lines = out.splitlines()
    assert code == 0
    assert lines[:2] == ["toy", "No setting differs."]
    assert lines[-2:] == ["0 of 2 verdicts differ.", "same/page.html"]
    assert "(the same data)" in Path("same/page.html").read_text()


@pytest.mark.usefixtures("toys")
def test_json_says_the_same_in_finite_numbers_and_opens_nothing(ethogram, monkeypatch):
    monkeypatch.setattr("webbrowser.open", lambda address: pytest.fail(address))
    code, out, _ = ethogram("compare", "a", "b", "--json")
    found = json.loads(out)
    toy = found["studies"]["toy"]
    assert code == 0
    assert (found["a"], found["b"], found["page"]) == ("a", "b", "b/compare.html")
    assert toy["settings"] == [{"name": "walk.steps", "a": "20", "b": "10"}]
    assert (toy["changed"], [claim["changed"] for claim in toy["claims"]]) == (0, [False, False])
    assert toy["claims"][0]["a"]["high"] is None  # JSON has no infinity
    assert toy["claims"][0]["b"]["verdict"] == "confirmed"
    assert Path("b/compare.html").exists()


@pytest.mark.usefixtures("toys")
def test_the_page_is_opened_unless_told_otherwise_and_written_anew(ethogram, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    ethogram("compare", "a", "b", "--no-show")
    assert opened == []
    ethogram("compare", "a", "b")
    assert opened == [Path("b/compare.html").absolute().as_uri()]


@pytest.mark.usefixtures("toys")
def test_no_other_record_is_read_and_no_figure_is_drawn(ethogram, monkeypatch):
    def drawn(_):
        pytest.fail("a figure was drawn")

    monkeypatch.setattr("tests.campaign.toy.figures", drawn)
    Path("a/other").mkdir()
    Path("a/other/plan.json").write_text("nonsense")
    code, out, said = ethogram("compare", "a", "b", "--no-show")
    assert (code, said) == (0, "")
    assert "Only in A: other" in out


@pytest.mark.usefixtures("toys")
def test_folders_without_a_common_study_are_refused_with_what_they_hold(ethogram):
    shutil.move("b/toy", "b/other")
    code, out, said = ethogram("compare", "a", "b", "--no-show")
    assert (code, out) == (2, "")
    assert "no study to compare: 'a' holds toy; 'b' holds other." in said
    assert not Path("b/compare.html").exists()


@pytest.mark.usefixtures("toys")
def test_a_study_that_is_not_installed_cannot_be_compared(ethogram):
    for folder in ("a", "b"):
        shutil.move(f"{folder}/toy", f"{folder}/other")
    code, _, said = ethogram("compare", "a", "b", "--no-show")
    assert code == 2
    assert "no study of the name 'other' is installed" in said
    assert "no study to compare" in said


@pytest.mark.usefixtures("toys")
def test_a_page_that_is_not_ours_is_left_alone(ethogram):
    Path("b/compare.html").write_text("<p>mine</p>")
    code, out, said = ethogram("compare", "a", "b", "--no-show")
    assert (code, out) == (2, "")
    assert "'b/compare.html' is there and is no page of Ethogram's" in said
    assert Path("b/compare.html").read_text() == "<p>mine</p>"


@pytest.mark.usefixtures("toys")
@pytest.mark.parametrize(
    ("arguments", "part"),
    [(["a"], "DIR_B"), (["a", "c"], "'c' is no folder"), (["a/toy", "b"], "Did you mean 'a'?")],
)
def test_what_is_wrong_gets_one_clear_message(ethogram, arguments, part):
    code, out, said = ethogram("compare", *arguments, "--no-show")
    assert (code, out) == (2, "")
    assert said.startswith("ethogram: ")
    assert part in said
