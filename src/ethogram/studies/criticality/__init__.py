"""Whether bodies can be evolved towards criticality, how far they get, and what they can do.

Thesis, chapter 6: bodies of voxels in the plane that are evolved by a genetic algorithm towards
self-organised criticality, beside random and hand-made ones; and all of them in locomotion, jump
and escape, by phase controllers that CMA-ES evolves: figures 6.1 to 6.4, tables 6.2 and 6.3, and
six claims.  The neural controller (table 6.4, claim 6) is not part of it yet.

Deviations from the thesis are those of the physics (`ethogram.physics.lattice2d`), of the bodies
(`ethogram.worlds.softbody.growth`), of the score (`ethogram.worlds.softbody.criticality`), of the
learners (`ethogram.learners.evolution`) and of the tasks (`tasks`).
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
