"""The wheel, as another machine would get it, and a package that adds to it."""

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import ethogram
from ethogram.cli import main
from ethogram.learners import LEARNERS
from ethogram.worlds import WORLDS

ROOT = Path(__file__).parents[1]


def run(*command: object, path: tuple[Path, ...] = (), cwd: Path = ROOT) -> str:
    """What a command prints; the test fails with all of it unless the command succeeds."""
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(map(str, path)),
        "ETHOGRAM_BUILD_KERNEL": "none",  # tests/test_kernel_build.py has wheels with kernels
    }
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
        if path.is_file() and not {"__pycache__", "_native"} & set(path.parts)
    } | {"ethogram/physics/_native/build.json"}
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


USE = """\
import sys
import pytest
from ethogram.cli import main
for words in ("list", "run commons --plan smoke --out results --engine inline", "report results",
              "claims results --json"):
    assert main(words.split()) == 0, words
sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", sys.argv[1]]))
"""


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `ethogram new` writes for a study."""
    folder = tmp_path_factory.mktemp("new") / "commons"
    assert main(["new", "study", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def plugin(package: Path) -> Path:
    """The folder into which a wheel of it was installed."""
    folder = package.with_name("plugin")
    build = ("hatchling", "build", "--target", "wheel", "--directory", package.parent)
    run(sys.executable, "-m", *build, cwd=package)
    (wheel,) = package.parent.glob("*.whl")
    options = ("--no-deps", "--no-index", "--target", folder)
    run(sys.executable, "-m", "pip", "install", *options, wheel)
    return folder


def test_world_learner_and_study_of_a_new_package_are_120_lines_at_most(package: Path):
    files = sorted((package / "src").rglob("*.py"))
    assert [file.stem for file in files] == ["__init__", "learner", "study", "world"]
    assert sum(len(file.read_text().splitlines()) for file in files) <= 120


def test_a_new_package_is_listed_run_reported_and_passes_its_tests(
    package: Path, plugin: Path, site: Path, tmp_path: Path
):
    said = run(sys.executable, "-c", USE, package / "tests", path=(site, plugin), cwd=tmp_path)
    assert "commons: A shared pasture. Do herders" in said
    assert re.search("^worlds: .*commons", said, re.MULTILINE)
    assert re.search("^learners: .*commons", said, re.MULTILINE)
    assert said.count('"verdict": "undecided"') == 2  # the plan is too short
    assert said.count("trained for 20 of the 300 updates that the claim speaks of") == 2
    page = (tmp_path / "results" / "index.html").read_text()
    assert "A shared pasture" in page
    text = (tmp_path / "results" / "report" / "commons.md").read_text()
    assert "Learning curves" in text
    assert "After training" in text
    assert (tmp_path / "results" / "report" / "commons" / "figure-1.svg").is_file()


def test_another_package_registers_a_world_and_a_learner(
    plugin: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.syspath_prepend(str(plugin))
    assert {"sharing", "commons"} <= set(WORLDS)
    assert {"qlearning", "commons"} <= set(LEARNERS)
    assert WORLDS["commons"].__name__ == "Pasture"
    assert LEARNERS["commons"].__name__ == "PolicyGradient"
