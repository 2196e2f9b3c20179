"""What a running case may use of the world outside it: say how far it is, and be resumed."""

import time
from collections.abc import Callable, Mapping

from ethogram.campaign import interrupts
from ethogram.campaign.checkpoints import Arrays, Checkpoints
from ethogram.core.kernels import arithmetic

CHECKPOINT_SECONDS = 60.0  # between two checkpoints
_PROGRESS_SECONDS = 0.2  # between two reports of progress


def _ignore(fraction: float) -> None:
    """Report progress to nobody."""
    del fraction


class Context:
    """Handed to a study's `run`.  `Context()` is one for a case that is run by hand."""

    def __init__(
        self,
        report: Callable[[float], None] = _ignore,
        checkpoints: Checkpoints | None = None,
    ) -> None:
        self.notes: list[str] = []  # for the user
        self.kernels: dict[str, str] = {}  # behind the case's numbers, and what does their work
        self._report = report
        self._checkpoints = checkpoints
        self._reported = self._saved = time.monotonic()

    def progress(self, done: float, total: float) -> None:
        """Say how far the case is; cheap enough for every chunk."""
        now = time.monotonic()
        if now - self._reported >= _PROGRESS_SECONDS and total > 0:
            self._reported = now
            self._report(min(max(done / total, 0.0), 1.0))

    def use_kernels(self, kernels: Mapping[str, str]) -> None:
        """Say, before anything else, what does the work of the kernels behind the case's numbers.

        The record names it, and a checkpoint of other bits is not gone on from.
        """
        self.kernels |= kernels

    def restore(self) -> Arrays | None:
        """What the last checkpoint of this very case holds, or None to begin at the beginning."""
        if self._checkpoints is None:
            return None
        arrays, notes = self._checkpoints.restore(arithmetic(self.kernels))
        self.notes += notes
        return arrays

    def checkpoint(self, make: Callable[[], Arrays]) -> None:
        """Save what `make` gives if the last checkpoint is a minute old; call it between chunks.

        A run that is to stop saves it at once and ends here, by `KeyboardInterrupt`.
        """
        if self._checkpoints is None:
            return
        old = time.monotonic() - self._saved >= CHECKPOINT_SECONDS
        if old or interrupts.stop_wanted():
            self._checkpoints.save(make(), arithmetic(self.kernels))
            self._saved = time.monotonic()
        interrupts.reached_checkpoint()
