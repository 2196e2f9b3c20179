"""The claims with their verdicts, and what these verdicts hang on."""

from dataclasses import replace

from ethogram.campaign.study import Records
from ethogram.core.findings import Claim
from ethogram.studies.publishing.condition import SCENARIOS
from ethogram.studies.publishing.results import Results
from ethogram.studies.publishing.robustness import depends_on, rows
from ethogram.studies.publishing.statements import specs
from ethogram.studies.statistics import judge


def claims(records: Records) -> list[Claim]:
    """All seven claims, judged together."""
    results = Results.of(records)
    found = rows(results)
    return [
        replace(claim, depends_on=depends_on(claim.number, found))
        for claim in judge(specs(results, SCENARIOS))
    ]
