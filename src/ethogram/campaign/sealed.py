"""What a store says about its records, as JSON under a seal that shows any changed byte."""

import hashlib
import json
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter

from ethogram.campaign.arrays import Layout
from ethogram.campaign.case import Case
from ethogram.campaign.provenance import machine, versions
from ethogram.campaign.trees import Tree, assign, canonical
from ethogram.core.errors import EthogramError

FORMAT = 1  # of the files below; raised when an older Ethogram could not read them

T = TypeVar("T")


class Damaged(EthogramError):
    """Bytes of a store are not those that were written."""

    def __init__(self, path: Path, reason: str) -> None:
        self.path = path
        super().__init__(f"{path} is damaged: {reason}.")


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """A record's description; its existence is what makes the record exist."""

    case: Case
    arrays: str  # sha256 of the array file, which is its name
    layout: Layout
    started: str
    seconds: float
    versions: Mapping[str, str] = field(default_factory=versions)
    machine: str = field(default_factory=machine)

    @property
    def identity(self) -> str:
        """A hash of the case and all its data, not of when and where it was computed."""
        return sha256(canonical([self.case.id, self.layout, self.arrays]))


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A case that raised an error: kept, so that a run does not try it again and again."""

    case: Case
    error: str  # one line
    traceback: str
    started: str
    seconds: float
    versions: Mapping[str, str] = field(default_factory=versions)
    machine: str = field(default_factory=machine)


@dataclass(frozen=True, kw_only=True)
class PlannedRun:
    """What was asked for last: a report shows these cases, in this order."""

    study: str
    version: str
    plan: str
    description: str
    overrides: tuple[str, ...]
    settings: Mapping[str, Any]
    grid: Mapping[str, tuple[Any, ...]]
    cases: tuple[tuple[str, str], ...]  # name and id
    command: str
    started: str

    @property
    def trials(self) -> int | None:
        """How many trials each case has; None where that differs, or where there are none."""
        found = {*self.grid.get("trials", (self.settings.get("trials"),))}
        return found.pop() if len(found) == 1 else None

    @property
    def varied_settings(self) -> Tree:
        """The settings, with all the values along an axis where one stands for them."""
        settings = deepcopy(dict(self.settings))
        for key, values in self.grid.items():
            assign(settings, key, list(values))
        return settings


def sha256(data: bytes) -> str:
    """The hash that names and seals everything in a store."""
    return hashlib.sha256(data).hexdigest()


def seal(content: Any) -> bytes:
    """One of the dataclasses above as JSON, in the only form that `unseal` takes."""
    return _sealed({"content": asdict(content), "format": FORMAT})


def unseal(kind: type[T], data: bytes, path: Path) -> T:
    """What `seal` was given; raises `Damaged` when a single byte differs."""
    try:
        body = json.loads(data)
        del body["seal"]
        intact = _sealed(body) == data
    except (ValueError, LookupError, TypeError, RecursionError):
        intact = False
    if not intact:
        raise Damaged(path, "its bytes do not match its seal")
    if body["format"] != FORMAT:
        raise EthogramError(f"{path} was written by another version of Ethogram.")
    return TypeAdapter(kind).validate_python(body["content"])


def _sealed(body: Mapping[str, Any]) -> bytes:
    return canonical({**body, "seal": sha256(canonical(body))}) + b"\n"
