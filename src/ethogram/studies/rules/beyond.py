"""Claims 7 to 13, which are ours: among other drivers, before a stopped car, by the fines.

They take up what section 4.6 leaves to future work.  "Lower" is by more than 10%, of distance by
more than 5%; drivers leave the right lane "then, and only then" if they do so in more than half of
the approaches to a stopped car and in less than a tenth of those to none.  After training, with
restored cars, in traffic of 40 cars.
"""

from ethogram.core.findings import Side
from ethogram.studies.rules import results as measure
from ethogram.studies.rules.comparing import (
    COLLISIONS,
    FINES_UPDATES,
    LESS_EFFICIENT,
    LOWER,
    SHARE,
    SPEED,
    STATED,
    USUAL,
    lower,
    needs,
)
from ethogram.studies.rules.condition import NO_RULES, RULES, Condition, Fines
from ethogram.studies.rules.results import Results
from ethogram.studies.rules.validation import Group
from ethogram.studies.statistics import ClaimSpec, Part

WITH, WITHOUT = Condition(RULES), Condition(NO_RULES)
CAREFUL = ("MOBIL", "Krauss", "obedient")  # kinds of human drivers who mean no harm
SOME = (0.25, 0.5, 0.75)  # shares of them
HALF, HARDLY = 0.5, 0.1  # of the approaches
NO_INTERSECTION, NO_DISTANCE, NO_RIGHT_LANE = (
    Condition(RULES._replace(**{rule: 0.0})) for rule in Fines._fields
)
TWICE_DISTANCE = Condition(RULES._replace(distance=2.0))


def specs(results: Results) -> list[ClaimSpec]:
    """The claims, in the order of their numbers."""
    mixed, approached = results.having("mixed_collisions"), results.having("approach_collision")
    return [
        _safer_among_humans(mixed),
        _safer_for_humans(mixed),
        _reckless_harm(mixed),
        _then_and_only_then(approached),
        _avoids(approached),
        _distance_matters_most(results),
        _front(results),
    ]


def _safer_among_humans(results: Results) -> ClaimSpec:
    return ClaimSpec(
        number=7,
        statement="Also among human drivers those trained with rules collide less.",
        test="Where a fourth, half or three fourths of the drivers are human (MOBIL, Krauss or "
        "obedient ones), C of the trained drivers is lower by more than 10% if they were trained "
        "with rules.",
        parts=_among_humans(results, "driver"),
        needs=needs(results, [(WITH, WITHOUT)]),
        stated=STATED,
    )


def _safer_for_humans(results: Results) -> ClaimSpec:
    return ClaimSpec(
        number=8,
        statement="Human drivers collide less among drivers trained with rules.",
        test="In the same mixtures C of the human drivers is lower by more than 10% if the others "
        "were trained with rules.",
        parts=_among_humans(results, "human"),
        needs=needs(results, [(WITH, WITHOUT)]),
        stated=STATED,
    )


def _reckless_harm(results: Results) -> ClaimSpec:
    alone, among = (
        results.trials(measure.mixed("collisions", "reckless", share, "driver"), WITH)
        for share in (0.0, 0.5)
    )
    return ClaimSpec(
        number=9,
        statement="Reckless drivers make those trained with rules collide more.",
        test="Where half of the drivers are reckless, C of those trained with rules is higher by "
        "more than 10% than among themselves.",
        parts=(
            Part(
                label=f"{LOWER:g} C(half reckless) - C(none), {WITH.description}",
                terms=((LOWER, among), (-1.0, alone)),
                side="more than",
                margin=0.0,
                unit=COLLISIONS,
            ),
        ),
        needs=needs(results, [(WITH,)]),
        stated=STATED,
    )


def _then_and_only_then(results: Results) -> ClaimSpec:
    left = "left the right lane"
    return ClaimSpec(
        number=10,
        statement="Drivers trained with rules leave the right lane for a greater good, and only "
        "then.",
        test="Before a stopped car, for which they cannot brake any more, they leave the right "
        "lane in more than half of the approaches; with nobody ahead in less than a tenth.",
        parts=(
            _approach(results, left, "left_lane", "blocked", "more than", HALF),
            _approach(results, left, "left_lane", "clear", "less than", HARDLY),
        ),
        needs=needs(results, [(WITH,)]),
        stated=STATED,
    )


def _avoids(results: Results) -> ClaimSpec:
    return ClaimSpec(
        number=11,
        statement="Drivers trained with rules get past a stopped car for which they cannot brake.",
        test="They collide in less than half of the approaches.",
        parts=(_approach(results, "collided", "collision", "blocked", "less than", HALF),),
        needs=needs(results, [(WITH,)]),
        stated=STATED,
    )


def _distance_matters_most(results: Results) -> ClaimSpec:
    collisions = measure.in_traffic("collisions", USUAL)
    others = (NO_INTERSECTION, NO_RIGHT_LANE)
    return ClaimSpec(
        number=12,
        statement="Of the three rules the distance rule makes driving safe.",
        test="Without its fine C is higher by more than 10% than without the fine of either other "
        "rule.",
        parts=tuple(
            lower(results, "C", collisions, at, NO_DISTANCE, LOWER, COLLISIONS) for at in others
        ),
        needs=needs(results, [(NO_DISTANCE, *others)], FINES_UPDATES),
        stated=STATED,
    )


def _front(results: Results) -> ClaimSpec:
    measures: tuple[tuple[str, str, float, str], ...] = (
        ("C", "collisions", LOWER, COLLISIONS),
        ("E", "efficiency", LESS_EFFICIENT, SPEED),
    )
    return ClaimSpec(
        number=13,
        statement="A higher fine for short distances buys safety with efficiency.",
        test="With twice the fine of the distance rule C is lower by more than 10%, and E by more "
        "than 5%, than without it.",
        parts=tuple(
            lower(
                results,
                what,
                measure.in_traffic(name, USUAL),
                TWICE_DISTANCE,
                NO_DISTANCE,
                share,
                unit,
            )
            for what, name, share, unit in measures
        ),
        needs=needs(results, [(TWICE_DISTANCE, NO_DISTANCE)], FINES_UPDATES),
        stated=STATED,
    )


def _among_humans(results: Results, group: Group) -> tuple[Part, ...]:
    return tuple(
        lower(
            results,
            f"C of {group}s, {share:.0%} {kind}",
            measure.mixed("collisions", kind, share, group),
            WITH,
            WITHOUT,
            LOWER,
            COLLISIONS,
        )
        for kind in CAREFUL
        for share in SOME
    )


def _approach(results: Results, what: str, name: str, road: str, side: Side, margin: float) -> Part:
    return Part(
        label=f"{what}, road {road}, {WITH.description}",
        terms=((1.0, results.trials(measure.approach(name, road), WITH)),),
        side=side,
        margin=margin,
        unit=SHARE,
    )
