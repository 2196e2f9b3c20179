"""Standard streams that may be closed, full or narrow in what they can write, and messages on them.

What cannot be printed is dropped: no run ends for a log that has no room.
"""

import errno
import io
import logging
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from typing import TextIO

from ethogram.core.errors import LONGEST

_LONGEST_WORD = 300  # of a message; the paths that people have are shorter


class Tolerant(io.TextIOBase):
    """A stream that drops what it cannot print and remembers why."""

    def __init__(self, stream: TextIO | None) -> None:
        self._stream = stream
        self.trouble = ""  # why something was dropped; nothing where its reader has left

    @property
    def encoding(self) -> str:  # type: ignore[override] # a property there as well, in C
        """That of the stream."""
        return getattr(self._stream, "encoding", None) or "utf-8"

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return self._stream is not None and self._stream.isatty()

    def fileno(self) -> int:
        """The descriptor; `OSError` where there is none."""
        return super().fileno() if self._stream is None else self._stream.fileno()

    def writable(self) -> bool:
        """Always: what cannot be printed is dropped."""
        return True

    def write(self, text: str) -> int:
        """Print, with question marks for what the stream has no letters for."""
        with self._tolerance():
            if self._stream is None:
                raise OSError(errno.EBADF, "it is closed")
            try:
                self._stream.write(text)
            except UnicodeEncodeError:
                plain = text.encode(self.encoding, "replace").decode(self.encoding)
                self._stream.write(plain)
        return len(text)

    def flush(self) -> None:
        """Print what is still in memory."""
        with self._tolerance():
            if self._stream is not None:
                self._stream.flush()

    @contextmanager
    def _tolerance(self) -> Iterator[None]:
        try:
            yield
        except BrokenPipeError:
            return  # the reader of our output has seen enough
        except (OSError, ValueError) as error:  # ValueError: closed by Python
            self.trouble = getattr(error, "strerror", None) or str(error)


@contextmanager
def tolerant_streams() -> Iterator[Tolerant]:
    """Drop what standard output and error cannot print; gives the output, to be asked how it went.

    Libraries that have something to log have nobody who would read it.
    """
    output, before = Tolerant(sys.stdout), logging.lastResort
    logging.lastResort = logging.NullHandler()
    try:
        with redirect_stdout(output), redirect_stderr(Tolerant(sys.stderr)):
            yield output
    finally:
        logging.lastResort = before


def say(text: str) -> None:
    """Print for the person at the terminal, apart from what a command gives out."""
    if sys.stderr is not None:
        print(text, file=sys.stderr, flush=True)


def tell(text: object) -> None:
    """Print where the files are that were written, which is what counts: this may be dropped."""
    print(text, flush=True)
    if isinstance(sys.stdout, Tolerant):
        sys.stdout.trouble = ""


def readable(message: str, typed: Sequence[str] = ()) -> str:
    """A message with endless words cut, also what was `typed` with blanks, and escapes shown."""
    for argument in typed:
        for word in (argument, *argument.split("=", 1)):
            if len(word) > _LONGEST_WORD:
                message = message.replace(word, f"{word[:LONGEST]}...")
    message = re.sub(rf"\S{{{_LONGEST_WORD},}}", lambda long: f"{long[0][:LONGEST]}...", message)
    return "".join(
        letter if letter.isprintable() or letter == "\n" else ascii(letter)[1:-1]
        for letter in message
    )
