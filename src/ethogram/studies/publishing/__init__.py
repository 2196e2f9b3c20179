"""Whether h-index and impact factor tell the quality of authors and journals.

Thesis, chapter 7: authors write and submit, editors accept or reject, by fixed policies or by such
as are learned; figures 7.1 to 7.9 and seven claims.  Beyond the thesis: seeds in place of a single
run, and the claims again with other measures and under every other reading of the
text (`robustness`, `readings`).

Deviations from the thesis are those of the world (`ethogram.worlds.publishing`), of what is learned
(`ethogram.worlds.publishing.learnable`) and of the learner (`ethogram.learners.qlearning`).
"""

from ethogram.studies.publishing.claims import claims
from ethogram.studies.publishing.compute import cost, run
from ethogram.studies.publishing.figures import figures
from ethogram.studies.publishing.introduction import INTRODUCTION
from ethogram.studies.publishing.plan import NAME, PLANS, VERSION, cases
from ethogram.studies.publishing.tables import tables

TITLE = "Indicators of authors and journals"
QUESTION = (
    "Do h-index and impact factor tell the quality of authors and of journals, whatever the "
    "authors and editors do?"
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
