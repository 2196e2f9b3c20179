"""The claims of the chapter as tests, and seven of our own beyond it.

E and C of claims 1 to 3 are those of the last tenth of training, where figures 4.4 and 4.5 end;
claims 4 to 6 speak of drivers after training.  Margins: "lower" is by more than 10% of the larger
of the two values, 5% for E; "much lower" is less than half.  Traffic is "saturated" if a third more
cars (from 60 to 80) drive at most 5% more distance together; collisions "keep growing" if every ten
cars more have more of them.

Claims 7 to 13 are ours.  They and the tests of all were stated before any plan of the study was
run; single trials of other learning rates, of other numbers of updates and of PPO with and without
scaled observations had been seen by then, and in them drivers with rules nearly stood still.  After
that two conditions with restored cars were run and seen; then the world changed (whom a restored
car may collide with), the preset `thesis` (rewards are scaled) and how far off the stopped car is,
and all was run anew.  The tests stayed.

The claims are about 500 updates and episodes of 500 steps; after less they are tested to show where
they point, and left undecided.
"""

from itertools import pairwise

from ethogram.campaign.study import Records
from ethogram.core.findings import Claim, Side
from ethogram.studies.chapter import Measure
from ethogram.studies.readings import DEFAULT
from ethogram.studies.rules import beyond
from ethogram.studies.rules import results as measure
from ethogram.studies.rules.comparing import (
    COLLISIONS,
    LESS_EFFICIENT,
    LOWER,
    MUCH_LOWER,
    SPEED,
    STATED,
    USUAL,
    lower,
    needs,
)
from ethogram.studies.rules.condition import COLLIDED, NO_RULES, RULES, Condition
from ethogram.studies.rules.results import Results
from ethogram.studies.rules.validation import TRAFFIC
from ethogram.studies.statistics import ClaimSpec, Part, judge

SATURATED = (60, 80, 1.05)  # cars, more cars, and the most that distance grows by
Pair = tuple[Condition, Condition]  # with rules, and without


def claims(records: Records) -> list[Claim]:
    """All claims, judged together."""
    results = Results.of(records)
    return judge([*of_the_chapter(results, pairs()), *beyond.specs(results)])


def pairs(reading: str = DEFAULT) -> list[Pair]:
    """What the chapter compares; under other readings with restored cars alone, the last pair."""
    scenarios = COLLIDED if reading == DEFAULT else COLLIDED[-1:]
    return [
        (Condition(RULES, collided, reading), Condition(NO_RULES, collided, reading))
        for collided in scenarios
    ]


def of_the_chapter(results: Results, compared: list[Pair]) -> list[ClaimSpec]:
    """Claims 1 to 6, of some pairs; 4 and 5 of the last."""
    return [
        _less_efficient(results, compared),
        _safer(results, compared),
        _more_equal(results, compared),
        _collisions_grow(results, compared[-1]),
        _saturates(results, compared[-1]),
        _safer_without_fines(results, compared),
    ]


def _less_efficient(results: Results, compared: list[Pair]) -> ClaimSpec:
    return _lower_with_rules(
        results,
        compared,
        ("E", measure.training_efficiency, LESS_EFFICIENT, SPEED),
        number=1,
        statement="Drivers trained with rules are less efficient: E is lower.",
        source="section 4.5, figures 4.4 and 4.5",
        test="At the end of training E with rules is lower than E without by more than 5%, "
        "whether cars that collided are removed or restored.",
    )


def _safer(results: Results, compared: list[Pair]) -> ClaimSpec:
    return _lower_with_rules(
        results,
        compared,
        ("C", measure.training_collisions, LOWER, COLLISIONS),
        number=2,
        statement="Drivers trained with rules are safer: C is lower.",
        source="section 4.5, figures 4.4 and 4.5",
        test="At the end of training C with rules is lower than C without by more than 10%, "
        "whether cars that collided are removed or restored.",
    )


def _more_equal(results: Results, compared: list[Pair]) -> ClaimSpec:
    return _lower_with_rules(
        results,
        compared,
        ("sd of E", measure.training_deviation, LOWER, SPEED),
        number=3,
        statement="Rules favour equity: with rules E differs less among cars.",
        source="section 4.5, figures 4.4 and 4.5",
        test="At the end of training the standard deviation of E among cars is lower with rules "
        "than without by more than 10%, whether cars that collided are removed or restored.",
    )


def _collisions_grow(results: Results, pair: Pair) -> ClaimSpec:
    without = pair[1]
    total = {level: measure.overall("collisions", level) for level in TRAFFIC}
    growing = [
        Part(
            label=f"C of all {more} cars - C of all {less}, {without.description}",
            terms=(
                (1.0, results.trials(total[more], without)),
                (-1.0, results.trials(total[less], without)),
            ),
            side="more than",
            margin=0.0,
            unit=COLLISIONS,
        )
        for less, more in pairwise(TRAFFIC)
    ]
    fewer = [
        lower(results, f"C of all {level} cars", total[level], *pair, MUCH_LOWER, COLLISIONS)
        for level in TRAFFIC
    ]
    return ClaimSpec(
        number=4,
        statement="Without rules collisions keep growing with traffic; with rules they stay much "
        "lower at every level.",
        source="section 4.5.1, figure 4.6",
        test="After training, with restored cars: without rules every ten cars more, from 10 to "
        "80, have more collisions together; with rules there are fewer than half of them at every "
        "level.",
        parts=(*growing, *fewer),
        needs=needs(results, [pair]),
        stated=STATED,
    )


def _saturates(results: Results, pair: Pair) -> ClaimSpec:
    less, more, most = SATURATED
    sides: tuple[Side, Side] = ("at most", "more than")
    return ClaimSpec(
        number=5,
        statement="With rules traffic is congested at some level: more cars drive no more distance "
        "together. Without rules it is not, up to 80 cars.",
        source="section 4.5.1, figure 4.6",
        test="After training, with restored cars: 80 cars drive at most 5% more distance together "
        "than 60 with rules, and more than that without.",
        parts=tuple(
            Part(
                label=f"distance of all {more} cars - {most} distance of all {less}, "
                f"{at.description}",
                terms=(
                    (1.0, results.trials(measure.overall("distance", more), at)),
                    (-most, results.trials(measure.overall("distance", less), at)),
                ),
                side=side,
                margin=0.0,
                unit="m",
            )
            for at, side in zip(pair, sides, strict=True)
        ),
        needs=needs(results, [pair]),
        stated=STATED,
    )


def _safer_without_fines(results: Results, compared: list[Pair]) -> ClaimSpec:
    return _lower_with_rules(
        results,
        compared,
        ("C", measure.in_traffic("collisions", USUAL), LOWER, COLLISIONS),
        number=6,
        statement="Rules also make driving safer when nobody is fined any more, after training.",
        source="section 4.6",
        test="After training, in traffic of 40 cars, C of drivers trained with rules is lower by "
        "more than 10% than C of drivers trained without, whether cars that collided are removed "
        "or restored.",
    )


def _lower_with_rules(
    results: Results,
    compared: list[Pair],
    what: tuple[str, Measure, float, str],
    *,
    number: int,
    statement: str,
    source: str,
    test: str,
) -> ClaimSpec:
    """That a measure (its name, itself, the share, its unit) is lower with rules in every pair."""
    name, measured, share, unit = what
    return ClaimSpec(
        number=number,
        statement=statement,
        source=source,
        test=test,
        parts=tuple(lower(results, name, measured, *pair, share, unit) for pair in compared),
        needs=needs(results, compared),
        stated=STATED,
    )
