"""What the tests of the command line share."""

import shutil
from pathlib import Path

import pytest
from tests.campaign.processes import run_toy

from ethogram.core.registry import Registry
from ethogram.studies import trouble_with

RUN = ("run", "toy", "--plan", "smoke", "--engine", "inline")


@pytest.fixture(autouse=True)
def alone_with_the_toy(monkeypatch, tmp_path):
    """The toy is the only study of ours, and the current folder is empty."""
    ours = {"toy": "tests.campaign.toy"}
    studies = Registry("study", "ethogram.studies", ours, trouble_with)
    monkeypatch.setattr("ethogram.studies.STUDIES", studies)
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="session")
def toy_results(tmp_path_factory):
    """A folder with a run of the toy, not to be changed."""
    folder = tmp_path_factory.mktemp("toy")
    run_toy(folder)
    return folder


@pytest.fixture
def results(toy_results):
    """A copy of it in the current folder."""
    shutil.copytree(toy_results, "results")
    return Path("results")
