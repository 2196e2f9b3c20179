"""Packages to start from: a study with a world and a learner of its own, or one of these two.

They are the files in `templates`, a package called `grazing`, under another name.
"""

import importlib.util
import keyword
import os
import re
import sys
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Literal, get_args

from ethogram.core.errors import EthogramError, shown

Kind = Literal["study", "world", "learner"]
PARTS: tuple[str, ...] = get_args(Kind)
TEMPLATES = Path(__file__).parent / "templates"
TEMPLATE_NAME = "grazing"  # the package that the templates are of
_NAME = re.compile("[A-Za-z]([A-Za-z0-9_]*[A-Za-z0-9])?")  # of a package, also where it is shared
_SECTION = re.compile(r"^(?=\[|## )", re.MULTILINE)  # of TOML and of Markdown


def write_package(kind: Kind, folder: Path) -> None:
    """Write a package into a folder that is new or empty, whose last part is the package's name.

    It stands there whole, or nothing does.

    Args:
        kind: what it adds to Ethogram; a study comes with a world and a learner.
        folder: where.

    Raises:
        EthogramError: the name is none for a package, or is taken; the folder holds something, or
            cannot be written.

    """
    folder = Path(os.path.abspath(folder))  # noqa: PTH100 - a link at its end is not followed
    _require_free_name(kind, folder.name)
    try:
        _require_free_folder(folder)
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as beside:
            made = Path(beside) / folder.name
            for path, text in package_files(kind, folder.name):
                (made / path).parent.mkdir(parents=True, exist_ok=True)
                (made / path).write_text(text, encoding="utf-8")
            made.rename(folder)
    except OSError as error:
        raise EthogramError(f"Cannot write {folder}: {error.strerror}.") from error


def package_files(kind: Kind, name: str) -> Iterator[tuple[str, str]]:
    """The files of a package: path and text."""
    without = () if kind == "study" else tuple(part for part in PARTS if part != kind)
    for file in sorted(TEMPLATES.rglob("*")):
        part = file.stem.removeprefix("test_")
        if not file.is_file() or "__pycache__" in file.parts or part in without:
            continue
        sections = _SECTION.split(file.read_text(encoding="utf-8"))
        kept = [each for each in sections if not _is_about(each.partition("\n")[0], without)]
        path = file.relative_to(TEMPLATES).as_posix()
        yield path.replace(TEMPLATE_NAME, name), "".join(kept).replace(TEMPLATE_NAME, name)


def _is_about(heading: str, parts: tuple[str, ...]) -> bool:
    stems = [part.removesuffix("y") for part in parts]  # also of "studies"
    return heading.startswith(("[", "## ")) and any(stem in heading for stem in stems)


def _require_free_name(kind: Kind, name: str) -> None:
    """Refuse a name that no package can have, or that something else has.

    Raises:
        EthogramError: it is no identifier, a keyword, that of a module that can be imported, or
            one that is registered.

    """
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        raise EthogramError(
            f"{shown(name)} is no name for a package; allowed: letters, digits and underscores, "
            "the first a letter and the last no underscore, and no keyword of Python."
        )
    for part in PARTS if kind == "study" else (kind,):
        taken = _names(part)
        if name in taken:
            raise EthogramError(
                f"There is a {part} called {name!r} already; choose another name for the folder. "
                f"Taken: {', '.join(taken)}."
            )
    if _can_be_imported(name):
        raise EthogramError(
            f"There is a module called {name!r} already; choose another name for the folder."
        )


def _can_be_imported(name: str) -> bool:
    """Whether there is a module of that name; a folder that is no package is none."""
    if name in sys.modules:
        return True
    found = importlib.util.find_spec(name)
    return found is not None and found.origin is not None


def _names(part: str) -> tuple[str, ...]:
    """The names of the studies, worlds or learners there are; none of them is imported."""
    from ethogram.learners import LEARNERS
    from ethogram.studies import STUDIES
    from ethogram.worlds import WORLDS

    registries: dict[str, Iterable[str]] = {"study": STUDIES, "world": WORLDS, "learner": LEARNERS}
    return tuple(registries[part])


def _require_free_folder(folder: Path) -> None:
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise EthogramError(f"{folder} is no folder; allowed: one that is new or empty.")
    if folder.is_dir() and any(folder.iterdir()):
        raise EthogramError(f"{folder} is not empty; allowed: a folder that is new or empty.")
    if folder.is_dir() and folder.samefile(Path.cwd()):
        raise EthogramError(f"{folder} is the current folder; name one in it or beside it.")
