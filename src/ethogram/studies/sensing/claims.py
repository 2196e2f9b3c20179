"""The six claims of the chapter as tests, with their history, under both output laws.

Claims 1 to 6 are about sensing controllers whose outputs pass through tanh, 7 to 12 say the same
of unbounded ones.  Non-sensing is `shrink_limited` in both.  Unless something else is named the
margin is zero and a number is a distance of the best robot of a run, in mm; the unit is the run.

Readings.  Claim 1: the thesis asks by Mann and Whitney's U test whether medians differ.  The
verdict rests on means and on their interval, as in every study; U's p-value stands in Table 5.2.
Claim 2: the lead is a difference, as in the thesis' text, and the worm and the biped must have one
for the tripod's to be the smallest.  Claim 3: "the same" is claims 1 and 2, in each of the four
scenarios.  Claim 4: the thesis counts ratios of means; here each run has ratios of its own, and
counted is how many of the nine cases are above (or below) 1, on average over runs: most is more
than half.  The thesis' way to count is in the table `validation`.  Claim 5: on the even surface.
Clouds are distinct where both kinds have a silhouette above 0: the mean over both would be so even
for a narrow cloud in the middle of a wide one.  A silhouette of one run depends on all others, so
its error is the jackknife's.  Spread is the distance from the mean behaviour of the kind (Anderson,
2006).  Claim 6: harder than flat and step, run by run, for the six of body and controller.  The
thesis' own table has exceptions to it: its non-sensing biped gets furthest in sin, and its sensing
worm further than in flat.

The claims are about 200 generations and 10 000 steps: after less they are tested to show where they
point, and left undecided.
"""

from collections.abc import Callable, Sequence

import numpy as np

from ethogram.campaign.study import Records
from ethogram.core.findings import Claim, Side
from ethogram.studies.chapter import attribute
from ethogram.studies.sensing.behaviour import silhouettes, spreads
from ethogram.studies.sensing.condition import (
    FITNESS,
    MORPHOLOGIES,
    OUTPUTS,
    SCENARIOS,
    VALIDATION,
    Condition,
    non_sensing,
    sensing,
)
from ethogram.studies.sensing.results import (
    Results,
    distance,
    further,
    validated,
)
from ethogram.studies.statistics import (
    ClaimSpec,
    Need,
    Part,
    Terms,
    Trials,
    difference,
    jackknife_pseudovalues,
    judge,
    tests_revised,
)

GENERATIONS, STEPS = 200, 10_000  # that the chapter speaks of
MOST = len(MORPHOLOGIES) * len(VALIDATION) / 2  # of nine
DISTINCT = ("worm", "biped")  # the bodies of claim 5
SMALLEST = "tripod"  # the body of claim 2
JACKKNIFED = 3  # runs that it takes to leave one out and still have neighbours
DISTANCE, COUNT, SILHOUETTE = "mm", "cases", "silhouette"  # units

STATED = "2026-11-26"
HISTORY = (tests_revised("The published results of six runs, plan excerpt."),)

Spec = Callable[[Results, str, int], ClaimSpec]


def claims(records: Records) -> list[Claim]:
    """All twelve claims, judged together."""
    results = Results.of(records)
    specs: tuple[Spec, ...] = (
        _sensing_better,
        _tripod_least,
        _uneven_too,
        _validation_kept,
        _clouds_distinct,
        _sin_hardest,
    )
    return judge(
        [
            spec(results, output, 1 + number + len(specs) * later)
            for later, output in enumerate(OUTPUTS)
            for number, spec in enumerate(specs)
        ]
    )


def _sensing_better(results: Results, output: str, number: int) -> ClaimSpec:
    return ClaimSpec(
        number=number,
        statement=f"With {output} outputs, sensing controllers beat non-sensing ones on the even "
        "surface, for each body.",
        source="section 5.4.1, table 5.2",
        test="Mean fitness with sensing less that without is above zero, for worm, biped and "
        "tripod.",
        parts=tuple(
            _more(f"lead, {body}", _lead(results, body, output, "even", FITNESS))
            for body in MORPHOLOGIES
        ),
        needs=_needs(results, output, "even"),
        stated=STATED,
        history=HISTORY,
    )


def _tripod_least(results: Results, output: str, number: int) -> ClaimSpec:
    exists = [
        _more(f"lead, {body}", _lead(results, body, output, "even", FITNESS))
        for body in MORPHOLOGIES
        if body != SMALLEST
    ]
    return ClaimSpec(
        number=number,
        statement=f"With {output} outputs, the lead of sensing controllers on the even surface is "
        "smallest for the tripod.",
        source="section 5.4.1, table 5.2",
        test="Lead: mean fitness with sensing less that without, in mm. It is above zero for worm "
        "and biped, and the tripod's less either of these is below zero.",
        parts=(*exists, *_leads_compared(results, output, "even", FITNESS)),
        needs=_needs(results, output, "even"),
        stated=STATED,
        history=HISTORY,
    )


def _uneven_too(results: Results, output: str, number: int) -> ClaimSpec:
    parts = []
    for scenario in SCENARIOS["uneven"]:
        parts += [
            _more(f"lead, {body}, {scenario}", _lead(results, body, output, "uneven", scenario))
            for body in MORPHOLOGIES
        ]
        parts += _leads_compared(results, output, "uneven", scenario)
    return ClaimSpec(
        number=number,
        statement=f"With {output} outputs, the same holds on the uneven surface and in all "
        "validation scenarios: sensing controllers beat non-sensing ones, and by least for the "
        "tripod.",
        source="section 5.4.2, table 5.3",
        test="Under the gravity of evolution and in the scenarios flat, step and sin: the lead in "
        "mean distance is above zero for each body, and the tripod's less either of the others' is "
        "below zero.",
        parts=tuple(parts),
        needs=_needs(results, output, "uneven"),
        stated=STATED,
        history=HISTORY,
    )


def _validation_kept(results: Results, output: str, number: int) -> ClaimSpec:
    def count(condition: Callable[[str], Condition], *, above: bool) -> Terms:
        measure = validated(above=above)
        return tuple((1.0, results.trials(measure, condition(body))) for body in MORPHOLOGIES)

    return ClaimSpec(
        number=number,
        statement=f"With {output} outputs, the ratio of validation distance to fitness is above 1 "
        "in most sensing cases, and below 1 in most non-sensing ones.",
        source="section 5.4.2, table 5.3",
        test="Cases: three bodies in three validation scenarios. Of a run's ratios, a mean of more "
        "than 4.5 of nine are above 1 with sensing, and more than 4.5 of nine below 1 without.",
        parts=(
            _more(
                "above 1, sensing",
                count(lambda body: sensing(body, output, "uneven"), above=True),
                COUNT,
                MOST,
            ),
            _more(
                "below 1, non-sensing",
                count(lambda body: non_sensing(body, "uneven"), above=False),
                COUNT,
                MOST,
            ),
        ),
        needs=_needs(results, output, "uneven"),
        stated=STATED,
        history=HISTORY,
    )


def _clouds_distinct(results: Results, output: str, number: int) -> ClaimSpec:
    parts = []
    for body in DISTINCT:
        kinds = non_sensing(body, "even"), sensing(body, output, "even")
        parts += [
            _more(
                f"silhouette, {body}, {at.controller}",
                _silhouettes(results, kinds, place),
                SILHOUETTE,
            )
            for place, at in enumerate(kinds)
        ]
        narrow, wide = (_spread(results, at) for at in kinds)
        parts.append(_more(f"spread, sensing - non-sensing, {body}", difference(wide, narrow)))
    return ClaimSpec(
        number=number,
        statement=f"With {output} outputs, the behaviours of sensing and of non-sensing "
        "controllers form distinct clouds for worm and biped, those of the sensing ones being more "
        "spread.",
        source="section 5.4.1, figure 5.5",
        test="Even surface: the mean silhouette of the runs is above zero for either kind, and the "
        "mean distance from the mean behaviour of the kind is larger with sensing than without.",
        parts=tuple(parts),
        needs=_needs(results, output, "even", DISTINCT),
        stated=STATED,
        history=HISTORY,
    )


def _sin_hardest(results: Results, output: str, number: int) -> ClaimSpec:
    parts = [
        _part(
            f"sin - {other}, {at.body}, {at.controller}",
            ((1.0, results.trials(further("sin", other), at)),),
            "less than",
        )
        for other in VALIDATION
        if other != "sin"
        for body in MORPHOLOGIES
        for at in (non_sensing(body, "uneven"), sensing(body, output, "uneven"))
    ]
    return ClaimSpec(
        number=number,
        statement=f"With {output} outputs, sin is the hardest validation scenario.",
        source="section 5.4.2; not so in table 5.3 for the non-sensing biped and the sensing worm",
        test="For each body and controller, the distance in sin less that in flat, and less that "
        "in step, of the same robot, has a mean below zero.",
        parts=tuple(parts),
        needs=_needs(results, output, "uneven"),
        stated=STATED,
        history=HISTORY,
    )


def _part(label: str, terms: Terms, side: Side, unit: str = DISTANCE, margin: float = 0.0) -> Part:
    return Part(label=label, terms=terms, side=side, margin=margin, unit=unit)


def _more(label: str, terms: Terms, unit: str = DISTANCE, margin: float = 0.0) -> Part:
    return _part(label, terms, "more than", unit, margin)


def _lead(results: Results, body: str, output: str, surface: str, scenario: str) -> Terms:
    """What a body goes further with sensing than without."""
    measure = distance(scenario)
    return difference(
        results.trials(measure, sensing(body, output, surface)),
        results.trials(measure, non_sensing(body, surface)),
    )


def _leads_compared(results: Results, output: str, surface: str, scenario: str) -> list[Part]:
    """The tripod's lead is smaller than either of the others'."""
    least = _lead(results, SMALLEST, output, surface, scenario)
    parts = []
    for body in MORPHOLOGIES:
        if body != SMALLEST:
            other = _lead(results, body, output, surface, scenario)
            terms = (*least, *((-weight, trials) for weight, trials in other))
            label = f"lead, {SMALLEST} - {body}, {scenario}"
            parts.append(_part(label, terms, "less than"))
    return parts


def _silhouettes(results: Results, kinds: Sequence[Condition], place: int) -> Terms:
    """The mean silhouette of the runs of one of two conditions, as what each run does to it."""
    names = [f"{at.description} (silhouettes)" for at in kinds]
    values = [results.trials(distance(FITNESS), at).values for at in kinds]
    undefined = [None if each is None else np.full(len(each), np.nan) for each in values]
    found: Sequence[np.ndarray | None] = undefined
    if results.comparable(*kinds):
        runs = [results.behaviours(at, FITNESS) for at in kinds]
        if min(map(len, runs)) >= JACKKNIFED and all(np.isfinite(each).all() for each in runs):
            found = jackknife_pseudovalues(
                lambda a, b: float(silhouettes(a, b)[place].mean()), *runs
            )
    return tuple((1.0, Trials(name, each)) for name, each in zip(names, found, strict=True))


def _spread(results: Results, at: Condition) -> Trials:
    if at not in results.by_condition:
        return Trials(at.description, None)
    return Trials(at.description, spreads(results.behaviours(at, FITNESS)))


def _needs(
    results: Results, output: str, surface: str, bodies: Sequence[str] = MORPHOLOGIES
) -> tuple[Need, ...]:
    """What the chapter's claims are about, and the least with which what they compare was run."""
    compared = [
        at for body in bodies for at in (non_sensing(body, surface), sensing(body, output, surface))
    ]
    return tuple(
        Need(verb=verb, unit=unit, needed=needed, run=results.least(attribute(unit), compared))
        for verb, unit, needed in (
            ("evolved for", "generations", GENERATIONS),
            ("simulated for", "steps", STEPS),
        )
    )
