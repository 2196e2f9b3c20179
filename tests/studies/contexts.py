"""What runs are given in the tests of studies."""

from ethogram.campaign.context import Context


class Remembering(Context):
    """A context that begins with a checkpoint, if given one, and keeps those that are made."""

    def __init__(self, found=None):
        super().__init__()
        self.found, self.saved = found, []

    def restore(self):
        return self.found and dict(self.found)

    def checkpoint(self, make):
        self.saved.append({name: array.copy() for name, array in make().items()})


class Halted(Exception):
    """A run came to where it would go on from a checkpoint."""


class Halting(Context):
    """A context with which a run halts there: what it has said by then counts."""

    def restore(self):
        raise Halted
