"""Does communication make a group of learners better off, and more equal?  Thesis, chapter 3.

Ten independent Q-learners choose among two resources, forced to communicate, forbidden to, free
to, or acting at random, in a cooperative, a competitive and a mixed scenario, seeing the filling
of the resources or not: figures 3.1 to 3.6, tables 3.2 to 3.4 and nine claims.

Deviations from the thesis are those of the world (`ethogram.worlds.sharing`) and of the learner
(`ethogram.learners.qlearning`); no other is known.
"""

from ethogram.studies.sharing.claims import claims
from ethogram.studies.sharing.compute import cost, run
from ethogram.studies.sharing.figures import figures
from ethogram.studies.sharing.introduction import INTRODUCTION
from ethogram.studies.sharing.plan import NAME, PLANS, VERSION, cases
from ethogram.studies.sharing.tables import tables

TITLE = "Sharing resources"
QUESTION = "What does learning when to communicate do to the return of each agent and of the group?"

__all__ = [
    "INTRODUCTION",
    "NAME",
    "PLANS",
    "QUESTION",
    "TITLE",
    "VERSION",
    "cases",
    "claims",
    "cost",
    "figures",
    "run",
    "tables",
]
