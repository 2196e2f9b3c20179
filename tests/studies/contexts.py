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
