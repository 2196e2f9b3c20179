"""The resource-sharing world of chapter 3."""

from ethogram.worlds.sharing.world import Sharing, State

__all__ = ["Sharing", "State"]
