"""Ctrl-C, and the signals of batch systems and closed terminals, that arrive wherever they strike.

The first one lets a case that saves checkpoints get to its next one, for a moment; the second one,
or the end of that moment, raises `KeyboardInterrupt` there and then.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

GRACE_SECONDS = 2.0  # for the chunk in hand to end in a checkpoint
_AGAIN_SECONDS = 2.0  # more than it takes to end a run
_CERTAIN_SECONDS = 4.5  # until a process ends in which no Python code runs

_WORDS = {
    signal.SIGINT: "Interrupted.",
    signal.SIGTERM: "Terminated.",
    signal.SIGHUP: "Ended, as its terminal was closed.",
}


class _Stop:
    """What is known of a stop; signals belong to a process, and so does this."""

    def __init__(self) -> None:
        self.signal: int | None = None  # the first that came, as long as it is not answered
        self.answered: int | None = None
        self.checkpoint_ahead = False  # the case in hand saves checkpoints, and it has begun to
        self.watched = 0  # nested contexts


_stop = _Stop()


@contextmanager
def certain_interrupts() -> Iterator[None]:
    """Raise `KeyboardInterrupt` on Ctrl-C, SIGTERM and SIGHUP until it leaves this context.

    It is raised again and again, since Python drops an exception that is raised in a destructor or
    in a callback of the garbage collector; JAX has one of those, so that an ordinary Ctrl-C is lost
    now and then.  A signal that whoever started us ignores (`nohup`) stays ignored.  Python leaves
    signals to the main thread: in any other, this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard = [number for number in _WORDS if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, _interrupt) for number in (*heard, signal.SIGALRM)}
    hook_before, sys.unraisablehook = sys.unraisablehook, _quiet(sys.unraisablehook)
    _stop.watched += 1
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = hook_before
        _stop.watched -= 1
        if not _stop.watched:
            _stop.signal, _stop.answered = None, _stop.signal


@contextmanager
def certain_end(sentence: Callable[[], None]) -> Iterator[None]:
    """End this process soon after a signal even where no Python code gets to run.

    Compiled code may compute for minutes before it lets a handler run; a record is whole or absent
    all the same.  Only for a process that is all ours.  `sentence` says why it ends.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    ended = threading.Event()

    def watch() -> None:
        with os.fdopen(reader, "rb", buffering=0) as pipe:
            numbers = iter(lambda: pipe.read(1), b"")  # a byte for each signal
            number = next((each[0] for each in numbers if each[0] in _WORDS), None)
            # the pipe stays open: more signals may come
            if number is not None and not ended.wait(_CERTAIN_SECONDS):
                want_stop(number)
                sentence()
                os._exit(exit_code())

    threading.Thread(target=watch, daemon=True).start()
    before = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        ended.set()
        os.close(writer)


@contextmanager
def case_in_hand() -> Iterator[None]:
    """A case is computed here; only within it can there be a checkpoint ahead."""
    try:
        yield
    finally:
        _stop.checkpoint_ahead = False


def reached_checkpoint() -> None:
    """Between two chunks, with a checkpoint saved if a stop is wanted: stop here, or go on."""
    if stop_wanted():
        raise KeyboardInterrupt
    _stop.checkpoint_ahead = True


def want_stop(number: int = signal.SIGTERM) -> bool:
    """Ask for a stop at the next checkpoint; whether there is one ahead."""
    _stop.signal = _stop.signal or number
    return _stop.checkpoint_ahead


def stop_wanted() -> bool:
    """Whether a signal has come."""
    return _stop.signal is not None


def stopped() -> bool:
    """Whether a signal has come, answered by now or not."""
    return stop_wanted() or _stop.answered is not None


def exit_code() -> int:
    """128 and the number of the signal that came, as shells have it."""
    return 128 + _last()


def reason() -> str:
    """The signal that came, as a sentence."""
    return _WORDS[_last()]


def _last() -> signal.Signals:
    return signal.Signals(_stop.signal or _stop.answered or signal.SIGINT)


def _interrupt(number: int, frame: FrameType | None) -> None:
    del frame
    if number != signal.SIGALRM:
        first = not stop_wanted()
        if want_stop(number) and first:
            signal.setitimer(signal.ITIMER_REAL, GRACE_SECONDS)
            return
    signal.setitimer(signal.ITIMER_REAL, _AGAIN_SECONDS)
    raise KeyboardInterrupt


def _quiet(
    hook_before: "Callable[[sys.UnraisableHookArgs], object]",
) -> "Callable[[sys.UnraisableHookArgs], None]":
    def hook(dropped: "sys.UnraisableHookArgs") -> None:
        if dropped.exc_type is not KeyboardInterrupt:
            hook_before(dropped)

    return hook
