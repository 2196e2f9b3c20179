"""Every smoke plan runs with the oldest and the newest dependencies that are allowed.

One wheel, with kernels, is installed into environments under each Python that is found; others are
skipped by name.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
UV = Path(sys.executable).with_name("uv")
PYTHONS = ("3.11", "3.12", "3.13")


def python_of(version):
    """The interpreter of that version on the path, or None."""
    for folder in os.get_exec_path():
        candidate = Path(folder) / f"python{version}"
        if candidate.is_file():
            found = subprocess.run(
                [candidate, "-c", "import sys; print(sys.version)"], capture_output=True, text=True
            )
            if found.stdout.startswith(f"{version}."):
                return candidate
    return None


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dist")
    subprocess.run([UV, "build", "--quiet", "--wheel", "--out-dir", folder, ROOT], check=True)
    (built,) = folder.glob("*.whl")
    return built


@pytest.mark.slow
@pytest.mark.parametrize("resolution", ["lowest-direct", "highest"])
@pytest.mark.parametrize("version", PYTHONS)
def test_every_smoke_plan_runs_with(version, resolution, wheel, tmp_path):
    python = python_of(version)
    if python is None:
        pytest.skip(f"there is no Python {version} here")
    environment = tmp_path / "environment"
    programs = environment / "bin"
    install = [UV, "pip", "install", "--python", programs / "python", "--resolution", resolution]
    for command in (
        [UV, "venv", "--python", python, environment],
        [*install, wheel],
        [programs / "ethogram", "reproduce", "--plan", "smoke", "--out", "results"],
        [programs / "ethogram", "doctor", "--json"],
    ):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "Traceback" not in done.stderr
    assert json.loads(done.stdout)["kernels"]["in_use"] is not None
    assert (tmp_path / "results" / "index.html").is_file()
