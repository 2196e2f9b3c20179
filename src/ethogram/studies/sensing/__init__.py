"""Draft."""

from ethogram.studies.sensing.compute import cost, run
from ethogram.studies.sensing.plan import NAME, PLANS, VERSION, cases

__all__ = ["NAME", "PLANS", "VERSION", "cases", "cost", "run"]
