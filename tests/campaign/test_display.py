"""What a person sees of a run: lines in a file, a bar on a terminal."""

import io

import pytest
from rich.console import Console
from tests.campaign import toy
from tests.campaign.processes import run_toy

from ethogram.campaign import display
from ethogram.campaign.display import Display, Estimate, readable_seconds
from ethogram.campaign.launch import survey
from ethogram.campaign.run import Receipt


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test sets."""
    times = [0.0]
    monkeypatch.setattr(display.time, "monotonic", lambda: times[0])
    return lambda time: times.__setitem__(0, time)


def shown(folder, *, terminal):
    screen = io.StringIO()
    with Display(Console(file=screen, force_terminal=terminal, width=80)) as monitor:
        run_toy(folder, monitor=monitor)
    return screen.getvalue()


def test_elsewhere_than_on_a_terminal_there_are_plain_lines_only(tmp_path):
    text = shown(tmp_path, terminal=False)
    assert text.count("stored") == 3
    assert text.splitlines()[0] == "toy: computing 3 of 3 cases, 1 at a time."
    assert "\x1b" not in text
    assert "\r" not in text


def test_on_a_terminal_there_is_a_bar_below_the_lines(tmp_path):
    text = shown(tmp_path, terminal=True)
    assert text.count("stored") == 3
    assert "━" in text
    assert "100 %" in text


def test_a_long_case_says_a_line_now_and_then(tmp_path, clock):
    screen = io.StringIO()
    prospects = survey(toy, toy.PLANS["smoke"], tmp_path)
    monitor = Display(Console(file=screen))
    monitor.begin(toy, 3, prospects, 2)
    for time in range(1, 41):
        clock(float(time))
        monitor.advance(prospects[0].case, time / 40)
    receipt = Receipt(case_id=prospects[0].case.id, state="failed", error="broke")
    monitor.finish(prospects[0].case, receipt)
    assert screen.getvalue().splitlines() == [
        "toy: computing 3 of 3 cases, 2 at a time.",
        "0/3 cases, 13%, about 2 min left",
        "0/3 cases, 27%, about 88 s left",
        "1/3 a: failed: broke (33%, about 80 s left)",
    ]


def test_the_time_left_follows_the_pace_so_far(clock):
    estimate = Estimate({"short": 1.0, "long": 3.0})
    assert estimate.remaining() == ""
    clock(10.0)
    estimate.update("short", 1.0)
    assert estimate.done() == 0.25
    assert estimate.remaining() == "about 30 s left"
    estimate.update("long", 1.0)
    assert estimate.remaining() == ""


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (89, "89 s"), (90, "2 min"), (3600, "60 min"), (12_000, "3 h 20 min")],
)
def test_durations_are_readable(seconds, text):
    assert readable_seconds(seconds) == text
