"""Ctrl-C is not lost in a place where Python drops exceptions."""

import signal
import sys

import pytest
from tests.campaign.processes import until

from ethogram.campaign import interrupts
from ethogram.campaign.interrupts import certain_interrupts


class StruckInItsDestructor:
    """Interrupts the process where a `KeyboardInterrupt` cannot get out."""

    def __del__(self):
        signal.raise_signal(signal.SIGINT)


def test_an_interrupt_that_python_drops_comes_again(monkeypatch, capsys):
    monkeypatch.setattr(interrupts, "_AGAIN_SECONDS", 0.05)
    reached = []

    def strike():
        StruckInItsDestructor()
        reached.append("after the destructor")
        until(lambda: False)

    with pytest.raises(KeyboardInterrupt), certain_interrupts():
        strike()
    assert reached
    assert capsys.readouterr().err == ""


def test_everything_is_put_back():
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM), sys.unraisablehook
    with certain_interrupts():
        assert signal.getsignal(signal.SIGINT) is not before[0]
    after = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM), sys.unraisablehook
    assert after == before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
