"""Whether soft robots crawl better when their controllers sense what the body does.

Thesis, chapter 5: three bodies of voxels, controllers that drive every voxel by a sine wave of its
own or by a network of what all voxels sense, evolved on an even and on an uneven surface: figures
5.1 to 5.6, tables 5.1 to 5.3 and six claims, for either way to read the network's outputs.

Deviations from the thesis are those of the world (`ethogram.worlds.softbody`), of the
controllers (`ethogram.worlds.softbody.controllers`), of the learner
(`ethogram.learners.evolution.age_fitness`) and of the behaviours (`behaviour`).
"""

from ethogram.studies.sensing.claims import claims
from ethogram.studies.sensing.compute import cost, run
from ethogram.studies.sensing.figures import figures
from ethogram.studies.sensing.introduction import INTRODUCTION
from ethogram.studies.sensing.plan import NAME, PLANS, VERSION, cases
from ethogram.studies.sensing.tables import tables

TITLE = "Sensing while crawling"
QUESTION = (
    "Do soft robots crawl better when their controllers sense what the body does, and do they "
    "still where gravity tilts?"
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
