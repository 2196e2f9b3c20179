"""Verdicts on claims that were stated before the run, and intervals for tables and figures.

The unit of evidence is the independent trial: an agent, an episode or a step of the same trial is
no second witness.
"""

from ethogram.studies.statistics.effects import LEAST_P
from ethogram.studies.statistics.intervals import Interval, interval_of_mean, measured
from ethogram.studies.statistics.judging import (
    FAMILY_ERROR,
    ClaimSpec,
    Part,
    holm,
    judge,
    tests_revised,
)
from ethogram.studies.statistics.needs import Need
from ethogram.studies.statistics.trials import (
    LEAST_TRIALS,
    Support,
    Terms,
    Trials,
    bounded,
    difference,
    jackknife_pseudovalues,
    support_of,
)

__all__ = [
    "FAMILY_ERROR",
    "LEAST_P",
    "LEAST_TRIALS",
    "ClaimSpec",
    "Interval",
    "Need",
    "Part",
    "Support",
    "Terms",
    "Trials",
    "bounded",
    "difference",
    "holm",
    "interval_of_mean",
    "jackknife_pseudovalues",
    "judge",
    "measured",
    "support_of",
    "tests_revised",
]
