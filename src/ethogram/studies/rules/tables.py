"""Tables: R, E and C, traffic, other drivers, the stopped car, fines, and readings."""

from ethogram.campaign.study import Records
from ethogram.core.findings import Cell, Measured, Table
from ethogram.studies.chapter import Measure
from ethogram.studies.rules import results as measure
from ethogram.studies.rules import robustness
from ethogram.studies.rules.comparing import USUAL
from ethogram.studies.rules.condition import Condition
from ethogram.studies.rules.results import Results
from ethogram.studies.rules.validation import ACTING, GROUPS, HUMANS, ROADS, SHARES, TRAFFIC
from ethogram.studies.statistics import measured
from ethogram.worlds.traffic.rules import RULES

WHERE = "drivers"
MEANS = "Means over trials with 95% intervals"


def tables(records: Records) -> list[Table]:
    """Every table that the records have data for."""
    results = Results.of(records)
    if not results.by_condition:
        return []
    found = [_training(results), _after(results), _traffic(results)]
    if results.having("mixed_collisions").by_condition:
        found.append(_mixed(results.having("mixed_collisions")))
    if results.having("approach_collision").by_condition:
        found.append(_approaches(results.having("approach_collision")))
    verdicts = robustness.rows(results)
    return [*found, *([_robustness(verdicts)] if len(verdicts) > 1 else [])]


def _training(results: Results) -> Table:
    measures: dict[str, Measure] = {
        "R": measure.training_return,
        "E": measure.training_efficiency,
        "standard deviation of E among cars": measure.training_deviation,
        "C": measure.training_collisions,
    }
    return _by_condition(
        results,
        measures,
        name="training",
        title="At the end of training",
        caption=f"{MEANS}, over the last tenth of the updates and over cars. The thesis prints no "
        "numbers.",
    )


def _after(results: Results) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for at in results.by_condition:
        for acting in ACTING:
            measures = [
                measure.in_traffic(name, USUAL, acting)
                for name in ("return", "efficiency", "deviation", "collisions")
            ]
            measures.insert(2, measure.alive_efficiency(USUAL, acting))
            measures += [measure.breaches(rule, USUAL, acting) for rule in RULES]
            rows.append(
                (at.description, acting, *(measured(results.trials(each, at)) for each in measures))
            )
    return Table(
        name="after-training",
        title=f"After training, in traffic of {USUAL} cars",
        caption=f"{MEANS}, over cars and episodes. Actions are drawn from the policy, as in "
        "training, or the most probable ones (greedy). E of the living leaves out what cars drive "
        "under their impact. The last columns are shares of the steps in which a car breaks a "
        "rule, fined or not.",
        columns=(
            WHERE,
            "actions",
            "R",
            "E",
            "E of the living",
            "standard deviation of E among cars",
            "C",
            *(f"{rule} rule broken" for rule in RULES),
        ),
        rows=tuple(rows),
    )


def _traffic(results: Results) -> Table:
    rows = tuple(
        (
            at.description,
            what,
            *(measured(results.trials(measure.overall(name, cars), at)) for cars in TRAFFIC),
        )
        for at in results.by_condition
        for what, name in (("distance, m", "distance"), ("collisions", "collisions"))
    )
    return Table(
        name="traffic",
        title="Overall distance and collisions by traffic",
        caption=f"Figure 4.6 in numbers: of all cars together in an episode. {MEANS}.",
        columns=(WHERE, "of all cars", *(f"{cars} cars" for cars in TRAFFIC)),
        rows=rows,
    )


def _mixed(results: Results) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for at in results.by_condition:
        for human in HUMANS:
            for share in SHARES:
                cells: list[Cell] = []
                for group in GROUPS:
                    empty = share == (1.0 if group == "driver" else 0.0)
                    for name in ("efficiency", "collisions"):
                        each = measure.mixed(name, human, share, group)
                        cells.append(None if empty else measured(results.trials(each, at)))
                rows.append((at.description, human, share, *cells))
    return Table(
        name="among-humans",
        title="Among human drivers",
        caption=f"Both groups, by the share and the kind of human drivers. {MEANS}.",
        columns=(WHERE, "human drivers", "their share", "E", "C", "E, human", "C, human"),
        rows=tuple(rows),
    )


def _approaches(results: Results) -> Table:
    names = {
        "left the right lane": "left_lane",
        "collided": "collision",
        "broke the right lane rule": "right_lane_rule",
        "steps that break the distance rule": "distance_rule",
    }
    rows = tuple(
        (
            at.description,
            road,
            *(
                measured(results.trials(measure.approach(name, road), at))
                for name in names.values()
            ),
        )
        for at in results.by_condition
        for road in ROADS
    )
    return Table(
        name="approaches",
        title="Before a stopped car",
        caption="Shares of the approaches at 10 to 13 m/s to a car that stands in the right lane, "
        "20 m ahead or more and too near to brake for (blocked), or to the same place with nobody "
        f"there (clear). {MEANS}.",
        columns=(WHERE, "road", *names),
        rows=rows,
    )


def _robustness(found: list[robustness.Row]) -> Table:
    numbers = [claim.number for claim in found[0].claims]
    return Table(
        name="robustness",
        title="Robustness: the chapter's claims under other readings of the text",
        caption="With restored cars alone, however long the training. Holm's correction is within "
        "a row. No row is a verdict.",
        columns=("what is read otherwise", *(f"claim {number}" for number in numbers)),
        rows=tuple((row.description, *(claim.verdict for claim in row.claims)) for row in found),
    )


def _by_condition(
    results: Results, measures: dict[str, Measure], *, name: str, title: str, caption: str
) -> Table:
    rows = tuple(
        (at.description, *(_cell(results, each, at) for each in measures.values()))
        for at in results.by_condition
    )
    return Table(name=name, title=title, caption=caption, columns=(WHERE, *measures), rows=rows)


def _cell(results: Results, each: Measure, at: Condition) -> Measured | None:
    return measured(results.trials(each, at))
