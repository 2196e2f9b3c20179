"""How a run goes on, for a person: a bar on a terminal, plain lines anywhere else."""

import time
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from ethogram.campaign.case import Case
from ethogram.campaign.launch import Prospect
from ethogram.campaign.run import Receipt
from ethogram.campaign.study import Study

_EARLY = 0.05  # of a run: compiling takes most of the time till then
_LINE_SECONDS = 15.0  # between two plain lines while no case ends


class Display:
    """Shows a run: a monitor, to be used in a `with` statement."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._estimate = Estimate({})
        self._cases = self._ended = 0
        self._said = time.monotonic()
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:3.0f} %"),
            TextColumn("{task.fields[remaining]}"),
            TimeElapsedColumn(),
            console=console,
            disable=not console.is_terminal,
            transient=True,
        )
        self._task = TaskID(0)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def begin(self, study: Study, planned: int, to_do: Sequence[Prospect], workers: int) -> None:
        """Say what is there and what is to be computed."""
        self._estimate = Estimate({found.case.id: found.cost.seconds for found in to_do})
        self._cases, self._ended = len(to_do), 0
        self._task = self._bar.add_task(study.NAME, total=1.0, remaining="")
        pace = f", {min(workers, len(to_do))} at a time" if to_do else ""
        self.note(f"{study.NAME}: computing {len(to_do)} of {planned} cases{pace}.")

    def advance(self, case: Case, fraction: float) -> None:
        """Move the bar, or say a line when none was said for a while."""
        self._estimate.update(case.id, fraction)
        self._bar.update(
            self._task, completed=self._estimate.done(), remaining=self._estimate.remaining()
        )
        if not self._console.is_terminal and time.monotonic() - self._said > _LINE_SECONDS:
            self.note(f"{self._ended}/{self._cases} cases, {self._progress()}")

    def finish(self, case: Case, receipt: Receipt) -> None:
        """Say that a case has ended."""
        self.advance(case, 1.0)
        self._ended += 1
        ending = receipt.state if receipt.state == "stored" else f"failed: {receipt.error}"
        self.note(f"{self._ended}/{self._cases} {case.name}: {ending} ({self._progress()})")

    def note(self, text: str) -> None:
        """Say a line, above the bar if there is one."""
        self._console.print(text, markup=False, highlight=False, soft_wrap=True)
        self._said = time.monotonic()

    def _progress(self) -> str:
        remaining = self._estimate.remaining()
        return f"{self._estimate.done():.0%}" + (f", {remaining}" if remaining else "")


class Estimate:
    """How much of a run is done and how long the rest will take, at the pace so far."""

    def __init__(self, weights: dict[str, float]) -> None:
        self._weights = weights  # seconds expected of each case; only their ratios matter
        self._fractions = dict.fromkeys(weights, 0.0)
        self._start = time.monotonic()

    def update(self, case_id: str, fraction: float) -> None:
        """So much of a case is done."""
        self._fractions[case_id] = fraction

    def done(self) -> float:
        """The fraction of the whole work that is done."""
        whole = sum(self._weights.values())
        part = sum(self._weights[name] * self._fractions[name] for name in self._weights)
        return part / whole if whole > 0 else 1.0

    def remaining(self) -> str:
        """The time left in words; nothing as long as little is known."""
        done = self.done()
        if not _EARLY < done < 1:
            return ""
        elapsed = time.monotonic() - self._start
        return f"about {readable_seconds(elapsed * (1 - done) / done)} left"


def readable_seconds(seconds: float) -> str:
    """A duration for a person: 40 s, 12 min, 3 h 20 min."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    if minutes < 90:
        return f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60} min"
