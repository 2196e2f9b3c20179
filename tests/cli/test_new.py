"""Packages to start from, which `ethogram new` writes."""

import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import ethogram as library
from ethogram.cli.new import PARTS, package_files

ENTRY_POINTS = {
    "world": ("ethogram.worlds", "meadow.world:Pasture"),
    "learner": ("ethogram.learners", "meadow.learner:PolicyGradient"),
    "study": ("ethogram.studies", "meadow.study"),
}


def written(folder):
    return {
        path.relative_to(folder).as_posix() for path in Path(folder).rglob("*") if path.is_file()
    }


@pytest.mark.parametrize("kind", PARTS)
def test_a_package_has_the_files_and_entry_points_of_its_parts_and_nothing_of_others(
    kind, ethogram
):
    code, out, _ = ethogram("new", kind, "meadow")
    assert (code, out) == (0, "meadow\n")
    parts = PARTS if kind == "study" else (kind,)
    assert written("meadow") == {
        *("README.md", "pyproject.toml", "src/meadow/__init__.py"),
        *(f"src/meadow/{part}.py" for part in parts),
        *(f"tests/test_{part}.py" for part in parts),
    }
    project = tomllib.loads(Path("meadow/pyproject.toml").read_text())["project"]
    expected = {group: {"meadow": value} for group, value in map(ENTRY_POINTS.get, parts)}
    assert (project["name"], project["entry-points"]) == ("meadow", expected)
    (requirement,) = map(Requirement, project["dependencies"])
    assert requirement.specifier.contains(library.__version__)
    readme = Path("meadow/README.md").read_text()
    assert [part for part in PARTS if f"## The {part}" in readme] == [
        part for part in ("study", "world", "learner") if part in parts
    ]


def test_no_name_of_the_template_is_left_in_a_package():
    files = dict(package_files("study", "meadow"))
    assert not [path for path, text in files.items() if "grazing" in path + text]
    for path, text in files.items():
        if path.endswith(".py"):
            compile(text, path, "exec")


@pytest.mark.parametrize(
    ("folder", "said_of_it"),
    [
        ("class", "'class' is no name for a package; allowed: letters, digits and underscores"),
        ("a-b", "'a-b' is no name for a package"),
        ("2go", "'2go' is no name for a package"),
        ("sub/prärie", "no name for a package"),
        ("toy", "There is a study called 'toy' already"),
        ("publishing", "There is a world called 'publishing' already"),
        ("qlearning", "There is a learner called 'qlearning' already"),
        ("json", "There is a module called 'json' already"),
        ("full", "is not empty; allowed: a folder that is new or empty"),
        ("file", "is no folder; allowed: one that is new or empty"),
        ("link", "is no folder; allowed: one that is new or empty"),
        ("file/meadow", "Cannot write"),
    ],
)
def test_what_cannot_be_a_package_is_refused_and_nothing_is_written(folder, said_of_it, ethogram):
    Path("full").mkdir()
    Path("full/note").touch()
    Path("file").touch()
    Path("link").symlink_to("full")
    before = written(".")
    code, _, said = ethogram("new", "study", folder)
    assert code == 2
    assert said_of_it in said
    assert "Traceback" not in said
    assert written(".") == before


def test_an_empty_folder_is_written_into_unless_one_stands_in_it(ethogram, monkeypatch):
    Path("meadow").mkdir()
    assert ethogram("new", "world", "meadow")[0] == 0
    assert "src/meadow/world.py" in written("meadow")
    Path("pond").mkdir()
    monkeypatch.chdir("pond")
    code, _, said = ethogram("new", "world", ".")
    assert (code, written(".")) == (2, set())
    assert "is the current folder" in said


def test_a_package_that_cannot_be_written_whole_leaves_nothing(ethogram, monkeypatch):
    files = list(package_files("world", "meadow"))

    def broken(_kind, _name):
        yield files[0]
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("ethogram.cli.new.package_files", broken)
    code, _, said = ethogram("new", "world", "meadow")
    assert (code, list(Path().iterdir())) == (2, [])
    assert "No space left on device" in said
