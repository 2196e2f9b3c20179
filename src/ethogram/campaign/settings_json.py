"""Settings as trees of plain JSON: the form in which they are overridden, hashed and stored.

A tree is read back through JSON, in which pydantic is strict about numbers and words and still
knows that a list stands for a tuple.
"""

import difflib
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar, cast

from pydantic import TypeAdapter, ValidationError

from ethogram.core.errors import InvalidSettings, shown

S = TypeVar("S")
Tree = dict[str, Any]  # what json.loads gives for an object
Complaints = dict[str, list[str]]  # what is wrong, by dotted key


def canonical(value: Any) -> bytes:
    """The one way to write a value as JSON, so that equal values have equal hashes."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return text.encode("ascii")


def to_json(settings: Any) -> Tree:
    """A settings object as plain JSON, with every default written out."""
    return cast(Tree, TypeAdapter(type(settings)).dump_python(settings, mode="json"))


def from_json(kind: type[S], tree: Mapping[str, Any]) -> S:
    """The settings object that a tree describes, or `InvalidSettings` with all that is wrong."""
    complaints: Complaints = {}
    settings = checked(kind, tree, complaints)
    if settings is None:
        raise InvalidSettings(report(complaints))
    return settings


def checked(kind: type[S], tree: Mapping[str, Any], complaints: Complaints) -> S | None:
    """The settings that a tree describes; where it describes none, complaints are added."""
    try:
        settings = TypeAdapter(kind).validate_json(canonical(tree))
    except ValidationError as error:
        for found in error.errors(include_url=False):
            key, value = _place(found["loc"], tree)
            complaints.setdefault(key, []).append(_explained(key, value, cast(Tree, found)))
        return None
    endless = [key for key, leaf in flatten(to_json(settings)) if _endless(leaf)]
    for key in endless:
        complaints.setdefault(key, []).append(f"{key}: Input should be a finite number.")
    return None if endless else settings


def flatten(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The leaves of a tree by dotted key, in the order in which they were declared."""
    for name, value in tree.items():
        if isinstance(value, dict) and value:
            yield from flatten(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def assign(tree: Tree, key: str, value: Any) -> None:
    """Put a value in its dotted place; an optional part that was left out is begun."""
    *parts, name = key.split(".")
    for part in parts:
        if not isinstance(tree.get(part), dict):
            tree[part] = {}
        tree = tree[part]
    tree[name] = value


def report(complaints: Complaints) -> str:
    """One message for all complaints, one line each."""
    lines = list(dict.fromkeys(line for lines in complaints.values() for line in lines))
    if len(lines) == 1:
        return f"Invalid setting: {lines[0]}"
    return "Invalid settings:" + "".join(f"\n  {line}" for line in lines)


def nearest(name: str, choices: Iterable[str]) -> str:
    """A question after the choice that a user most likely meant, or nothing.

    A dotted key is first looked for by its last part: "agents" is "world.agents".
    """
    everything = list(choices)
    last = name.rpartition(".")[2]
    by_last = {choice.rpartition(".")[2]: choice for choice in reversed(everything)}
    close = difflib.get_close_matches(name, everything, n=1, cutoff=0.5)
    close_last = difflib.get_close_matches(last, by_last, n=1, cutoff=0.6)
    if last in by_last:
        best = by_last[last]
    elif close:
        best = close[0]
    elif close_last:
        best = by_last[close_last[0]]
    else:
        return ""
    return f" Did you mean {best!r}?"


def _place(location: tuple[int | str, ...], tree: Any) -> tuple[str, Any]:
    """Dotted key and value of an error's place, without the parts that name a union's member."""
    parts = []
    for part in location:
        try:
            tree = tree[part]
        except (KeyError, IndexError, TypeError):
            continue
        parts.append(str(part))
    return ".".join(parts) or "settings", tree


def _explained(key: str, value: Any, found: Tree) -> str:
    reason = str(found["msg"]).removeprefix("Value error, ")
    choices = re.findall(r"'([^']*)'", str(found.get("ctx", {}).get("expected", "")))
    return f"{key} = {shown(value)}: {reason}.{nearest(str(value), choices)}"


def _endless(leaf: Any) -> bool:
    return isinstance(leaf, float) and not math.isfinite(leaf)
