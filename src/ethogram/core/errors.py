"""What a user can get wrong or a machine can refuse, as errors with one clear message.

The command line prints the message of an `EthogramError` and exits with code 2; any other
exception is a defect of Ethogram and keeps its traceback.
"""

import difflib
import operator
import sys
import traceback
from collections.abc import Iterable
from pathlib import Path
from typing import Any

LONGEST = 80  # characters of a user's word that a message repeats


class EthogramError(Exception):
    """Names the thing, the value and what is allowed, in one message for a person."""


class UnknownName(EthogramError):
    """A name that is not among the allowed ones; the message offers the nearest."""

    def __init__(self, what: str, name: str, allowed: Iterable[str]) -> None:
        choices = sorted(allowed)
        near = difflib.get_close_matches(name[:LONGEST], choices, n=1, cutoff=0.5)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        listing = ", ".join(choices) if choices else "none"
        super().__init__(f"Unknown {what} {shown(name)}.{hint} Allowed: {listing}.")


class InvalidSettings(EthogramError):
    """Settings out of range or of the wrong type, each named with its dotted path."""


class TooLarge(EthogramError):
    """What was asked for would not fit in memory; the message names the size needed."""


def require_count(what: str, name: str, count: Any, least: int = 0) -> None:
    """Refuse what is no whole number, or too small a one.

    Raises:
        EthogramError: naming who asks for it, the count and what is allowed.

    """
    try:
        enough = operator.index(count) >= least
    except TypeError:
        enough = False
    if not enough:
        raise EthogramError(
            f"{what}: {name} = {shown(count)}; allowed: a whole number, {least} or more."
        )


def shown(value: object) -> str:
    """A user's value as a message repeats it: printable and not endless."""
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def place_of(error: BaseException, module: str) -> str:
    """Where code went wrong, as "file:line": the last place in a module's package, else the last.

    A file of the package is named from the package on, any other in full.
    """
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}:{error.lineno}"
    frames = [
        frame
        for frame in reversed(traceback.extract_tb(error.__traceback__))
        if not frame.filename.startswith("<frozen ")
    ]
    package = sys.modules.get(module.partition(".")[0])
    roots = [*getattr(package, "__path__", ()), getattr(package, "__file__", None) or ""]
    for frame in frames:
        file = Path(frame.filename)
        for root in map(Path, filter(None, roots)):
            if file.is_relative_to(root):
                return f"{file.relative_to(root.parent).as_posix()}:{frame.lineno}"
    return f"{frames[0].filename}:{frames[0].lineno}" if frames else "an unknown place"
