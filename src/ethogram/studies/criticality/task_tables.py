"""Tables 6.2 and 6.3, measured: how bodies do in the tasks, and their ranks."""

import numpy as np

from ethogram.core.findings import Cell, Measured, Table
from ethogram.studies.criticality.found import group_of
from ethogram.studies.criticality.published import PENALISED
from ethogram.studies.criticality.results import TaskResults, penalised
from ethogram.studies.criticality.tasks import THESIS_TASKS, TaskCondition
from ethogram.studies.statistics import measured

UNITS = {"locomotion": "m/s", "jump": "m", "escape": "m/s"}


def task_tables(results: TaskResults) -> list[Table]:
    """Every table of which a row was run."""
    made = [_performance(results), _penalised(results)]
    return [table for table in made if table.rows]


def _performance(results: TaskResults) -> Table:
    bodies = results.bodies
    ranks = results.average_ranks([body for body in bodies if results.is_complete(body)])
    rows: list[tuple[Cell, ...]] = []
    for body in bodies:
        each = [measured(results.of_task(body, task)) for task in THESIS_TASKS]
        rows.append((body, *each, measured(ranks[body]) if body in ranks else None))
    ranked = sorted(
        rows, key=lambda row: row[-1].value if isinstance(row[-1], Measured) else np.inf
    )
    return Table(
        name="tasks",
        title="How bodies do in the tasks",
        caption="Of the best phase controller of each run: mean over runs with a 95% interval. "
        "Average rank: over the three tasks, among all bodies that were run in them, run by run; "
        "the best body is 1.",
        columns=("body", *(f"{task}, {UNITS[task]}" for task in THESIS_TASKS), "average rank"),
        rows=tuple(ranked),
    )


def _penalised(results: TaskResults) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for body in results.bodies:
        cells: list[Cell] = []
        for task in THESIS_TASKS:
            found = results.trials(penalised, TaskCondition(body, task, "phase")).values
            printed = PENALISED.get(body, {}).get(task)
            value = (
                None
                if found is None
                else Measured(value=float(np.median(found)), published=printed)
            )
            cells.append(value)
        rows.append((body, group_of(body), *cells))
    return Table(
        name="table-6-2",
        title="Tables 6.2 and 6.3: fitness made less by energy",
        caption="v / (1 + 400 P) in thousandths, of the best phase controller of each run: median "
        "over runs. P is the mean over voxels and steps of u^2 where a voxel pushes beyond its "
        "resting area. The thesis prints such a number and does not say so: its scale fits. It is "
        "compared for hand-made bodies, which are the same there. Controllers were evolved for the "
        "fitness without energy.",
        columns=("body", "kind", *THESIS_TASKS),
        rows=tuple(rows),
    )
