"""A plan: the settings of a study, the axes along which they vary, and how a user changes both."""

import json
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Generic, TypeVar

from ethogram.campaign.trees import (
    Complaints,
    Tree,
    assign,
    canonical,
    checked,
    flatten,
    nearest,
    report,
    shown,
    to_tree,
)
from ethogram.core.errors import InvalidSettings

S = TypeVar("S")
Scalar = str | int | float | bool | None
Grid = Mapping[str, tuple[Scalar, ...]]  # dotted key -> the values along that axis

_MOST_BRACKETS = 100  # in a value: past any setting, well before Python's limit of nesting


@dataclass(frozen=True)
class Plan(Generic[S]):
    """One way to run a study: `settings` everywhere, except where an axis of the grid says else."""

    name: str
    description: str
    settings: S  # a frozen pydantic dataclass, possibly nested
    grid: Grid = field(default_factory=dict)
    overrides: tuple[str, ...] = ()  # what a user changed, as typed

    def points(self) -> list[S]:
        """The settings of every combination of the axes, the last axis varying fastest."""
        complaints: Complaints = {}
        points = _points(type(self.settings), to_tree(self.settings), self.grid, complaints)
        if complaints:
            raise InvalidSettings(report(complaints))
        return points

    def override(self, assignments: Iterable[str]) -> "Plan[S]":
        """Change the plan by "key=value" assignments, of which the last wins.

        A value is read as JSON, and as a bare word where it is none.  An axis of the grid takes
        one value, a list with commas or a JSON list.  Raises `InvalidSettings` with everything
        that is wrong, so that a user corrects it in one go.
        """
        assignments = tuple(assignments)
        complaints: Complaints = {}
        texts = _texts(assignments, complaints)
        tree, grid = to_tree(self.settings), dict(self.grid)
        known = dict(flatten(tree))
        for key, text in texts.items():
            if key in grid and _values(text):
                grid[key] = _values(text)
            elif key in grid:
                complaints[key] = [f"{key}: An axis needs at least one value."]
            elif isinstance(known.get(key), list):
                assign(tree, key, list(_values(text)))
            elif key in known or _in_optional_part(key, known):
                assign(tree, key, _value(text))
            else:
                complaints[key] = [_unknown(key, known, grid)]
        points = _points(type(self.settings), tree, grid, complaints)
        _explain_lists(texts, grid, complaints)
        if complaints:
            raise InvalidSettings(report(complaints))
        overrides = self.overrides + assignments
        return replace(self, settings=points[0], grid=grid, overrides=overrides)


def _points(kind: type[S], tree: Tree, grid: Grid, complaints: Complaints) -> list[S]:
    """Every different combination once; what is wrong with any of them becomes a complaint."""
    points: dict[bytes, S] = {}
    for combination in product(*grid.values()):
        point_tree = deepcopy(tree)
        for key, value in zip(grid, combination, strict=True):
            assign(point_tree, key, value)
        point = checked(kind, point_tree, complaints)
        if point is not None:
            points.setdefault(canonical(to_tree(point)), point)
    return list(points.values())


def _texts(assignments: Iterable[str], complaints: Complaints) -> dict[str, str]:
    """The text after each key, the last one where a key comes twice."""
    texts = {}
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        if not _is_text(assignment):
            complaints[assignment] = [f"{shown(assignment)}: Not a text in UTF-8."]
        elif not (key and equals):
            complaints[assignment] = [f"{shown(assignment)}: Expected key=value."]
        else:
            texts[key] = text
    return texts


def _values(text: str) -> tuple[Scalar, ...]:
    """What stands for several values: a JSON list, else words between commas."""
    whole = _value(text)
    if isinstance(whole, list):
        return tuple(whole)
    if isinstance(whole, str):
        return tuple(_value(word) for word in text.split(","))
    return (whole,)


def _value(text: str) -> Any:
    """A value as JSON, or the bare word where it is none (or none that can be stored)."""
    if text.count("[") + text.count("{") > _MOST_BRACKETS:
        return text
    try:
        value = json.loads(text)
        json.dumps(value, allow_nan=False, ensure_ascii=False).encode()
    except ValueError:
        return text
    return value


def _is_text(word: str) -> bool:
    """Whether a word of the command line is Unicode; other bytes arrive as lone surrogates."""
    try:
        word.encode()
    except UnicodeEncodeError:
        return False
    return True


def _in_optional_part(key: str, known: Mapping[str, Any]) -> bool:
    part = key.rpartition(".")[0]
    return part in known and known[part] is None


def _unknown(key: str, known: Mapping[str, Any], grid: Grid) -> str:
    names = list(dict.fromkeys([*known, *grid]))
    members = [name for name in names if name.startswith(f"{key}.")]
    if members:
        return f"{key} is a group of settings: {', '.join(members)}."
    return f"Unknown key {shown(key)}.{nearest(key, names)} Allowed: {', '.join(names)}."


def _explain_lists(texts: Mapping[str, str], grid: Grid, complaints: Complaints) -> None:
    """Where a setting was given a list that it cannot take, say what takes lists."""
    for key in complaints.keys() & texts.keys() - grid.keys():
        if "," in texts[key] or "[" in texts[key]:
            axes = ", ".join(grid) or "there is none"
            complaints[key].append(f"{key}: Only an axis of the plan takes a list ({axes}).")
