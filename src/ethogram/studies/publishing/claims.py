"""The claims with their verdicts, their history, and what these verdicts hang on."""

from dataclasses import replace

from ethogram.campaign.study import Records
from ethogram.core.findings import Claim, Revision
from ethogram.studies.publishing.condition import SCENARIOS
from ethogram.studies.publishing.results import Results
from ethogram.studies.publishing.robustness import depends_on, rows
from ethogram.studies.publishing.statements import specs
from ethogram.studies.statistics import judge

FIRST_STATED = "2026-11-26"
_NARROWER = (
    "The test is about figures 7.2 to 7.5 alone; until now it was about the scenarios of 1000 "
    "authors (figures 7.6 and 7.7) too."
)
_NAMED = (
    "Section 7.5.1 names figures 7.2 and 7.4 for random authors, 7.3 and 7.5 for minded ones: it "
    "had been read too widely."
)
_KNOWN = "The results of 2026-11-26, published then."
HISTORY = {
    3: (
        Revision(
            date="2026-11-29",
            change=_NARROWER,
            reason=_NAMED,
            known=f"{_KNOWN} They refute the claim with either scope.",
        ),
    ),
    4: (
        Revision(
            date="2026-11-29",
            change=_NARROWER,
            reason=_NAMED,
            known=f"{_KNOWN} They refute the claim by figure 7.6 alone, and confirm it on figures "
            "7.2 to 7.5: the verdict on these runs was known when the scope was changed.",
        ),
    ),
}


def claims(records: Records) -> list[Claim]:
    """All seven claims, judged together."""
    results = Results.of(records)
    found = rows(results)
    return [
        _told(replace(claim, depends_on=depends_on(claim.number, found)))
        for claim in judge(specs(results, SCENARIOS))
    ]


def _told(claim: Claim) -> Claim:
    """A claim with the date on which it was stated, and how its test changed since then."""
    return replace(claim, stated=FIRST_STATED, history=HISTORY.get(claim.number, ()))
