"""The toy under another name, for folders with two studies."""

from dataclasses import replace

from tests.campaign import toy
from tests.campaign.toy import PLANS, QUESTION, TITLE, VERSION, claims, cost, figures, run, tables

NAME = "twin"

__all__ = ["NAME", "PLANS", "QUESTION", "TITLE", "VERSION", "claims", "cost", "figures", "run"]
__all__ += ["tables"]


def cases(plan):
    """Those of the toy."""
    return [replace(case, study=NAME) for case in toy.cases(plan)]
