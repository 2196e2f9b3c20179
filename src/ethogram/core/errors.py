"""What a user can get wrong or a machine can refuse, as errors with one clear message.

The command line prints the message of an `EthogramError` and exits with code 2; any other
exception is a defect of Ethogram and keeps its traceback.
"""

import difflib
from collections.abc import Iterable


class EthogramError(Exception):
    """Names the thing, the value and what is allowed, in one message for a person."""


class UnknownName(EthogramError):
    """A name that is not among the allowed ones; the message offers the nearest."""

    def __init__(self, what: str, name: str, allowed: Iterable[str]) -> None:
        choices = sorted(allowed)
        near = difflib.get_close_matches(name, choices, n=1, cutoff=0.5)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        listing = ", ".join(choices) if choices else "none"
        super().__init__(f"Unknown {what} {name!r}.{hint} Allowed: {listing}.")


class InvalidSettings(EthogramError):
    """Settings out of range or of the wrong type, each named with its dotted path."""


class TooLarge(EthogramError):
    """What was asked for would not fit in memory; the message names the size needed."""
