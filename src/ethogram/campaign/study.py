"""What a study is to those who run it and show it.  A module that has these names is one.

It may have one more, `INTRODUCTION`: what its page opens with (`introduction_of`).
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

from ethogram.campaign.arrays import Record
from ethogram.campaign.case import Case, Cost
from ethogram.campaign.context import Context
from ethogram.campaign.plan import Plan
from ethogram.campaign.provenance import module_of, package_of
from ethogram.core.errors import EthogramError, place_of
from ethogram.core.findings import Claim, Figure, Table
from ethogram.core.introduction import Introduction

Records = Mapping[str, Record]  # by the case's name, in the plan's order; missing ones are absent


class Study(Protocol):
    """A question, the runs that answer it, and how the answer is shown."""

    @property
    def NAME(self) -> str:  # noqa: N802 - constants of a module
        """Its name on the command line and its folder in the results."""

    @property
    def VERSION(self) -> str:  # noqa: N802
        """Raised when the code gives other numbers for the same settings."""

    @property
    def TITLE(self) -> str:  # noqa: N802
        """The heading of its page."""

    @property
    def QUESTION(self) -> str:  # noqa: N802
        """What it asks, in a sentence or two."""

    @property
    def PLANS(self) -> Mapping[str, Plan[Any]]:  # noqa: N802
        """By name: "smoke", "quick", "thesis" and maybe more."""

    def cases(self, plan: Plan[Any], /) -> Sequence[Case]:
        """The conditions of a plan, each with a name of its own."""

    def cost(self, case: Case, /) -> Cost:
        """What a case is expected to take."""

    def run(self, case: Case, context: Context, /) -> Record:
        """Compute a case.  Nothing else in a study spends compute."""

    def tables(self, records: Records, /) -> Sequence[Table]:
        """Its tables, measured beside published where there is something published."""

    def figures(self, records: Records, /) -> Sequence[Figure]:
        """Its figures."""

    def claims(self, records: Records, /) -> Sequence[Claim]:
        """Its claims, all of them, with their verdicts."""


@contextmanager
def blamed(study: Study, doing: str) -> Iterator[None]:
    """Turn a defect of a study into an `EthogramError` that names study, package, file and line."""
    try:
        yield
    except EthogramError:
        raise
    except Exception as error:
        origin = package_of(study)
        package = f" of the package {origin!r}" if origin else ""
        raise EthogramError(
            f"The study {study.NAME!r}{package} broke in its {doing}: {type(error).__name__}: "
            f"{error} ({place_of(error, module_of(study))})."
        ) from error


def introduction_of(study: Study) -> Introduction:
    """What a study's page opens with; nothing where the study has no such name."""
    found: Introduction = getattr(study, "INTRODUCTION", Introduction())
    return found
