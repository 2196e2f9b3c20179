"""The resource-sharing world of chapter 3."""

from ethogram.worlds.sharing.state import State
from ethogram.worlds.sharing.world import Sharing

__all__ = ["Sharing", "State"]
