"""Tables: what indicators tell, how the system fares, and which claims hold under which reading."""

from collections.abc import Sequence

import numpy as np

from ethogram.campaign.study import Records
from ethogram.core.findings import Cell, Claim, Measured, Table
from ethogram.studies.publishing.claims import ABOUT_STATIC, claims_under
from ethogram.studies.publishing.condition import DEFAULT, FIGURES, Condition
from ethogram.studies.publishing.readings import words_of
from ethogram.studies.publishing.results import (
    Kind,
    Measure,
    Results,
    acceptance,
    indicators,
    last_correlation,
    off_centre,
    papers_per_year,
    share_of_few,
    skewness,
    stuck,
)
from ethogram.studies.statistics import Trials, measured

SCENARIO = ("figure", "authors", "editors", "number of authors", "reading", "runs")
KINDS: tuple[Kind, ...] = ("pearson", "spearman")


def tables(records: Records) -> list[Table]:
    """Every table that the records have data for."""
    results = Results.of(records)
    if not results.by_condition:
        return []
    return [
        _correlations(results),
        _system(results),
        *([_verdicts(results), _effects(results)] if _tested(results) else []),
    ]


def _correlations(results: Results) -> Table:
    names = list(
        dict.fromkeys(name for data in results.by_condition.values() for name in indicators(data))
    )
    columns = [(name, kind) for name in names for kind in KINDS]
    rows = [
        (
            *_scenario(results, at),
            *(
                _mean(results, last_correlation(name, kind), at)
                if name in indicators(results.by_condition[at])
                else None
                for name, kind in columns
            ),
        )
        for at in results.by_condition
    ]
    return Table(
        name="correlations",
        title="What indicators tell: correlation with quality, in the last year",
        caption="Of the h-index with the quality of the authors; of the others, over journals, "
        "with the mean quality of all that a journal has published. Mean over runs with a 95% "
        "bootstrap interval; runs in which a correlation is not defined are left out.",
        columns=(*SCENARIO, *(f"{name.replace('_', ' ')}, {kind}" for name, kind in columns)),
        rows=tuple(rows),
    )


def _system(results: Results) -> Table:
    measures: dict[str, Measure] = {
        "papers, first year": lambda data: papers_per_year(data)[:, 0],
        "papers, last year": lambda data: papers_per_year(data)[:, -1],
        "mean quality off the middle": off_centre,
        "skewness of quality": skewness,
        "the same of all papers: mean": lambda data: off_centre(data, "all"),
        "skewness": lambda data: skewness(data, "all"),
        "share of a fourth of the journals": share_of_few,
        "acceptance rate": acceptance,
        "drafts rejected over ten times": stuck,
    }
    rows = [
        (*_scenario(results, at), *(_mean(results, measure, at) for measure in measures.values()))
        for at in results.by_condition
    ]
    return Table(
        name="system",
        title="How the system fares",
        caption="Quality: of the papers of the last five years, mean less q_max / 2 over q_max, "
        "and skewness; then of all papers, the initial ones too. Share: of all papers of the "
        "simulated years, in the fourth of the journals that has most. Acceptance rate: mean over "
        "journals, in the end. The last column is the share of the authors that are stuck with "
        "such a draft in the end; minded authors and such as learn never give one up. Mean over "
        "runs with a 95% bootstrap interval.",
        columns=(*SCENARIO, *measures),
        rows=tuple(rows),
    )


def _tested(results: Results) -> dict[str, list[Claim]]:
    """The claims about static policies under each reading under which they were run."""
    found = {reading: claims_under(results, reading) for reading in results.readings}
    return {
        reading: claims
        for reading, claims in found.items()
        if any(claim.verdict != "not run" for claim in claims)
    }


def _verdicts(results: Results) -> Table:
    rows = [
        (words_of(reading), *(claim.verdict for claim in claims))
        for reading, claims in _tested(results).items()
    ]
    return Table(
        name="robustness",
        title="Robustness: which claims hold under which reading of the text",
        caption="One reading changed at a time, and sets of them as printed. Claims 1 to 5, about "
        "static policies alone, in the four scenarios of 100 authors: claims 1 to 4 rest on fewer "
        "parts than above, and Holm's correction is within a row.",
        columns=("reading", *(f"claim {number}" for number in range(1, len(ABOUT_STATIC) + 1))),
        rows=tuple(rows),
    )


def _effects(results: Results) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (
            words_of(reading),
            claim.number,
            claim.verdict,
            None
            if claim.effect is None
            else Measured(value=claim.effect, low=claim.low, high=claim.high),
            claim.unit,
            claim.note,
        )
        for reading, claims in _tested(results).items()
        for claim in claims
    ]
    return Table(
        name="robustness-effects",
        title="Robustness: effects and intervals",
        caption="Of each verdict of the table before: the effect of the part on which it rests, "
        "with the interval at the level that Holm's correction leaves to it.",
        columns=("reading", "claim", "verdict", "effect", "unit", "note"),
        rows=tuple(rows),
    )


def _scenario(results: Results, at: Condition) -> tuple[Cell, ...]:
    plain = Condition(at.author, at.editor, at.size)
    figure = FIGURES.get(plain, "") if at.reading == DEFAULT else ""
    runs = int(results.by_condition[at].sizes["trial"])
    editor = at.editor.replace("_", "-")
    return figure, at.author, editor, at.size.authors, words_of(at.reading), runs


def _mean(results: Results, measure: Measure, at: Condition) -> Measured | None:
    """Mean over the runs in which there is a number; None where there is none."""
    trials = results.trials(measure, at)
    values: Sequence[float] | np.ndarray = () if trials.values is None else trials.values
    kept = np.asarray(values)[np.isfinite(values)]
    return measured(Trials(trials.name, kept)) if kept.size else None
