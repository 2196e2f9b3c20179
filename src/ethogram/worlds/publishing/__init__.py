"""The world of chapter 7: authors, editors and journals."""

from ethogram.worlds.publishing.world import Publishing

__all__ = ["Publishing"]
