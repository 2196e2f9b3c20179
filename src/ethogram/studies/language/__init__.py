"""How the number of words shapes the language that is learned with them.

Thesis, chapter 2: robots that know each other's targets learn with MADDPG to say them and to
listen, with alphabets from no symbol to four per association of a robot with a target: figures
2.1 to 2.4, tables 2.2 and 2.3 and seven claims; and what the words of each language mean.

Deviations from the thesis are those of the world (`ethogram.worlds.language`) and of the learner
(`ethogram.learners.maddpg`).  Validation takes 1000 episodes instead of 100: the same mean with a
third of the noise.
"""

from ethogram.studies.language.claims import claims
from ethogram.studies.language.compute import cost, run
from ethogram.studies.language.figures import figures
from ethogram.studies.language.introduction import INTRODUCTION
from ethogram.studies.language.plan import NAME, PLANS, VERSION, cases
from ethogram.studies.language.tables import tables

TITLE = "Learning a language"
QUESTION = (
    "How does the number of symbols that robots may use shape the language that they learn, and "
    "how well it guides them?"
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
