"""The six claims of the chapter as tests; four of them await the tasks.

The unit is a body: of a run of evolution the best one, of a baseline each that was drawn.  Margins
are zero.  Claim 1: "every baseline" is the mean of pseudo-random and of random bodies, and each of
the four hand-made ones.  Claims 2, 3, 4, 6 and the second half of claim 5 compare how bodies do in
locomotion, jump and escape; nothing of that has been run.

The claims are about evolution of 1000 bodies for 200 generations: after less they are tested to
show where they point, and left undecided.
"""

from ethogram.campaign.study import Records
from ethogram.core.findings import Claim, Side
from ethogram.studies.chapter import attribute
from ethogram.studies.criticality.condition import HAND_MADE, Condition
from ethogram.studies.criticality.results import Results, score
from ethogram.studies.statistics import ClaimSpec, Need, Part, Trials, difference, judge

GENERATIONS, POPULATION = 200, 1000  # that the chapter speaks of
SCORE, RANK, VELOCITY = "score", "rank", "m/s"  # units
STATED = "2026-11-30"
EVOLVED, RND, PSRND = (Condition(name) for name in ("evolved", "rnd", "psrnd"))


def claims(records: Records) -> list[Claim]:
    """All six claims, judged together."""
    results = Results.of(records)
    return judge(
        [
            _evolved_most_critical(results),
            _first_in_locomotion(),
            _poor_at_escape(),
            _evolved_most_adaptable(),
            _random_more_critical(results),
            _evolved_lead_with_networks(),
        ]
    )


def _evolved_most_critical(results: Results) -> ClaimSpec:
    evolved = results.trials(score, EVOLVED)
    drawn = [
        Part(
            label=f"score, evolved - {at.bodies}",
            terms=difference(evolved, results.trials(score, at)),
            side="more than",
            margin=0.0,
            unit=SCORE,
        )
        for at in (RND, PSRND)
    ]
    return ClaimSpec(
        number=1,
        statement="Evolved bodies score higher criticality than every baseline.",
        source="section 6.5.1, figure 6.3",
        test="The mean score of evolved bodies is above that of random and of pseudo-random "
        "bodies, and above the score of each hand-made one.",
        parts=(*drawn, *_above_hand_made(results, evolved)),
        needs=_needs(results),
        stated=STATED,
    )


def _above_hand_made(results: Results, evolved: Trials) -> list[Part]:
    hand_made = results.by_condition.get(Condition("hand_made"))
    parts = []
    for place, body in enumerate(HAND_MADE):
        known = hand_made is not None
        parts.append(
            Part(
                label=f"score, evolved, beside that of {body}",
                terms=((1.0, evolved if known else Trials(f"{body}, hand-made", None)),),
                side="more than",
                margin=float(hand_made["score"][place]) if hand_made is not None else 0.0,
                unit=SCORE,
            )
        )
    return parts


def _random_more_critical(results: Results) -> ClaimSpec:
    return ClaimSpec(
        number=5,
        statement="Random bodies score higher criticality than pseudo-random ones, and some "
        "outrank evolved ones.",
        source="section 6.5.2, figure 6.3, table 6.3",
        test="The mean score of random bodies is above that of pseudo-random ones; and the best "
        "average rank over the tasks among random and evolved bodies goes to a random one.",
        parts=(
            Part(
                label="score, rnd - psrnd",
                terms=difference(results.trials(score, RND), results.trials(score, PSRND)),
                side="more than",
                margin=0.0,
                unit=SCORE,
            ),
            _unknown("average rank, best rnd - best evolved", RANK, "less than"),
        ),
        needs=(),
        stated=STATED,
    )


def _first_in_locomotion() -> ClaimSpec:
    return ClaimSpec(
        number=2,
        statement="Hand-made bodies take the first four places in locomotion.",
        source="section 6.5.2, table 6.2",
        test="With the phase controller the velocity of each hand-made body, mean over runs, is "
        "above that of the fastest evolved one.",
        parts=tuple(
            _unknown(f"velocity, {body} - fastest evolved", VELOCITY, "more than")
            for body in HAND_MADE
        ),
        needs=(),
        stated=STATED,
    )


def _poor_at_escape() -> ClaimSpec:
    return ClaimSpec(
        number=3,
        statement="Hand-made bodies are poor at escape.",
        source="section 6.5.2, table 6.2",
        test="With the phase controller the velocity in escape of each hand-made body, mean over "
        "runs, is below the mean of the evolved ones.",
        parts=tuple(
            _unknown(f"velocity in escape, {body} - mean of evolved", VELOCITY, "less than")
            for body in HAND_MADE
        ),
        needs=(),
        stated=STATED,
    )


def _evolved_most_adaptable() -> ClaimSpec:
    return ClaimSpec(
        number=4,
        statement="The best average rank among evolved and hand-made bodies goes to an evolved "
        "one.",
        source="section 6.5.2, table 6.2",
        test="With the phase controller the least average rank over the three tasks of an evolved "
        "body is below that of any hand-made one.",
        parts=(_unknown("average rank, best evolved - best hand-made", RANK, "less than"),),
        needs=(),
        stated=STATED,
    )


def _evolved_lead_with_networks() -> ClaimSpec:
    return ClaimSpec(
        number=6,
        statement="With the neural controller evolved bodies lead.",
        source="section 6.5.2, table 6.4",
        test="With the neural controller the mean of the evolved bodies' average ranks over the "
        "three tasks is below that of the hand-made ones, and of the random ones.",
        parts=(
            _unknown("average rank, evolved - hand-made", RANK, "less than"),
            _unknown("average rank, evolved - rnd", RANK, "less than"),
        ),
        needs=(),
        stated=STATED,
    )


def _unknown(label: str, unit: str, side: Side) -> Part:
    """What nothing has been run for yet."""
    terms = ((1.0, Trials("the tasks locomotion, jump and escape", None)),)
    return Part(label=label, terms=terms, side=side, margin=0.0, unit=unit)


def _needs(results: Results) -> tuple[Need, ...]:
    return (
        Need(
            verb="evolved for",
            unit="generations",
            needed=GENERATIONS,
            run=results.least(attribute("generations"), [EVOLVED]),
        ),
        Need(
            verb="evolved with",
            unit="bodies",
            needed=POPULATION,
            run=results.least(attribute("population_size"), [EVOLVED]),
        ),
    )
