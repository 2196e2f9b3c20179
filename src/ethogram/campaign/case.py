"""The unit of work: one condition of a study with all its settings, and what it may cost."""

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any, TypeVar

from ethogram.campaign.settings_json import canonical, from_json, to_json

S = TypeVar("S")


@dataclass(frozen=True)
class Case:
    """A condition that one process computes in minutes, with its trials side by side.

    Its identity is everything that its numbers depend on; nothing else may influence them.
    """

    study: str
    version: str  # of the study: raised when its code gives other numbers
    name: str  # unique within a plan
    settings: Mapping[str, Any] = field(hash=False)  # plain JSON, every default written out
    package: str = ""  # with its version, where the study is another package's: "grazing 1.0"

    @classmethod
    def of(cls, *, study: str, version: str, name: str, settings: Any) -> "Case":
        """The case of a settings object, a pydantic dataclass."""
        return cls(study, version, name, to_json(settings))

    def parsed(self, kind: type[S]) -> S:
        """The settings as an object again."""
        return from_json(kind, self.settings)

    @cached_property
    def id(self) -> str:
        """Sha256 of study, version, name and settings: the name of the case's record.

        The package counts where there is one.
        """
        parts = asdict(self)
        if not self.package:
            del parts["package"]
        return hashlib.sha256(canonical(parts)).hexdigest()


@dataclass(frozen=True)
class Cost:
    """What a case is expected to take; only a dry run and the remaining time rest on it."""

    seconds: float  # on one core, after compilation
    bytes: int  # of memory at its peak
