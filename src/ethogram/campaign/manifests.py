"""What a store says about its records, as JSON under a seal that shows any changed byte."""

import hashlib
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypeVar, cast

from pydantic import TypeAdapter, ValidationError

from ethogram.campaign.arrays import Layout
from ethogram.campaign.case import Case
from ethogram.campaign.plan import Scalar
from ethogram.campaign.provenance import machine, versions
from ethogram.campaign.settings_json import Tree, assign, canonical
from ethogram.campaign.untrusted import Hash, Key, Line, Seconds, parsed, printable
from ethogram.core.errors import EthogramError

FORMAT = 1  # of the files below; raised when an older Ethogram could not read them

T = TypeVar("T")


class Unusable(EthogramError):
    """A file of a store is there and cannot be used; all others can."""


class Damaged(Unusable):
    """Bytes of a store are not those that were written."""

    def __init__(self, path: Path, reason: str) -> None:
        self.path = path
        super().__init__(printable(f"{path} is damaged: {reason}."))


class OtherFormat(Unusable):
    """A file of a store is of a format that this version does not know."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"{path} was written by another version of Ethogram.")


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """A record's description; its existence is what makes the record exist."""

    case: Case
    arrays: Hash  # sha256 of the array file, which is its name
    layout: Layout
    started: Line
    seconds: Seconds
    versions: Mapping[Line, Line] = field(default_factory=versions)
    machine: Line = field(default_factory=machine)
    kernels: Mapping[Line, Line] = field(default_factory=dict)  # and what did the work of each

    @property
    def identity(self) -> str:
        """A hash of the case and all its data, not of when and where it was computed."""
        return sha256(canonical([self.case.id, asdict(self)["layout"], self.arrays]))


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A case that raised an error: kept, so that a run does not try it again and again."""

    case: Case
    error: Line
    traceback: str
    started: Line
    seconds: Seconds
    versions: Mapping[Line, Line] = field(default_factory=versions)
    machine: Line = field(default_factory=machine)


@dataclass(frozen=True, kw_only=True)
class PlannedRun:
    """What was asked for last: a report shows these cases, in this order."""

    study: Line
    version: Line
    plan: Line
    description: str
    overrides: tuple[str, ...]
    settings: Mapping[str, Any]
    grid: Mapping[Key, tuple[Scalar, ...]]
    cases: tuple[tuple[Line, Hash], ...]  # name and id
    command: str
    started: Line

    @property
    def trials(self) -> int | None:
        """How many trials each case has; None where that differs, or where there are none."""
        found = self.grid.get("trials", (self.settings.get("trials"),))
        numbers = {each for each in found if isinstance(each, int)}
        return numbers.pop() if len(numbers) == 1 == len(found) else None

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
    data = _sealed({"content": asdict(content), "format": FORMAT})
    try:
        parsed(data)
    except ValueError as error:
        raise EthogramError(f"A {type(content).__name__} cannot be stored: {error}.") from error
    return data


def unseal(kind: type[T], data: bytes, path: Path) -> T:
    """What `seal` was given.

    Raises:
        Damaged: a single byte differs, or what is sealed is not what was asked for.
        OtherFormat: it is whole, and of a later format.

    """
    try:
        body = parsed(data)
        del body["seal"]
        intact = _sealed(body) == data
    except (ValueError, LookupError, TypeError):
        intact = False
    if not intact:
        raise Damaged(path, "its bytes do not match its seal")
    return _content(kind, body, path)


def _content(kind: type[T], body: Mapping[str, Any], path: Path) -> T:
    """What stands under an intact seal, which anybody can make."""
    version = body.get("format")
    if type(version) is int and version > FORMAT:
        raise OtherFormat(path)
    try:
        if version != FORMAT:
            raise ValueError(f"unknown format {version!r}")
        content = canonical(body.get("content"))
        return cast(T, _SCHEMAS[kind].validate_json(content, strict=True))
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        place = ".".join(map(str, first["loc"])) or "content"
        raise Damaged(path, printable(f"{place[:80]}: {first['msg'][:200]}")) from error
    except ValueError as error:
        raise Damaged(path, printable(str(error)[:200])) from error


def _sealed(body: Mapping[str, Any]) -> bytes:
    return canonical({**body, "seal": sha256(canonical(body))}) + b"\n"


_SCHEMAS: dict[type, TypeAdapter[Any]] = {
    kind: TypeAdapter(kind) for kind in (Manifest, Failure, PlannedRun)
}
