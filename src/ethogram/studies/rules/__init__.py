"""Whether drivers that are fined for breaking traffic rules learn to drive safely.

Thesis, chapter 4: drivers share a policy that PPO learns, with fines for breaking three rules and
without; figures 4.3 to 4.6 and six claims.  Beyond the thesis: among drivers of other kinds, before
a stopped car, with other fines, and seven claims of our own.

Deviations from the thesis are those of the world (`ethogram.worlds.traffic.world`) and of the
preset of the learner (`ethogram.learners.ppo`).  The thesis does not say how drivers choose actions
after training: here they draw them, as in training; the tables show greedy ones, too.
"""

from ethogram.studies.rules.claims import claims
from ethogram.studies.rules.compute import cost, run
from ethogram.studies.rules.figures import figures
from ethogram.studies.rules.introduction import INTRODUCTION
from ethogram.studies.rules.plan import NAME, PLANS, VERSION, cases
from ethogram.studies.rules.tables import tables

TITLE = "Traffic rules"
QUESTION = (
    "Do drivers that are fined for breaking traffic rules learn to drive more safely, and what "
    "does it cost?"
)

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
