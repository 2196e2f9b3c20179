"""The six claims of the chapter as tests; the sixth awaits the neural controller.

The unit is a body: of a run of evolution the best one, of a baseline each that was drawn.  Margins
are zero.  Claim 1: "every baseline" is the mean of pseudo-random and of random bodies, and each of
the four hand-made ones.  Claims 2, 3, 4, 6 and the second half of claim 5 compare how bodies do in
locomotion, jump and escape: their unit is the run of evolution of a controller.  Which body is the
best of its kind is read off the same runs.

The claims are about evolution of 1000 bodies for 200 generations, and of controllers for 10 000
births: after less they are tested to show where they point, and left undecided.
"""

from collections.abc import Sequence

import numpy as np

from ethogram.campaign.study import Records
from ethogram.core.findings import Claim, Side
from ethogram.studies.chapter import attribute
from ethogram.studies.criticality.condition import HAND_MADE, Condition
from ethogram.studies.criticality.found import EVOLVED as EVOLVED_BODIES
from ethogram.studies.criticality.found import RND as RANDOM
from ethogram.studies.criticality.results import Results, TaskResults, score
from ethogram.studies.statistics import ClaimSpec, Need, Part, Trials, difference, judge

GENERATIONS, POPULATION, BIRTHS = 200, 1000, 10_000  # that the chapter speaks of
SCORE, RANK, VELOCITY = "score", "rank", "m/s"  # units
STATED = "2026-11-30"
OPT = tuple(EVOLVED_BODIES)
EVOLVED, RND, PSRND = (Condition(name) for name in ("evolved", "rnd", "psrnd"))


def claims(records: Records) -> list[Claim]:
    """All six claims, judged together."""
    results, tasks = Results.of(records), TaskResults.of(records)
    return judge(
        [
            _evolved_most_critical(results),
            _first_in_locomotion(tasks),
            _poor_at_escape(tasks),
            _evolved_most_adaptable(tasks),
            _random_more_critical(results, tasks),
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


def _random_more_critical(results: Results, tasks: TaskResults) -> ClaimSpec:
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
            _ranked_before(tasks, tuple(RANDOM), OPT, "rnd", "evolved"),
        ),
        needs=(),
        stated=STATED,
    )


def _first_in_locomotion(tasks: TaskResults) -> ClaimSpec:
    fastest = _best(tasks, "locomotion")
    return ClaimSpec(
        number=2,
        statement="Hand-made bodies take the first four places in locomotion.",
        source="section 6.5.2, table 6.2",
        test="With the phase controller the velocity of each hand-made body, mean over runs, is "
        "above that of the fastest evolved one.",
        parts=tuple(
            Part(
                label=f"velocity, {body} - fastest evolved",
                terms=difference(tasks.of_task(body, "locomotion"), fastest),
                side="more than",
                margin=0.0,
                unit=VELOCITY,
            )
            for body in HAND_MADE
        ),
        needs=_task_needs(tasks),
        stated=STATED,
    )


def _poor_at_escape(tasks: TaskResults) -> ClaimSpec:
    share = -1 / len(OPT)
    evolved = tuple((share, tasks.of_task(body, "escape")) for body in OPT)
    return ClaimSpec(
        number=3,
        statement="Hand-made bodies are poor at escape.",
        source="section 6.5.2, table 6.2",
        test="With the phase controller the velocity in escape of each hand-made body, mean over "
        "runs, is below the mean of the evolved ones.",
        parts=tuple(
            Part(
                label=f"velocity in escape, {body} - mean of evolved",
                terms=((1.0, tasks.of_task(body, "escape")), *evolved),
                side="less than",
                margin=0.0,
                unit=VELOCITY,
            )
            for body in HAND_MADE
        ),
        needs=_task_needs(tasks),
        stated=STATED,
    )


def _evolved_most_adaptable(tasks: TaskResults) -> ClaimSpec:
    return ClaimSpec(
        number=4,
        statement="The best average rank among evolved and hand-made bodies goes to an evolved "
        "one.",
        source="section 6.5.2, table 6.2",
        test="With the phase controller the least average rank over the three tasks of an evolved "
        "body is below that of any hand-made one. Run by run bodies are ranked among evolved and "
        "hand-made ones.",
        parts=(_ranked_before(tasks, OPT, tuple(HAND_MADE), "evolved", "hand-made"),),
        needs=_task_needs(tasks),
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


def _best(tasks: TaskResults, task: str) -> Trials:
    """The evolved body with the largest mean in a task."""
    found = [tasks.of_task(body, task) for body in OPT]
    values = [each.values for each in found]
    if any(each is None for each in values):
        return Trials(f"all evolved bodies in {task}", None)
    means = [float(each.mean()) for each in values if each is not None]
    return found[means.index(max(means))]


def _ranked_before(
    tasks: TaskResults, one: Sequence[str], other: Sequence[str], name: str, than: str
) -> Part:
    """The least average rank of some bodies is below that of others, ranked among both."""
    ranks = tasks.average_ranks((*one, *other))

    def least(bodies: Sequence[str]) -> Trials:
        found = [ranks[body] for body in bodies]
        means = [np.inf if each.values is None else float(each.values.mean()) for each in found]
        return found[means.index(min(means))]

    return Part(
        label=f"average rank, best {name} - best {than}",
        terms=difference(least(one), least(other)),
        side="less than",
        margin=0.0,
        unit=RANK,
    )


def _task_needs(tasks: TaskResults) -> tuple[Need, ...]:
    run = tasks.least(attribute("births"))
    return (Need(verb="evolved for", unit="births", needed=BIRTHS, run=run),)


def _unknown(label: str, unit: str, side: Side) -> Part:
    """What nothing has been run for yet."""
    terms = ((1.0, Trials("the neural controller", None)),)
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
