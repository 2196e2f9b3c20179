"""Whether bodies can be evolved towards criticality, and how far they get.

Thesis, chapter 6: bodies of voxels in the plane that are evolved by a genetic algorithm towards
self-organised criticality, beside random and hand-made ones: figures 6.1 to 6.4 and the claims
about their scores.  What bodies can do (locomotion, jump, escape; tables 6.2 to 6.4) is not part of
it yet: the claims about tasks are listed as not run.

Deviations from the thesis are those of the physics (`ethogram.physics.lattice2d`), of the bodies
(`ethogram.worlds.softbody.growth`), of the score (`ethogram.worlds.softbody.criticality`) and of
the learner (`ethogram.learners.evolution.genetic`).
"""

from ethogram.studies.criticality.claims import claims
from ethogram.studies.criticality.compute import cost, run
from ethogram.studies.criticality.figures import figures
from ethogram.studies.criticality.introduction import INTRODUCTION
from ethogram.studies.criticality.plan import NAME, PLANS, VERSION, cases
from ethogram.studies.criticality.tables import tables

TITLE = "Bodies at the edge"
QUESTION = "Can bodies be evolved towards criticality, and how far do they get?"

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
