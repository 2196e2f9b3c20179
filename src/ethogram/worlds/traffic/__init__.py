"""The road-traffic world of chapter 4."""

from ethogram.worlds.traffic.graph import Graph, Section
from ethogram.worlds.traffic.state import State
from ethogram.worlds.traffic.world import Traffic

__all__ = ["Graph", "Section", "State", "Traffic"]
