"""The command line: runs studies, shows what they found."""

from ethogram.cli.commands import DONE, FAILED, INTERRUPTED, WRONG, app, main

__all__ = ["DONE", "FAILED", "INTERRUPTED", "WRONG", "app", "main"]
