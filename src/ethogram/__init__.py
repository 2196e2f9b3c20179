"""Ethogram: worlds in which artificial agents learn, and studies of what behaviour emerges."""

__version__ = "0.1.0"
