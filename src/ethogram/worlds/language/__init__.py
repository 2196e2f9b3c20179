"""The language world of chapter 2."""

from ethogram.worlds.language.world import Language, State

__all__ = ["Language", "State"]
