"""Tables of scores, of the threshold test and of evolution, beside published numbers."""

import numpy as np

from ethogram.campaign.study import Records
from ethogram.core.findings import Cell, Measured, Table
from ethogram.studies.criticality.condition import Condition
from ethogram.studies.criticality.plan import EVOLVED
from ethogram.studies.criticality.published import SCORES, mean_score
from ethogram.studies.criticality.results import (
    SQUARES,
    Results,
    TaskResults,
    Thresholds,
    score,
    sizes,
)
from ethogram.studies.criticality.task_tables import task_tables
from ethogram.studies.statistics import Trials, measured
from ethogram.worlds.softbody.criticality import THRESHOLD

POWERS = (3, 4, 7)  # of ten, in which coefficients are printed
RULED_OUT = 0.1  # a p-value below which a power law is (Clauset, Shalizi and Newman, 2009)


def tables(records: Records) -> list[Table]:
    """Every table of which a row was run."""
    results = Results.of(records)
    made = [_scores(results), _bodies(results), _thresholds(results), _evolution(results)]
    return [*(table for table in made if table.rows), *task_tables(TaskResults.of(records))]


def _scores(results: Results) -> Table:
    rows = []
    for at, data in results.scored.items():
        mean = measured(results.trials(score, at), published=mean_score(at.bodies))
        others = [
            measured(Trials(name, data[name].values.astype(float)))
            for name in ("r_squared", "distance", "voxels")
        ]
        possible = int((data["law_p_value"].values >= RULED_OUT).sum())
        rows.append((at.description, data.sizes["trial"], mean, *others, possible))
    return Table(
        name="scores",
        title="Criticality of bodies",
        caption="Score f = R^2 + exp(-2 D), from 0 to 2: mean over bodies with a 95% interval; the "
        "published means are of the bodies of tables 6.2 and 6.3. R^2: of the straight line "
        "through the logarithms of avalanche sizes and of how often each occurs. D: largest "
        "difference of running sums. Last: bodies for which a power law is not ruled out, by the "
        "most likely one and the p-value of its fit (at least 0.1).",
        columns=("bodies", "number", "score", "R^2", "D", "voxels", "power law possible"),
        rows=tuple(rows),
    )


def _bodies(results: Results) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for at, data in results.scored.items():
        published = SCORES.get(at.bodies, ()) if at.bodies == "hand_made" else ()
        for trial, name in enumerate(results.bodies(at)):
            printed = published[trial] if trial < len(published) else None
            found = sizes(data, trial)
            rows.append(
                (
                    name,
                    int(data["voxels"][trial]),
                    Measured(value=float(data["score"][trial]), published=printed),
                    len(np.unique(found)),
                    int(found.max()),
                    int(data["duration"].values[trial].max()),
                    float(data["law_exponent"][trial]),
                    float(data["law_p_value"][trial]),
                )
            )
    return Table(
        name="bodies",
        title="Each body",
        caption="Avalanches of each body, one for each of its voxels: how many sizes there are, "
        "the largest size (voxels) and the longest duration (steps of 1/60 s); exponent of the "
        "most likely power law, cut off at the number of voxels, and p-value of its fit.",
        columns=(
            "body",
            "voxels",
            "score",
            "sizes",
            "largest",
            "longest",
            "exponent",
            "p of the power law",
        ),
        rows=tuple(rows),
    )


def _thresholds(results: Results) -> Table:
    rows: list[tuple[Cell, ...]] = []
    data = results.by_condition.get(SQUARES)
    if data is not None:
        found = Thresholds(data)
        chosen = zip(found.sides, found.chosen, strict=True)
        rows = [(f"tau of {side} x {side}", float(tau)) for side, tau in chosen]
        rows += [
            (f"lambda {number} (1e-{power})", _coefficient(value, printed, power))
            for number, (value, printed, power) in enumerate(
                zip(found.coefficients, THRESHOLD, POWERS, strict=True), start=1
            )
        ]
    return Table(
        name="thresholds",
        title="Threshold of activity",
        caption="Of eleven thresholds from 5e-5 to 8e-3 that at which the sizes of a square "
        "body's avalanches vary the most, and the parabola in the number of voxels through these. "
        "Its coefficients stand beside those of the original's program; the thesis leaves them "
        "blank (Table 6.1).",
        columns=("quantity", "value"),
        rows=tuple(rows),
    )


def _coefficient(value: float, printed: float, power: int) -> Measured:
    """A coefficient in units of a power of ten, to ten decimals."""
    scale = 10.0**power
    return Measured(value=round(scale * float(value), 10), published=round(scale * printed, 10))


def _evolution(results: Results) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for name in EVOLVED:
        at = Condition(name)
        data = results.by_condition.get(at)
        if data is None:
            continue
        for trial, body in enumerate(results.bodies(at)):
            asked, scored = int(data["asked"][trial]), int(data["scored"][trial])
            best = data["best"].transpose("trial", "generation").values[trial]
            since = int(np.argmax(best == best[-1]))
            rows.append((body, float(best[-1]), since, asked, scored, 1 - scored / asked))
    return Table(
        name="evolution",
        title="Runs of evolution",
        caption="Best score of each run and the generation in which it was reached; bodies that "
        "were asked for, those that had to be simulated, and the share that was known.",
        columns=("run", "best score", "generation", "asked", "simulated", "known"),
        rows=tuple(rows),
    )
