"""Tables: what indicators tell, how the system fares, and which claims hold under which reading."""

from collections.abc import Sequence

import numpy as np

from ethogram.campaign.study import Records
from ethogram.core.findings import Cell, Measured, Table
from ethogram.studies.chapter import Measure
from ethogram.studies.publishing import robustness
from ethogram.studies.publishing.condition import FIGURES, Condition
from ethogram.studies.publishing.readings import words_of
from ethogram.studies.publishing.results import (
    Kind,
    Of,
    Results,
    acceptance,
    indicators,
    last_correlation,
    off_centre,
    papers_per_year,
    share_beyond_chance,
    share_in_last_year,
    share_of_few,
    skewness,
    stuck,
)
from ethogram.studies.publishing.robustness import Row
from ethogram.studies.readings import DEFAULT
from ethogram.studies.statistics import Trials, measured

SCENARIO = ("figure", "authors", "editors", "number of authors", "reading", "runs")
KINDS: tuple[Kind, ...] = ("pearson", "spearman")
COUNTED = ", of what it counts"
NUMBERS = range(1, 8)  # of the claims


def tables(records: Records) -> list[Table]:
    """Every table that the records have data for."""
    results = Results.of(records)
    if not results.by_condition:
        return []
    found = robustness.rows(results)
    return [
        _correlations(results),
        _system(results),
        *([_verdicts(found), _effects(found)] if found else []),
    ]


def _correlations(results: Results) -> Table:
    names = list(
        dict.fromkeys(name for data in results.by_condition.values() for name in indicators(data))
    )
    pairs: list[tuple[str, Of]] = [(name, "published") for name in names]
    pairs.append(("impact_factor", "counted"))
    columns = [(name, kind, of) for name, of in pairs for kind in KINDS]
    rows = [
        (
            *_scenario(results, at),
            *(
                _mean(results, last_correlation(name, kind, of), at)
                if name in indicators(results.by_condition[at])
                else None
                for name, kind, of in columns
            ),
        )
        for at in results.by_condition
    ]
    return Table(
        name="correlations",
        title="What indicators tell: correlation with quality, in the last year",
        caption="Of the h-index with the quality of the authors; of the others, over journals, "
        "with the mean quality of all that a journal has published; in the last two columns of the "
        "papers that the impact factor counts, of the two years before. Mean over runs with a 95% "
        "interval; runs in which a correlation is not defined are left out.",
        columns=(
            *SCENARIO,
            *(
                f"{name.replace('_', ' ')}{COUNTED if of == 'counted' else ''}, {kind}"
                for name, kind, of in columns
            ),
        ),
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
        "the same, last year": share_in_last_year,
        "less what chance adds": share_beyond_chance,
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
        "simulated years, in the fourth of the journals that has most; then of those of the last "
        "year, and this less what that fourth would have beyond a fourth if papers went to "
        "journals by chance. Acceptance rate: mean over "
        "journals, in the end. The last column is the share of the authors that are stuck with "
        "such a draft in the end; minded authors and such as learn never give one up. Mean over "
        "runs with a 95% interval.",
        columns=(*SCENARIO, *measures),
        rows=tuple(rows),
    )


def _verdicts(found: Sequence[Row]) -> Table:
    """Which claims have which verdict, with one thing at a time otherwise."""
    rows: list[tuple[Cell, ...]] = [("published", *("holds" for _ in NUMBERS))]
    for words, claims, _ in found:
        verdicts = (claims[number].verdict if number in claims else None for number in NUMBERS)
        rows.append((words, *verdicts))
    return Table(
        name="robustness",
        title="Robustness: what the verdicts hang on",
        caption="In each row one thing is otherwise: a measure, the scenarios that count, the "
        "reading of the text, or a set of readings as printed. Claims that it does not concern "
        "are left out. What changes who learns, or what is measured, is judged in all scenarios; "
        "the other readings in the four scenarios of 100 authors whose policies do not change, "
        "with fewer parts, and are to be compared with the row of these. Holm's correction is "
        "within a row. All of this was thought of when results were known: no row but the first "
        "is a verdict.",
        columns=("what is otherwise", *(f"claim {number}" for number in NUMBERS)),
        rows=tuple(rows),
    )


def _effects(found: Sequence[Row]) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (
            words,
            claim.number,
            claim.verdict,
            None
            if claim.effect is None
            else Measured(value=claim.effect, low=claim.low, high=claim.high),
            claim.unit,
            claim.note,
        )
        for words, claims, _ in found
        for claim in claims.values()
    ]
    return Table(
        name="robustness-effects",
        title="Robustness: effects and intervals",
        caption="Of each verdict of the table before: the effect of the part on which it rests, "
        "with the interval at the level that Holm's correction leaves to it.",
        columns=("what is otherwise", "claim", "verdict", "effect", "unit", "note"),
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
