"""Table 3.2 beside its published numbers, and the means behind the claims."""

from ethogram.campaign.study import Records
from ethogram.core.findings import Cell, Measured, Table
from ethogram.studies.chapter import Measure
from ethogram.studies.sharing import results as measure
from ethogram.studies.sharing.plan import SETTINGS, STRATEGIES, Condition, Strategy, filling_word
from ethogram.studies.sharing.published import MAX_VALIDATION_RETURN
from ethogram.studies.sharing.results import Results
from ethogram.studies.sharing.validation import ACTS
from ethogram.studies.statistics import measured

PRINTED: tuple[Strategy, ...] = ("always", "none", "optional")  # rows of Table 3.2


def tables(records: Records) -> list[Table]:
    """Table 3.2, then returns and inequality, then who speaks when."""
    results = Results.of(records)
    return [_table_3_2(results), _returns(results), _acts(results)]


def _table_3_2(results: Results) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for scenario in ("cooperative", "mixed", "competitive"):
        for strategy in PRINTED:
            hidden, observed = (Condition(scenario, strategy, seen) for seen in (False, True))
            rows.append((scenario, strategy, _best(results, hidden), _best(results, observed)))
    return Table(
        name="table-3-2",
        title="Table 3.2: Max validation return",
        caption="The highest individual return over trials, validation episodes and agents; in "
        "brackets the range of the trials' own highest returns.",
        columns=("scenario", "strategy", "filling hidden", "filling observed"),
        rows=tuple(rows),
    )


def _returns(results: Results) -> Table:
    measures: dict[str, Measure] = {
        "J, training": measure.training_return,
        "I, training": measure.training_inequality,
        "J, validation": measure.validation_return,
        "I, validation": measure.validation_inequality,
    }
    return Table(
        name="returns",
        title="Overall return J and inequality I",
        caption="Means over trials with 95% intervals: over the last tenth of training "
        "(where figures 3.2 and 3.3 end), and greedily in validation.",
        columns=("scenario", "filling", "strategy", *measures),
        rows=tuple(
            (
                scenario,
                filling_word(observed),
                strategy,
                *(
                    measured(results.trials(each, Condition(scenario, strategy, observed)))
                    for each in measures.values()
                ),
            )
            for scenario, observed in SETTINGS
            for strategy in STRATEGIES
        ),
    )


def _acts(results: Results) -> Table:
    return Table(
        name="acts",
        title="What optional communicators do in the first ten steps",
        caption="Share of agents per step, greedily in validation; means over trials with 95% "
        "intervals. Tables 3.3 and 3.4 show single episodes of two of these settings.",
        columns=("scenario", "filling", *ACTS),
        rows=tuple(
            (
                scenario,
                filling_word(observed),
                *(
                    measured(
                        results.trials(
                            measure.share_of_act(act), Condition(scenario, "optional", observed)
                        )
                    )
                    for act in ACTS
                ),
            )
            for scenario, observed in SETTINGS
        ),
    )


def _best(results: Results, condition: Condition) -> Measured | None:
    """A maximum over trials says nothing of other trials: it has a range, and no interval."""
    values = results.trials(measure.best_return, condition).values
    if values is None:
        return None
    return Measured(
        value=float(values.max()),
        low=float(values.min()),
        high=float(values.max()),
        published=MAX_VALIDATION_RETURN[condition],
        bounds="range",
    )
