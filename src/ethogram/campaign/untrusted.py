"""What came out of a file that anybody may have written: bounds, forms and types for it."""

import json
import re
from typing import Annotated, Any

from pydantic import AfterValidator, Field

MOST_BYTES = 2**23  # of a file of JSON
MOST_LEVELS = 64  # of lists and objects in each other

_TEXT_OR_BRACKET = re.compile(rb'"[^"\\]*(?:\\.[^"\\]*)*"?|[\[\]{}]', re.DOTALL)
_HASH = r"[0-9a-f]{64}"


def parsed(data: bytes) -> Any:
    """The value that JSON stands for; its size and depth are looked at before anything is made.

    Raises:
        ValueError: it is no JSON, too large or too deep, or has text that is not Unicode.

    """
    if len(data) > MOST_BYTES:
        raise ValueError(f"{len(data)} bytes, {MOST_BYTES} are allowed")
    if (levels := _levels(data)) > MOST_LEVELS:
        raise ValueError(f"{levels} levels of lists and objects, {MOST_LEVELS} are allowed")
    value = json.loads(data)
    json.dumps(value, ensure_ascii=False).encode()  # halves of characters are no text
    return value


def is_hash(text: str) -> bool:
    """Whether a name has the form of a sha256, which is in no way a path."""
    return re.fullmatch(_HASH, text) is not None


def printable(text: str) -> str:
    """A text as one line that does nothing to a terminal."""
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in text)


def _one_line(text: str) -> str:
    if not text.isprintable():
        raise ValueError("not one printable line")
    return text


Line = Annotated[str, AfterValidator(_one_line)]
Hash = Annotated[str, Field(pattern=f"^{_HASH}$")]
Key = Annotated[str, Field(max_length=200)]  # dotted: so many levels at most
Seconds = Annotated[float, Field(ge=0, allow_inf_nan=False)]


def _levels(data: bytes) -> int:
    """How deep lists and objects lie in each other, at most, in what may be JSON."""
    level = most = 0
    for found in _TEXT_OR_BRACKET.finditer(data):
        level += {b"[": 1, b"{": 1, b"]": -1, b"}": -1}.get(found[0], 0)
        most = max(most, level)
    return most
