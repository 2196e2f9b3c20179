"""The language world of chapter 2."""

from ethogram.worlds.language.state import State
from ethogram.worlds.language.world import Language

__all__ = ["Language", "State"]
