"""The program `ethogram`, also as `python -m ethogram`: the command line in a process of its own.

From its first moment a signal ends it with a sentence, so nothing slow is imported before that.
"""

import os
import signal
import sys
from contextlib import suppress
from typing import NoReturn

from ethogram.campaign import interrupts


def main() -> NoReturn:
    """Run the command line and end the process with its exit code."""
    _open_streams()
    with interrupts.certain_end(_say_why):
        try:
            with interrupts.certain_interrupts():
                from ethogram.cli import main as command_line

                code = command_line()
        except BaseException:  # an import that a signal has struck may raise anything
            if not interrupts.stopped():
                raise
            _say_why()
            code = interrupts.exit_code()
    _flush()
    if interrupts.stopped():
        os._exit(code)  # compiled code that still runs would be waited for
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(code)


def _say_why() -> None:
    if sys.stderr is not None:
        with suppress(OSError, ValueError):
            print(interrupts.reason(), file=sys.stderr, flush=True)


def _open_streams() -> None:
    """Where a standard stream is closed, keep its place, which another file would get."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)


def _flush() -> None:
    """Print what is left; Python, at its end, would complain of what cannot be printed."""
    for stream in filter(None, (sys.stdout, sys.stderr)):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


if __name__ == "__main__":
    main()
