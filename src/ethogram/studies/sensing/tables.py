"""Tables 5.1 to 5.3 beside their published numbers, what validation keeps, and the behaviours."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from ethogram.campaign.study import Records
from ethogram.core.findings import Cell, Measured, Table
from ethogram.studies.sensing.behaviour import maps_available, silhouettes, spreads
from ethogram.studies.sensing.condition import (
    FITNESS,
    MORPHOLOGIES,
    OUTPUTS,
    SCENARIOS,
    VALIDATION,
    Condition,
    non_sensing,
)
from ethogram.studies.sensing.published import (
    EVEN_FITNESS,
    EVEN_P,
    PARAMETERS,
    UNEVEN_DISTANCE,
    UNEVEN_RATIO,
)
from ethogram.studies.sensing.results import (
    VALIDATED,
    Results,
    distance,
    diverged,
    from_rest,
    is_over_starts,
    over_starts,
    ratio,
    ratios_above_one,
    sound,
    start_spread,
    trained,
    u_test,
)
from ethogram.studies.statistics import holm, measured

KIND = ("morphology", "controller", "law")  # columns
NO_MAPS = (
    " The maps of figures 5.5 and 5.6 are left out: they need scikit-learn, which is not here (pip "
    "install 'ethogram[analysis]')."
)


class Place(NamedTuple):
    """What a row is about."""

    scenario: str
    condition: Condition


def tables(records: Records) -> list[Table]:
    """Every table of which a row was run."""
    results = Results.of(records)
    if not results.by_condition:
        return []
    made = [
        _table_5_1(results),
        _table_5_2(results),
        _table_5_3(results),
        _starts(results),
        _validation(results),
        _behaviour(results),
    ]
    return [table for table in made if table.rows]


def _table_5_1(results: Results) -> Table:
    run = {
        "n_gen": _attributes(results, "generations"),
        "n_sim": _attributes(results, "steps"),
    }
    return Table(
        name="table-5-1",
        title="Table 5.1: Parameters",
        caption="As the thesis prints them, how they are read here unless the settings say else, "
        "and what these records were run with where they tell.",
        columns=("parameter", "what it is", "thesis", "how it is read", "run with"),
        rows=tuple((*row, run.get(row[0])) for row in PARAMETERS),
    )


def _attributes(results: Results, name: str) -> str:
    found = {int(data.attrs[name]) for data in results.by_condition.values()}
    return ", ".join(f"{value:,}".replace(",", " ") for value in sorted(found))


def _table_5_2(results: Results) -> Table:
    places = [Place(FITNESS, at) for at in results.on("even")]
    p_values = _p_values(results, places)
    rows: list[tuple[Cell, ...]] = []
    for place in places:
        at = place.condition
        rows.append(
            (
                *_kind(at),
                *_distance(results, place, EVEN_FITNESS.get((at.body, at.controller))),
                *p_values.get(place, (None, None)),
                EVEN_P.get(at.body) if at.controller == "sensing" else None,
                diverged(results.by_condition[at]),
            )
        )
    return Table(
        name="table-5-2",
        title="Table 5.2: Even surface, fitness of the best robot at the end of evolution",
        caption="In mm, mean over runs with a 95% interval, and standard deviation. p: "
        "Mann-Whitney U test, two-sided, against the non-sensing controller of the same body; "
        "corrected: by Holm, over the comparisons of this table. Broken robots: of all that were "
        "evaluated; their fitness is the worst. The thesis' deviation of the non-sensing tripod is "
        f"263 in its text.{_mean_over_starts(results, places)}{_undefined(results, places)}",
        columns=(
            *KIND,
            "runs",
            "fitness, mean",
            "fitness, deviation",
            "p",
            "p, corrected",
            "p, thesis",
            "diverged robots",
        ),
        rows=tuple(rows),
    )


def _table_5_3(results: Results) -> Table:
    places = [Place(*place) for place in product(SCENARIOS["uneven"], results.on("uneven"))]
    p_values = _p_values(results, places)
    rows: list[tuple[Cell, ...]] = []
    for place in places:
        scenario, at = place
        key = scenario, at.body, at.controller
        kept = None
        if scenario != FITNESS:
            kept = ratio(results.by_condition[at], scenario, UNEVEN_RATIO.get(key))
        rows.append(
            (
                scenario,
                *_kind(at),
                *_distance(results, place, UNEVEN_DISTANCE.get(key)),
                kept,
                *p_values.get(place, (None, None)),
                diverged(results.by_condition[at]) if scenario == FITNESS else None,
            )
        )
    return Table(
        name="table-5-3",
        title="Table 5.3: Uneven surface, fitness and distance in the validation scenarios",
        caption="Of the best robot at the end of evolution, in mm, mean over runs with a 95% "
        "interval, and standard deviation. Ratio: mean distance over mean fitness. p: "
        "Mann-Whitney U test, two-sided, against the non-sensing controller of the same body in "
        "the same scenario; corrected: by Holm, over the comparisons of this table. Broken robots: "
        "in evolution. In step, gravity pulls along x in the second half: who lets go of the "
        "floor gets ahead."
        f"{_mean_over_starts(results, places)}{_undefined(results, places)}",
        columns=(
            "scenario",
            *KIND,
            "runs",
            "distance, mean",
            "distance, deviation",
            "ratio",
            "p",
            "p, corrected",
            "diverged robots",
        ),
        rows=tuple(rows),
    )


def _starts(results: Results) -> Table:
    """What is left of a fitness where robots start as they never did in evolution."""
    rows: list[tuple[Cell, ...]] = []
    for at, data in results.by_condition.items():
        if VALIDATED not in data:
            continue
        measures = trained, from_rest(FITNESS), over_starts(FITNESS)
        spread = sound(results.trials(start_spread(FITNESS), at)).values
        rows.append(
            (
                at.surface,
                *_kind(at),
                int(data.attrs["starts"]),
                data.sizes["start"],
                *(measured(sound(results.trials(measure, at))) for measure in measures),
                None if spread is None else float(spread.mean()),
            )
        )
    return Table(
        name="starts",
        title="Fitness in training and on fresh starts",
        caption="Of the best robot at the end of evolution, in mm, mean over runs with a 95% "
        "interval. Fitness in training is the mean over the starts that every robot of the "
        "evolution had; where that is one, the start at rest. Fresh starts differ from rest as "
        "much, and are others. Spread: standard deviation over fresh starts, mean over runs.",
        columns=(
            "surface",
            *KIND,
            "starts in training",
            "fresh starts",
            "fitness in training",
            "distance from rest",
            "distance from fresh starts",
            "spread over fresh starts",
        ),
        rows=tuple(rows),
    )


def _validation(results: Results) -> Table:
    """Claim 4 as the thesis counts it."""
    run = [at for at in results.on("uneven") if at.body in MORPHOLOGIES]
    rows: list[tuple[Cell, ...]] = []
    for controller, law in dict.fromkeys((at.controller, at.law_words) for at in run):
        own = [at for at in run if at.law_words == law]
        cases = len(own) * len(VALIDATION)
        printed = [
            value > 1
            for (_, body, kind), value in UNEVEN_RATIO.items()
            if kind == controller and body in {at.body for at in own}
        ]
        counted = ratios_above_one([results.by_condition[at] for at in own], sum(printed))
        rows.append((controller, law, cases, counted))
    return Table(
        name="validation",
        title="Cases in which robots go further in validation than in evolution",
        caption="Uneven surface. A case is a body in a validation scenario; counted are those in "
        "which the ratio of Table 5.3 is above 1. "
        "The thesis' numbers are those of the same bodies.",
        columns=("controller", "law", "cases", "ratio above 1"),
        rows=tuple(rows),
    )


def _behaviour(results: Results) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for at in results.by_condition:
        other = non_sensing(at.body, at.surface)
        if at.law not in OUTPUTS or not results.comparable(at, other):
            continue
        for scenario in SCENARIOS[at.surface]:
            mine, theirs = (_moving(results, one, scenario) for one in (at, other))
            if len(mine) == 0 or len(theirs) == 0:
                continue
            near = silhouettes(mine, theirs)
            rows.append(
                (
                    at.surface,
                    scenario,
                    at.body,
                    at.law_words,
                    float(near.other.mean()),
                    float(near.one.mean()),
                    _spread(theirs),
                    _spread(mine),
                )
            )
    return Table(
        name="behaviour",
        title="Behaviours of the two kinds of controller",
        caption="Behaviour: magnitudes of the Fourier transforms of the best robot's path, x and "
        "z. Silhouette: how much nearer a run is to its own kind than to the other, from -1 to 1, "
        "mean over runs. Spread: distance of a run from the mean behaviour of its kind, in mm, "
        "mean over runs. Intervals stand with the claims."
        f"{'' if maps_available() else NO_MAPS}",
        columns=(
            "surface",
            "scenario",
            "morphology",
            "outputs of sensing",
            "silhouette, non-sensing",
            "silhouette, sensing",
            "spread, non-sensing",
            "spread, sensing",
        ),
        rows=tuple(rows),
    )


def _moving(results: Results, at: Condition, scenario: str) -> np.ndarray:
    """The behaviours of the runs whose best robot stayed whole."""
    found = results.behaviours(at, scenario)
    return found[np.isfinite(found).all(1)]


def _spread(runs: np.ndarray) -> float | None:
    return None if len(runs) < 2 else float(spreads(runs).mean())


def _kind(at: Condition) -> tuple[str, str, str]:
    return at.body, at.controller, at.law_words


def _distance(
    results: Results, place: Place, printed: tuple[float, float] | None
) -> tuple[Cell, ...]:
    """Number of runs that have a distance, its mean, and its deviation over runs."""
    trials = sound(results.trials(distance(place.scenario), place.condition))
    values = np.empty(0) if trials.values is None else trials.values
    mean, deviation = printed or (None, None)
    spread = None
    if values.size > 1:
        spread = Measured(value=float(values.std(ddof=1)), published=deviation)
    return values.size, measured(trials, published=mean), spread


def _p_values(results: Results, places: Sequence[Place]) -> Mapping[Place, tuple[float, float]]:
    """Of every comparison of sensing with non-sensing: p, and p corrected for all of them."""
    found: dict[Place, float] = {}
    for place in places:
        scenario, at = place
        other = non_sensing(at.body, at.surface)
        if at.controller == "sensing":
            sides = (results.trials(distance(scenario), one) for one in (at, other))
            p_value = u_test(*sides)
            if p_value is not None:
                found[place] = p_value
    corrected = holm(list(found.values()))
    return {
        place: (found[place], each.p_value) for place, each in zip(found, corrected, strict=True)
    }


def _mean_over_starts(results: Results, places: Sequence[Place]) -> str:
    """What a distance is where fitness is a mean over starts."""
    if not any(is_over_starts(results.by_condition[at]) for _, at in places):
        return ""
    return " A distance, and a fitness, is the mean over fresh starts (see below)."


def _undefined(results: Results, places: Sequence[Place]) -> str:
    """Which runs are left out, because their best robot diverged."""
    lacking = []
    for scenario, at in places:
        values = results.trials(distance(scenario), at).values
        gone = 0 if values is None else int(np.count_nonzero(~np.isfinite(values)))
        if gone:
            lacking.append(f"{gone} of {at.description}, {scenario}")
    return f" Left out, as the best robot diverged: {'; '.join(lacking)}." if lacking else ""
