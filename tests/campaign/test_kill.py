"""A run may be killed at any moment: the same command goes on and ends with the same numbers."""

import errno
import os
import signal
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from tests.campaign import faults
from tests.campaign.processes import (
    REFUSED,
    ended,
    run_toy,
    start_child,
    start_command,
    toy_in_child,
)

from ethogram.campaign.files import StorageError
from ethogram.campaign.results import digest

CASES, CHUNKS = 3, 9  # of the toy's smoke plan, with a checkpoint after each chunk
EXIT_CODES = {"torn": -signal.SIGKILL, "fail": REFUSED}


def everywhere(*kinds):
    """Parameters for a fault at every single step, which takes its time."""
    return [pytest.param(kind, 1, marks=pytest.mark.slow) for kind in kinds]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Digest and number of steps of a run of the toy that nothing happens to."""
    folder = tmp_path_factory.mktemp("undisturbed")
    counter = folder / "steps"
    assert ended(start_child(toy_in_child, folder, {}, {"counter": counter})) == 0
    return digest(folder), faults.count(counter)


def strike(kind, moments, tmp_path):
    """Run the toy once for each moment, with a fault at that step; gives folder and exit code."""
    for at in moments:
        folder = tmp_path / str(at)
        fault = {"counter": tmp_path / f"{at}.steps", "at": at, "kind": kind}
        yield folder, ended(start_child(toy_in_child, folder, {"TOY_LOG": f"{folder}.log"}, fault))


def assert_recovers(folder, expected, monkeypatch):
    """A second run completes the first one's work, and nothing else is left behind."""
    monkeypatch.setenv("TOY_LOG", f"{folder}.log")
    assert run_toy(folder).stored == CASES
    assert digest(folder) == expected
    store = folder / "toy"
    assert len(list(store.glob("manifests/*.json"))) == len(list(store.glob("arrays/*"))) == CASES
    assert not list(store.rglob("*.tmp"))
    assert not list(store.glob("checkpoints/*"))
    assert not list(store.glob("damaged/*"))
    computed = Path(f"{folder}.log").read_text().split()
    assert len(computed) <= CHUNKS + 1, "more than the chunk in hand was lost"


@pytest.mark.parametrize(("kind", "every"), [("torn", 4), *everywhere("torn", "kill")])
def test_a_kill_loses_at_most_the_chunk_in_hand(kind, every, undisturbed, tmp_path, monkeypatch):
    expected, steps = undisturbed
    partial = 0
    for folder, exit_code in strike(kind, range(1, steps + 1, every), tmp_path):
        assert exit_code == -signal.SIGKILL
        partial += 0 < len(list(folder.glob("toy/manifests/*.json"))) < CASES
        assert_recovers(folder, expected, monkeypatch)
    assert partial >= 5


@pytest.mark.parametrize(("kind", "every"), [("full", 7), *everywhere("fail", "full")])
def test_a_disk_that_refuses_loses_nothing_stored(kind, every, undisturbed, tmp_path, monkeypatch):
    expected, steps = undisturbed
    for folder, exit_code in strike(kind, range(1, steps + 1, every), tmp_path):
        assert exit_code in (0, REFUSED)
        assert_recovers(folder, expected, monkeypatch)


@pytest.mark.parametrize(("step", "folder"), [("replace", "arrays"), ("link", "manifests")])
def test_a_failure_between_writing_and_moving_into_place_leaves_a_case_to_do(
    step, folder, undisturbed, tmp_path, monkeypatch
):
    def fail(source, target):
        if folder in str(target):
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        call(source, target)

    call = getattr(os, step)
    with monkeypatch.context() as patch:
        patch.setattr(os, step, fail)
        with pytest.raises(StorageError, match="Input/output error"):
            run_toy(tmp_path)
    assert not list(tmp_path.glob("toy/manifests/*.json"))
    run_toy(tmp_path)
    assert digest(tmp_path) == undisturbed[0]


@dataclass(frozen=True)
class Subject:
    """A run on the command line, to be killed at some moments from its first to its last write."""

    study: str
    arguments: tuple[str, ...]
    moments: tuple[float, ...]  # as fractions of all steps

    def start(self, folder, **environment):
        return start_command("run", self.study, *self.arguments, "--out", folder, **environment)


# one worker, so that the same step is always that of the same case
TOY = Subject("toy", ("--plan", "smoke", "--engine", "pool", "--workers", "1"), moments=(0.7, 1.0))
SHARING = Subject(
    "sharing",
    ("--plan", "smoke", "--engine", "inline", "--set", "world.scenario=mixed", "strategy=none"),
    moments=(0.4, 0.8),
)
SHARING_WHOLE = Subject("sharing", ("--plan", "smoke"), moments=tuple(np.linspace(0, 1, 20)))


@pytest.mark.parametrize(
    ("subject", "fault", "least"),
    [
        pytest.param(TOY, "torn", 1, id="toy-killed"),
        pytest.param(TOY, "fail", 0, id="toy-refused"),
        pytest.param(SHARING, "torn", 1, id="sharing-killed"),
        pytest.param(SHARING, "fail", 1, id="sharing-refused", marks=pytest.mark.slow),
        pytest.param(SHARING_WHOLE, "torn", 5, id="sharing-whole-killed", marks=pytest.mark.slow),
    ],
)
def test_a_killed_command_goes_on_to_the_same_digest(subject, fault, least, tmp_path, monkeypatch):
    """At least so many of the moments must leave a store that is neither empty nor complete."""
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "compiled"))
    monkeypatch.setenv("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
    steps = tmp_path / "steps"
    undisturbed = subject.start(tmp_path / "undisturbed", FAULT_COUNTER=str(steps))
    assert exit_code_of(undisturbed) == 0
    expected = digest(tmp_path / "undisturbed")
    planned = stored(tmp_path / "undisturbed", subject)
    partial = 0
    for moment in subject.moments:
        at = 1 + int(moment * (faults.count(steps) - 1))
        folder = tmp_path / str(at)
        wanted = {"FAULT_COUNTER": f"{folder}.steps", "FAULT_AT": str(at), "FAULT_KIND": fault}
        assert exit_code_of(subject.start(folder, **wanted)) == EXIT_CODES[fault]
        partial += 0 < stored(folder, subject) < planned
        assert exit_code_of(subject.start(folder)) == 0
        assert digest(folder) == expected
    assert partial >= least


def stored(folder, subject):
    """How many records there are."""
    return len(list(folder.glob(f"{subject.study}/manifests/*.json")))


def exit_code_of(command):
    """How a command ended; what it said is shown where a test fails."""
    out, error = command.communicate(timeout=600)
    print(out, error)
    return command.returncode
