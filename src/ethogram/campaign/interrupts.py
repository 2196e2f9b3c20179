"""Ctrl-C that arrives, wherever it strikes."""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_AGAIN_SECONDS = 2.0  # more than it takes to end a run


@contextmanager
def certain_interrupts() -> Iterator[None]:
    """Raise `KeyboardInterrupt` on Ctrl-C again and again until it leaves this context.

    Python drops an exception that is raised in a destructor or in a callback of the garbage
    collector; JAX has one of those, so that an ordinary Ctrl-C is lost now and then.
    """

    def interrupt(number: int, frame: FrameType | None) -> None:
        del number, frame
        signal.setitimer(signal.ITIMER_REAL, _AGAIN_SECONDS)
        raise KeyboardInterrupt

    def hook(dropped: "sys.UnraisableHookArgs") -> None:
        if dropped.exc_type is not KeyboardInterrupt:
            hook_before(dropped)

    before = {
        number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGALRM)
    }
    hook_before, sys.unraisablehook = sys.unraisablehook, hook
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = hook_before
