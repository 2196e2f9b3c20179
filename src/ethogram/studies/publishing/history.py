"""When the claims were stated, and how their tests were changed since then."""

from ethogram.core.findings import Revision
from ethogram.studies.statistics import tests_revised

STATED = "2026-11-26"
PUBLISHED = "The results of 2026-11-26, published then."
RETESTED = tests_revised(PUBLISHED)
_NARROWER = (
    "The test is about figures 7.2 to 7.5 alone; until now it was about the scenarios of 1000 "
    "authors (figures 7.6 and 7.7) too."
)
_NAMED = (
    "Section 7.5.1 names figures 7.2 and 7.4 for random authors, 7.3 and 7.5 for minded ones: it "
    "had been read too widely."
)
SCOPES = {
    3: Revision(
        date="2026-11-29",
        change=_NARROWER,
        reason=_NAMED,
        known=f"{PUBLISHED} They refute the claim with either scope.",
    ),
    4: Revision(
        date="2026-11-29",
        change=_NARROWER,
        reason=_NAMED,
        known=f"{PUBLISHED} They refute the claim by figure 7.6 alone, and confirm it on figures "
        "7.2 to 7.5: the verdict on these runs was known when the scope was changed.",
    ),
}


def history(number: int) -> tuple[Revision, ...]:
    """The changes to the test of a claim, oldest first."""
    return (SCOPES[number], RETESTED) if number in SCOPES else (RETESTED,)
