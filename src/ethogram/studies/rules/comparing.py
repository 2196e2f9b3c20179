"""How claims compare conditions: margins, units, and what they need."""

from collections.abc import Iterable, Sequence

from ethogram.studies.chapter import Measure, attribute
from ethogram.studies.rules.condition import Condition
from ethogram.studies.rules.results import Results
from ethogram.studies.statistics import Need, Part

STATED = "2026-11-30"
UPDATES, STEPS = 500, 500  # that the chapter speaks of
FINES_UPDATES = 200  # that our claims about fines speak of
LOWER, LESS_EFFICIENT, MUCH_LOWER = 0.9, 0.95, 0.5  # of the larger value
USUAL = 40  # n_car of training
COLLISIONS, SPEED, SHARE = "collisions", "m/s, summed over steps", "share"  # units


def lower(
    results: Results,
    what: str,
    measure: Measure,
    one: Condition,
    other: Condition,
    share: float,
    unit: str,
) -> Part:
    """That a measure is lower in one condition than a share of what it is in another."""
    return Part(
        label=f"{share:g} {what}({other.description}) - {what}({one.description})",
        terms=((share, results.trials(measure, other)), (-1.0, results.trials(measure, one))),
        side="more than",
        margin=0.0,
        unit=unit,
    )


def needs(
    results: Results, compared: Iterable[Sequence[Condition]], updates: int = UPDATES
) -> tuple[Need, ...]:
    """The training that a claim speaks of, and the least that any of some conditions had."""
    every = [at for conditions in compared for at in conditions]
    return tuple(
        Need(verb=verb, unit=unit, needed=needed, run=results.least(attribute(unit), every))
        for verb, unit, needed in (
            ("trained for", "updates", updates),
            ("in episodes of", "steps", STEPS),
        )
    )
