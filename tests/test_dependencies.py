"""Every smoke plan runs with the oldest and the newest dependencies that are allowed.

Each in an environment of its own, under each Python that is found; others are skipped by name.
"""

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


@pytest.mark.slow
@pytest.mark.parametrize("resolution", ["lowest-direct", "highest"])
@pytest.mark.parametrize("version", PYTHONS)
def test_every_smoke_plan_runs_with(version, resolution, tmp_path):
    python = python_of(version)
    if python is None:
        pytest.skip(f"there is no Python {version} here")
    environment = tmp_path / "environment"
    programs = environment / "bin"
    install = [UV, "pip", "install", "--python", programs / "python", "--resolution", resolution]
    for command in (
        [UV, "venv", "--python", python, environment],
        [*install, ROOT],
        [programs / "ethogram", "reproduce", "--plan", "smoke", "--out", "results"],
    ):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    assert (tmp_path / "results" / "index.html").is_file()
