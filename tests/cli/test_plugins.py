"""Studies of other packages: one that is broken is named, and the rest goes on."""

import json
import sys
from pathlib import Path

import pytest
from tests.campaign import toy
from tests.cli.conftest import RUN

from ethogram.campaign.launch import survey
from ethogram.campaign.results import collect, stores
from ethogram.cli import main

WHOLE = "from tests.campaign.toy import *\nfrom tests.campaign import toy\nNAME = 'grazing'\n"
RENAMED = """\
import dataclasses
def cases(plan):
    return [dataclasses.replace(case, study=NAME) for case in toy.cases(plan)]
"""
BROKEN = {  # what is wrong with a package -> its text, and what is said of it
    "import": (f"{WHOLE}import nothing_of_this_name\n", "grazing/study.py:4"),
    "error": (f"{WHOLE}\n1 / 0\n", "ZeroDivisionError: division by zero (grazing/study.py:5)"),
    "base": (f"{WHOLE}raise BaseException('boo')\n", "BaseException: boo (grazing/study.py:4)"),
    "attribute": (
        f"{WHOLE}del TITLE\ndef __getattr__(name):\n    raise RuntimeError(name)\n",
        "RuntimeError: ",
    ),
    "name": ("from tests.campaign.toy import *\n", "its NAME is 'toy'"),
    "title": (f"{WHOLE}del TITLE\n", "it lacks TITLE"),
    "several": (f"{WHOLE}del run, cost\n", "it lacks cost, run"),
    "function": (f"{WHOLE}claims = None\n", "it lacks the functions claims"),
    "text": (f"{WHOLE}VERSION = 1\n", "its VERSION is no text but 1"),
    "plans": (f"{WHOLE}PLANS = {{'smoke': 3}}\n", "its PLANS are no plans by name"),
}


@pytest.fixture
def plugin(tmp_path, monkeypatch):
    """Installs a package `grazing` whose study has this text and that version."""
    site = tmp_path / "site"
    monkeypatch.syspath_prepend(str(site))

    def forget():
        for module in [name for name in sys.modules if name.partition(".")[0] == "grazing"]:
            del sys.modules[module]

    def install(text, version="1.0"):
        forget()
        info = site / "grazing.dist-info"
        for folder in (info, site / "grazing"):
            folder.mkdir(parents=True, exist_ok=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: grazing\nVersion: {version}")
        (info / "entry_points.txt").write_text("[ethogram.studies]\ngrazing = grazing.study\n")
        (site / "grazing" / "__init__.py").touch()
        (site / "grazing" / "study.py").write_text(text)

    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # two texts may be as long and as old
    yield install
    forget()


def test_entry_points_that_cannot_be_read_are_named_and_all_others_are_listed(
    plugin, ethogram, tmp_path
):
    plugin(WHOLE)
    info = tmp_path / "site" / "thicket.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: thicket\nVersion: 1.0")
    (info / "entry_points.txt").write_text("garbage [[[\nno equals\n[ethogram.studies]\nfoo\n")
    code, out, said = ethogram("list")
    assert code == 1
    assert "grazing: " in out
    assert "toy: " in out
    assert "The entry points of 'thicket' cannot be read" in said


@pytest.mark.parametrize(("text", "said_of_it"), BROKEN.values(), ids=BROKEN)
def test_a_broken_plugin_is_named_and_the_rest_is_listed(text, said_of_it, plugin, ethogram):
    plugin(text)
    code, out, said = ethogram("list")
    assert code == 1
    assert "toy: A toy" in out
    assert "worlds: " in out
    for part in ("'grazing'", "'grazing 1.0'", "study.py:", said_of_it):
        assert part in said
    assert "Traceback" not in said


def test_a_broken_plugin_keeps_no_other_study_from_being_reproduced(plugin, ethogram):
    plugin(BROKEN["error"][0])
    code, out, said = ethogram("reproduce", "--plan", "smoke", "--engine", "inline")
    assert code == 1
    assert out.splitlines() == ["3 of 3 cases are stored in results.", "results/index.html"]
    assert "'grazing 1.0'" in said
    assert ethogram("run", "grazing", "--plan", "smoke")[0] == 2


@pytest.mark.parametrize("part", ["cases", "cost"])
def test_a_plugin_that_breaks_while_it_is_planned_leaves_the_others_to_be_run(
    part, plugin, ethogram
):
    plugin(f"{WHOLE}{RENAMED}def {part}(_):\n    return 1 / 0\n")
    code, out, said = ethogram("reproduce", "--plan", "smoke", "--engine", "inline")
    assert (code, out.splitlines()[0]) == (1, "3 of 3 cases are stored in results.")
    assert f"the package 'grazing 1.0' broke in its {part}: ZeroDivisionError" in said
    assert "(grazing/study.py:8)" in said or "(grazing/study.py:7)" in said


@pytest.mark.parametrize("part", ["tables", "figures", "claims"])
def test_a_plugin_that_breaks_while_it_is_shown_is_left_out_of_the_report(part, plugin, ethogram):
    plugin(f"{WHOLE}{RENAMED}def {part}(records):\n    return records['no such case']\n")
    for name in ("toy", "grazing"):
        assert ethogram("run", name, *RUN[2:])[0] == 0
    code, _, said = ethogram("report", "results")
    assert code == 1
    assert "A toy" in Path("results/index.html").read_text()
    assert f"'grazing' of the package 'grazing 1.0' broke in its {part}: KeyError" in said
    assert "(grazing/study.py:8)" in said
    assert "Traceback" not in said
    code, out, _ = ethogram("claims", "results", "--json")
    left = ["toy"] if part == "claims" else ["grazing", "toy"]
    assert (code, list(json.loads(out)["claims"])) == (2 - len(left), left)


def test_results_of_a_plugin_that_is_broken_now_are_left_out_with_a_word(plugin, ethogram):
    plugin(WHOLE + RENAMED)
    for name in ("toy", "grazing"):
        assert ethogram("run", name, *RUN[2:])[0] == 0
    plugin(BROKEN["import"][0])
    code, out, said = ethogram("claims", "results")
    assert (code, out.splitlines()[0]) == (1, "toy")
    assert "(grazing/study.py:4). The study is left out." in said
    assert ethogram("report", "results")[0] == 1


def test_a_record_names_the_package_and_version_of_its_study_and_is_of_that_version(
    plugin, ethogram
):
    plugin(WHOLE + RENAMED)
    assert ethogram("run", "grazing", *RUN[2:])[0] == 0
    collected = collect(stores(Path("results"))["grazing"])
    assert {manifest.case.package for manifest in collected.manifests} == {"grazing 1.0"}
    assert collected.versions["grazing"] == "1.0"
    assert ethogram("report", "results")[0] == 0
    page = Path("results/report/grazing.md").read_text().splitlines()
    assert any("grazing" in line and "1.0" in line for line in page)
    plugin(WHOLE + RENAMED, version="1.1")
    _, _, said = ethogram("run", "grazing", *RUN[2:])
    assert "computing 3 of 3 cases" in said


def test_the_identity_of_a_case_of_ours_has_no_package(tmp_path):
    """It is that of the records that are published."""
    (first, *_) = survey(toy, toy.PLANS["smoke"], tmp_path)
    assert first.case.package == ""
    assert first.case.id == "a9188dcfa853e6d1819246525fb8b76e8df8092e58aa36692bb409d93686bad0"


def test_force_computes_what_is_stored_anew(ethogram):
    assert main(RUN) == 0
    _, _, said = ethogram(*RUN, "--force")
    assert "computing 3 of 3 cases" in said
    _, out, _ = ethogram(*RUN, "--force", "--dry-run")
    assert "3 of 3 cases to do" in out
