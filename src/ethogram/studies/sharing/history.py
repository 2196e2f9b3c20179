"""When the claims were stated, and how their tests were changed since then."""

from ethogram.core.findings import Revision
from ethogram.studies.statistics import tests_revised

STATED = "2026-11-22"
FIRST_RUN = "A first run of the thesis plan, which was then run again; no verdict changed."
PUBLISHED = "The published results of the thesis plan, with their verdicts."
RETESTED = tests_revised(PUBLISHED)
NARROWER = Revision(
    date="2026-11-29",
    change="The margin on J is 2% of what can be earned in the scenario, from random choices to "
    "the optimum; it was 2% of the largest return of an agent, 1.98.",
    reason="Where agents compete, 1.98 is 83% of all that can be earned: a margin that hardly any "
    "difference could pass.",
    known=PUBLISHED,
)
LEAD_EXISTS = Revision(
    date=STATED,
    change="In I, always-communication must have a lead where the filling is hidden.",
    reason="A lead that is none on either side could be found larger.",
    known=FIRST_RUN,
)
OPTIMUM_REACHED = Revision(
    date=STATED,
    change="Always-communication must come close to the optimum by step 10.",
    reason="Who never reaches the optimum was first if nobody else reached it either.",
    known=FIRST_RUN,
)
WITHOUT_RANDOM = Revision(
    date="2026-11-29",
    change="The random strategy is not among the others.",
    reason="The claim is about figure 3.6, which does not show it.",
    known=PUBLISHED,
)
