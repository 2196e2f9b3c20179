"""The wheel, as another machine would get it, and a package that adds to it."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import ethogram
from ethogram.learners import LEARNERS
from ethogram.worlds import WORLDS

ROOT = Path(__file__).parents[1]


def run(*command: object, path: tuple[Path, ...] = (), cwd: Path = ROOT) -> str:
    """What a command prints; the test fails with all of it unless the command succeeds."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, path))}
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", folder)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def site(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder into which the wheel was installed, its dependencies being there already."""
    folder = tmp_path_factory.mktemp("site")
    options = ("--no-deps", "--no-index", "--target", folder)
    run(sys.executable, "-m", "pip", "install", *options, wheel)
    return folder


def test_the_wheel_holds_every_file_of_the_package_and_the_licence(wheel: Path):
    package = ROOT / "src" / "ethogram"
    expected = {
        path.relative_to(package.parent).as_posix()
        for path in package.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    held = set(zipfile.ZipFile(wheel).namelist())
    assert expected <= held
    assert {"ethogram/py.typed", "ethogram/report/templates/index.html"} <= held
    assert f"ethogram-{ethogram.__version__}.dist-info/licenses/LICENSE" in held
    assert {name.split("/")[0] for name in held - expected} == {
        f"ethogram-{ethogram.__version__}.dist-info"
    }


def test_the_installed_command_answers(site: Path, tmp_path: Path):
    command = site / "bin" / "ethogram"
    where = run(sys.executable, "-c", "import ethogram; print(ethogram.__file__)", path=(site,))
    assert where.startswith(str(site))
    assert "reproduce" in run(command, "--help", path=(site,), cwd=tmp_path)
    assert run(command, "--version", path=(site,), cwd=tmp_path).strip() == ethogram.__version__


STUDY = '''\
"""Is a meadow richer when fewer graze it?"""

import numpy as np
import xarray as xr
from pydantic.dataclasses import dataclass

from ethogram.campaign.case import Case, Cost
from ethogram.campaign.plan import Plan
from ethogram.core.findings import Table
from ethogram.studies.statistics import ClaimSpec, Part, Trials, difference, judge

NAME, VERSION = "overgrazing", "1"
TITLE, QUESTION = "Overgrazing", "Is a meadow richer when fewer graze it?"


@dataclass(frozen=True, kw_only=True, config={"extra": "forbid"})
class Settings:
    herders: int = 1


PLANS = {"smoke": Plan("smoke", "Two meadows.", Settings(), {"herders": (1, 9)})}


def cases(plan):
    return [
        Case.of(study=NAME, version=VERSION, name=f"{point.herders} herders", settings=point)
        for point in plan.points()
    ]


def cost(case):
    return Cost(seconds=0.1, bytes=1000)


def run(case, context):
    grass = 100.0 / case.parsed(Settings).herders + np.arange(5.0)
    return {"results": xr.Dataset({"grass": ("trial", grass)})}


def tables(records):
    means = {name: float(groups["results"]["grass"].mean()) for name, groups in records.items()}
    columns, rows = ("condition", "grass"), tuple(means.items())
    return [Table(name="table-1", title="Grass", caption="In kg.", columns=columns, rows=rows)]


def figures(records):
    return []


def claims(records):
    few, many = (
        Trials(name, records[name]["results"]["grass"].values if name in records else None)
        for name in ("1 herders", "9 herders")
    )
    part = Part(label="", terms=difference(few, many), side="more than", margin=0.0, unit="kg")
    return judge(
        [ClaimSpec(number=1, statement="Yes.", source="p. 1", test="mean", parts=(part,))]
    )
'''

ENTRY_POINTS = """\
[ethogram.worlds]
meadow = grazing.meadow:Meadow

[ethogram.learners]
herder = grazing.herder:Herder

[ethogram.studies]
overgrazing = grazing.overgrazing
"""


@pytest.fixture
def plugin(tmp_path: Path) -> Path:
    """The folder of another package, laid out as an installer would."""
    site = tmp_path / "plugin"
    files = {
        "grazing/__init__.py": "",
        "grazing/meadow.py": "class Meadow: pass",
        "grazing/herder.py": "class Herder: pass",
        "grazing/overgrazing.py": STUDY,
        "grazing-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: grazing\nVersion: 1.0\n",
        "grazing-1.0.dist-info/entry_points.txt": ENTRY_POINTS,
    }
    for name, text in files.items():
        (site / name).parent.mkdir(parents=True, exist_ok=True)
        (site / name).write_text(text)
    return site


def test_another_package_registers_a_world_and_a_learner(
    plugin: Path, monkeypatch: pytest.MonkeyPatch
):
    for module in [name for name in sys.modules if name.partition(".")[0] == "grazing"]:
        monkeypatch.delitem(sys.modules, module)  # another test's package of the same name
    monkeypatch.syspath_prepend(str(plugin))
    assert {"sharing", "meadow"} <= set(WORLDS)
    assert {"qlearning", "herder"} <= set(LEARNERS)
    assert WORLDS["meadow"].__name__ == "Meadow"
    assert LEARNERS["herder"].__name__ == "Herder"


def test_a_study_of_another_package_is_listed_run_and_reported(
    plugin: Path, site: Path, tmp_path: Path
):
    def command(*arguments: object) -> str:
        return run(site / "bin" / "ethogram", *arguments, path=(site, plugin), cwd=tmp_path)

    assert "overgrazing: Overgrazing. Is a meadow richer" in command("list")
    command("run", "overgrazing", "--plan", "smoke", "--out", "results", "--engine", "inline")
    command("report", "results")
    assert "confirmed" in command("claims", "results")
    assert "Overgrazing" in (tmp_path / "results" / "index.html").read_text()
