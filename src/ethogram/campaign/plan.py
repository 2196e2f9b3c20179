"""A plan: the settings of a study, the axes along which they vary, and how a user changes both."""

import json
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Generic, TypeVar

from ethogram.campaign.settings_json import (
    Complaints,
    Tree,
    assign,
    canonical,
    checked,
    flatten,
    nearest,
    report,
    to_json,
)
from ethogram.core.errors import InvalidSettings, shown

S = TypeVar("S")
Scalar = str | int | float | bool | None
Grid = Mapping[str, tuple[Scalar, ...]]  # dotted key -> the values along that axis

_MOST_BRACKETS = 100  # in a value: past any setting, well before Python's limit of nesting


@dataclass(frozen=True)
class Plan(Generic[S]):
    """One way to run a study: `settings` everywhere, except where an axis of a grid says else.

    A plan that is no single grid has `further` ones, each with axes of its own.
    """

    name: str
    description: str
    settings: S  # a frozen pydantic dataclass, possibly nested
    grid: Grid = field(default_factory=dict)
    further: tuple[Grid, ...] = ()
    overrides: tuple[str, ...] = ()  # what a user changed, as typed
    unchanged: "Plan[S] | None" = field(default=None, repr=False, compare=False)

    def without(self, assignment: str) -> "Plan[S]":
        """The plan as it is without one of its overrides."""
        rest = [other for other in self.overrides if other != assignment]
        return (self.unchanged or self).override(rest)

    def points(self) -> list[S]:
        """The settings of every combination of the axes, the last axis varying fastest."""
        complaints: Complaints = {}
        points = _points(type(self.settings), to_json(self.settings), self._grids, complaints)
        if complaints:
            raise InvalidSettings(report(complaints))
        return points

    @property
    def axes(self) -> Grid:
        """Every axis, with the values that it takes in any of the grids."""
        axes: dict[str, tuple[Scalar, ...]] = {}
        for grid in self._grids:
            for key, values in grid.items():
                axes[key] = tuple(dict.fromkeys((*axes.get(key, ()), *values)))
        return axes

    @property
    def _grids(self) -> tuple[Grid, ...]:
        return (self.grid, *self.further)

    def override(self, assignments: Iterable[str]) -> "Plan[S]":
        """Change the plan by "key=value" assignments, of which the last wins.

        A value is read as JSON, and as a bare word where it is none.  An axis takes one value, a
        list with commas or a JSON list, and then is an axis of every grid.  Raises
        `InvalidSettings` with everything that is wrong, so that a user corrects it in one go.
        """
        assignments = tuple(assignments)
        complaints: Complaints = {}
        texts = _texts(assignments, complaints)
        tree, grids = to_json(self.settings), [dict(grid) for grid in self._grids]
        known, axes = dict(flatten(tree)), list(self.axes)
        for key, text in texts.items():
            if key in axes and _values(text):
                for grid in grids:
                    grid[key] = _values(text)
            elif key in axes:
                complaints[key] = [f"{key}: An axis needs at least one value."]
            elif isinstance(known.get(key), list):
                assign(tree, key, list(_values(text)))
            elif key in known or _in_optional_part(key, known):
                assign(tree, key, _value(text))
            else:
                complaints[key] = [_unknown(key, known, axes)]
        settings = checked(type(self.settings), tree, complaints)
        _points(type(self.settings), tree, grids, complaints)
        _explain_lists(texts, axes, complaints)
        if settings is None or complaints:
            raise InvalidSettings(report(complaints))
        return replace(
            self,
            settings=settings,
            grid=grids[0],
            further=tuple(grids[1:]),
            overrides=self.overrides + assignments,
            unchanged=self.unchanged or self,
        )


def _points(kind: type[S], tree: Tree, grids: Iterable[Grid], complaints: Complaints) -> list[S]:
    """Every different combination once; what is wrong with any of them becomes a complaint."""
    points: dict[bytes, S] = {}
    for grid in grids:
        for combination in product(*grid.values()):
            point_tree = deepcopy(tree)
            for key, value in zip(grid, combination, strict=True):
                assign(point_tree, key, value)
            point = checked(kind, point_tree, complaints)
            if point is not None:
                points.setdefault(canonical(to_json(point)), point)
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


def _unknown(key: str, known: Mapping[str, Any], axes: Iterable[str]) -> str:
    names = list(dict.fromkeys([*known, *axes]))
    members = [name for name in names if name.startswith(f"{key}.")]
    if members:
        return f"{key} is a group of settings: {', '.join(members)}."
    return f"Unknown key {shown(key)}.{nearest(key, names)} Allowed: {', '.join(names)}."


def _explain_lists(texts: Mapping[str, str], axes: list[str], complaints: Complaints) -> None:
    """Where a setting was given a list that it cannot take, say what takes lists."""
    for key in complaints.keys() & texts.keys() - set(axes):
        if "," in texts[key] or "[" in texts[key]:
            named = ", ".join(axes) or "there is none"
            complaints[key].append(f"{key}: Only an axis of the plan takes a list ({named}).")
