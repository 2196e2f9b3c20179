"""A signal ends a run with one sentence, wherever it strikes and after a last checkpoint."""

import os
import signal
import sys
import threading
from contextlib import suppress
from types import ModuleType

import pytest
from tests.campaign import toy
from tests.campaign.processes import PATIENCE, Recorder, run_toy, until

import ethogram.__main__
from ethogram.campaign import context, interrupts
from ethogram.campaign.engines import inline, pool
from ethogram.campaign.interrupts import certain_end, certain_interrupts
from ethogram.campaign.results import digest
from ethogram.campaign.store import Store

SIGNALS = [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
HANDLED = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM]


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
    before = [signal.getsignal(number) for number in HANDLED], sys.unraisablehook
    with certain_interrupts():
        assert signal.getsignal(signal.SIGTERM) is not before[0][1]
    assert ([signal.getsignal(number) for number in HANDLED], sys.unraisablehook) == before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    assert not interrupts.stop_wanted()


def test_a_signal_that_is_ignored_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with certain_interrupts():
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert not interrupts.stopped()


def test_in_another_thread_signals_are_left_to_the_caller():
    seen = []

    def look():
        with certain_interrupts():
            seen.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=look)
    thread.start()
    thread.join()
    assert seen == [signal.getsignal(signal.SIGTERM)]


def program_that(does, monkeypatch):
    """Run the program `ethogram`, whose command line is replaced; gives its exit code."""
    stand_in = ModuleType("ethogram.cli")
    stand_in.main = does
    monkeypatch.setitem(sys.modules, "ethogram.cli", stand_in)
    monkeypatch.setattr(os, "_exit", sys.exit)
    before = signal.getsignal(signal.SIGINT)
    try:
        with pytest.raises(SystemExit) as ending:
            ethogram.__main__.main()
    finally:
        signal.signal(signal.SIGINT, before)
    return ending.value.code


@pytest.mark.parametrize(("number", "code"), SIGNALS)
@pytest.mark.parametrize("becomes", [None, SystemError("an import was struck")])
def test_a_signal_while_the_program_loads_ends_it_with_a_sentence(
    number, code, becomes, monkeypatch, capsys
):
    def command_line():
        try:
            signal.raise_signal(number)
        except KeyboardInterrupt as struck:
            raise becomes or struck from None

    assert program_that(command_line, monkeypatch) == code
    assert capsys.readouterr().err.count("\n") == 1


def test_a_program_that_no_signal_ends_gives_the_exit_code_of_its_command(monkeypatch, capsys):
    assert program_that(lambda: 2, monkeypatch) == 2
    assert capsys.readouterr().err == ""


def test_a_process_in_which_no_python_code_runs_ends_all_the_same(monkeypatch):
    said, codes, ended = [], [], threading.Event()
    monkeypatch.setattr(interrupts, "_CERTAIN_SECONDS", 0.0)
    monkeypatch.setattr(os, "_exit", lambda code: (codes.append(code), ended.set()))
    before = signal.signal(signal.SIGTERM, lambda *_: None)  # as if it could not run yet
    try:
        with certain_interrupts():
            signal.signal(signal.SIGTERM, lambda *_: None)
            with certain_end(lambda: said.append(interrupts.reason())):
                signal.raise_signal(signal.SIGTERM)
                assert ended.wait(PATIENCE)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert (said, codes) == (["Terminated."], [143])


def test_many_signals_are_as_good_as_one(monkeypatch):
    dropped = []
    monkeypatch.setattr(sys, "unraisablehook", dropped.append)
    with certain_interrupts(), certain_end(lambda: None):
        for _ in range(1000):
            with suppress(KeyboardInterrupt):
                signal.raise_signal(signal.SIGTERM)
            os.sched_yield()
    assert dropped == []


@pytest.mark.parametrize("engine", [inline, pool])
def test_the_case_in_hand_leaves_a_checkpoint(engine, tmp_path, monkeypatch):
    """The signal comes in the second of three chunks, an hour before a checkpoint is due."""
    monkeypatch.setattr(context, "CHECKPOINT_SECONDS", 3600.0)
    monkeypatch.setattr(interrupts, "GRACE_SECONDS", PATIENCE)
    monkeypatch.setattr(interrupts, "_AGAIN_SECONDS", PATIENCE)
    mishaps = tmp_path / "mishaps"
    mishaps.mkdir()
    waits = mishaps / "a1.0.linger"
    waits.touch()
    monkeypatch.setenv("TOY_MISHAPS", str(mishaps))

    def strike():
        until(lambda: not waits.exists())
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=strike).start()
    with pytest.raises(KeyboardInterrupt), certain_interrupts():
        run_toy(tmp_path, engine=engine, workers=1, monitor=Recorder())
    case = toy.cases(toy.PLANS["smoke"])[0]
    checkpoint, _ = Store(tmp_path / "toy").checkpoints(case.id).restore()
    assert checkpoint["done"] == 2
    run_toy(tmp_path)
    run_toy(tmp_path / "undisturbed")
    assert digest(tmp_path / "undisturbed") == digest(tmp_path)
