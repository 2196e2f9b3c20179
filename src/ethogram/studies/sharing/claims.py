"""The nine claims of the chapter as tests that were stated before the run.

J and I of claims 1 to 5 are those of the last tenth of training, which is what figures 3.2 and
3.3 show; claims 6 to 9 speak of validation.  Margins: for J 2% of the largest possible return
of an agent (99 over 100 steps), for I 10% of the larger of the two values compared.  "Higher" and
"lower" mean by more than the margin, "not higher" and "matches" up to it.
"""

from functools import partial

from ethogram.core.findings import Claim
from ethogram.studies.sharing import results as measure
from ethogram.studies.sharing.plan import (
    SCENARIOS,
    SETTINGS,
    STRATEGIES,
    Condition,
    Strategy,
    filling_word,
)
from ethogram.studies.sharing.results import CLOSE, Measure, Records, Results
from ethogram.studies.statistics import ClaimSpec, Part, Side, Trials, difference, judge
from ethogram.worlds.sharing.reward import Scenario

J_MARGIN = 0.02  # of the largest possible return
I_SCALE = 0.9  # 0.9 a > b: a is higher than b by more than 10% of the larger value
HALF_A_STEP = 0.5

_PART = {"return": "return", "spread": "return (standard deviation)"}


def claims(records: Records) -> list[Claim]:
    """All nine claims, judged together."""
    results = Results.of(records)
    specs = (
        _always_best,
        _lead_larger_when_hidden,
        _optional_matches,
        _optional_worse,
        _random_worst,
        _settles,
        _talks_first,
        _best_off,
        _when_they_speak,
    )
    return judge([spec(results) for spec in specs])


def _always_best(results: Results) -> ClaimSpec:
    return ClaimSpec(
        number=1,
        statement="Always-communication has the highest overall return J and the lowest "
        "inequality I in all six settings.",
        source="section 3.4.1, figures 3.2 and 3.3",
        test="At the end of training, against each other strategy: J not lower by more than 2% "
        "of the largest return, I not higher by more than 10%.",
        parts=tuple(
            part
            for scenario, observed in SETTINGS
            for other in STRATEGIES
            if other != "always"
            for part in (
                _return_part(results, scenario, observed, "always", other, "at least", -1),
                _inequality_part(results, scenario, observed, "always", other, "at most"),
            )
        ),
    )


def _lead_larger_when_hidden(results: Results) -> ClaimSpec:
    def lead(
        name: Measure, scenario: Scenario, observed: bool, sign: float
    ) -> tuple[tuple[float, Trials], ...]:
        always, none = _pair(results, name, scenario, observed, "always", "none")
        return ((sign, always), (-sign, none))

    parts = []
    for scenario in SCENARIOS:
        returns = partial(lead, measure.training_return, scenario)
        spreads = partial(lead, measure.training_inequality, scenario)
        parts.append(
            Part(
                label=f"lead in J, hidden - observed, {scenario}",
                terms=returns(True, -1.0) + returns(False, 1.0),
                side="more than",
                margin=J_MARGIN * results.largest_return(scenario),
                unit=_PART["return"],
            )
        )
        parts.append(
            Part(
                label=f"lead in I, {I_SCALE} hidden - observed, {scenario}",
                terms=spreads(True, 1.0) + spreads(False, -I_SCALE),
                side="more than",
                margin=0.0,
                unit=_PART["spread"],
            )
        )
    return ClaimSpec(
        number=2,
        statement="The lead of always-communication over no-communication is larger when the "
        "filling is hidden.",
        source="section 3.4.1",
        test="At the end of training, in every scenario: the lead in J is larger by more than 2% "
        "of the largest return, the lead in I by more than 10%.",
        parts=tuple(parts),
    )


def _optional_matches(results: Results) -> ClaimSpec:
    return ClaimSpec(
        number=3,
        statement="Optional communication matches always-communication in the cooperative "
        "scenario, whether the filling is hidden or observed.",
        source="section 3.4.1",
        test="At the end of training, equivalence: J within 2% of the largest return, I within "
        "10%.",
        parts=tuple(
            part
            for observed in (False, True)
            for part in (
                _return_part(results, "cooperative", observed, "optional", "always", "within", 1),
                _inequality_part(results, "cooperative", observed, "optional", "always", "at most"),
                _inequality_part(results, "cooperative", observed, "always", "optional", "at most"),
            )
        ),
    )


def _optional_worse(results: Results) -> ClaimSpec:
    return ClaimSpec(
        number=4,
        statement="Optional communication is worse than always-communication in the competitive "
        "and the mixed scenario with hidden filling.",
        source="section 3.4.1",
        test="At the end of training: J lower by more than 2% of the largest return and I higher "
        "by more than 10%.",
        parts=tuple(
            part
            for scenario in SCENARIOS
            if scenario != "cooperative"
            for part in (
                _return_part(results, scenario, False, "optional", "always", "less than", -1),
                _inequality_part(results, scenario, False, "optional", "always", "more than"),
            )
        ),
    )


def _random_worst(results: Results) -> ClaimSpec:
    return ClaimSpec(
        number=5,
        statement="The random strategy is the worst in every setting, in return and in inequality.",
        source="section 3.4.1",
        test="At the end of training, against each other strategy: J lower by more than 2% of "
        "the largest return and I higher by more than 10%.",
        parts=tuple(
            part
            for scenario, observed in SETTINGS
            for other in STRATEGIES
            if other != "random"
            for part in (
                _return_part(results, scenario, observed, "random", other, "less than", -1),
                _inequality_part(results, scenario, observed, "random", other, "more than"),
            )
        ),
    )


def _settles(results: Results) -> ClaimSpec:
    settled = tuple(
        Part(
            label=f"settling: {condition.words}",
            terms=((1.0, results.trials(measure.unsettled, condition)),),
            side="within",
            margin=CLOSE * results.agents,
            unit="agents",
        )
        for condition in measure.conditions()
    )
    first = tuple(
        Part(
            label=f"always before {other}: {_setting(scenario, observed)}",
            terms=difference(
                *_pair(results, measure.steps_to_optimum, scenario, observed, "always", other)
            ),
            side="at most",
            margin=HALF_A_STEP,
            unit="steps",
        )
        for scenario, observed in SETTINGS
        for other in STRATEGIES
        if other != "always"
    )
    return ClaimSpec(
        number=6,
        statement="The displacement settles within 10 steps, and always-communication reaches "
        "the optimal one first.",
        source="section 3.4.2, figure 3.4",
        test="In validation: at step 10 within 5% of the agents of its later mean, for every "
        "strategy and setting; always-communication comes within 5% of the agents of the optimum "
        "no later than any other strategy (by more than half a step).",
        parts=settled + first,
    )


def _talks_first(results: Results) -> ClaimSpec:
    parts = []
    for observed in (False, True):
        condition = Condition("cooperative", "optional", observed)
        early = results.trials(measure.early_communication, condition)
        for name, later in (
            ("3 to 8", measure.middle_communication),
            ("9 and 10", measure.late_communication),
        ):
            parts.append(
                Part(
                    label=f"steps {name}, filling {filling_word(observed)}",
                    terms=difference(early, results.trials(later, condition)),
                    side="more than",
                    margin=0.0,
                    unit="share of agents",
                )
            )
    return ClaimSpec(
        number=7,
        statement="In the cooperative scenario, optional communication is highest in the first "
        "steps and then falls.",
        source="section 3.4.3, figure 3.5",
        test="In validation: the share of agents that speak is higher in steps 1 and 2 than in "
        "steps 3 to 8 and than in steps 9 and 10, for both fillings.",
        parts=tuple(parts),
    )


def _best_off(results: Results) -> ClaimSpec:
    parts = []
    for other in STRATEGIES:
        if other == "optional":
            continue
        here = partial(
            _pair, results, scenario="competitive", observed=True, one="optional", other=other
        )
        parts.append(
            Part(
                label=f"best agent, optional - {other}",
                terms=difference(*here(name=measure.best_return)),
                side="more than",
                margin=J_MARGIN * results.largest_return("competitive"),
                unit=_PART["return"],
            )
        )
        one, two = here(name=measure.validation_inequality)
        parts.append(
            Part(
                label=f"{I_SCALE} I(optional) - I({other})",
                terms=((I_SCALE, one), (-1.0, two)),
                side="more than",
                margin=0.0,
                unit=_PART["spread"],
            )
        )
    return ClaimSpec(
        number=8,
        statement="In the competitive scenario with observed filling, the best-off optional "
        "agents earn more than any agent of the other strategies, at higher inequality.",
        source="section 3.4.3, figure 3.6, table 3.2",
        test="In validation: the highest individual return of a trial is higher by more than 2% "
        "of the largest return, and I by more than 10%, than with each other strategy.",
        parts=tuple(parts),
    )


def _when_they_speak(results: Results) -> ClaimSpec:
    confirming = measure.share_of_act("confirm, speaking")
    changing = measure.share_of_act("change, speaking")
    parts = []
    for condition, more, less in (
        (Condition("cooperative", "optional", False), confirming, changing),
        (Condition("competitive", "optional", True), changing, confirming),
    ):
        parts.append(
            Part(
                label=condition.words,
                terms=difference(results.trials(more, condition), results.trials(less, condition)),
                side="more than",
                margin=0.0,
                unit="share of agents",
            )
        )
    return ClaimSpec(
        number=9,
        statement="Communicating while confirming is commoner than while changing in the "
        "cooperative case, and the other way round in the competitive one.",
        source="section 3.4.3, tables 3.3 and 3.4",
        test="In the first ten steps of validation, in the settings of the two tables: the share "
        "of agents that confirm and speak, against those that change and speak.",
        parts=tuple(parts),
    )


def _pair(
    results: Results,
    name: Measure,
    scenario: Scenario,
    observed: bool,
    one: Strategy,
    other: Strategy,
) -> tuple[Trials, Trials]:
    """The trials of two strategies in one setting."""
    return (
        results.trials(name, Condition(scenario, one, observed)),
        results.trials(name, Condition(scenario, other, observed)),
    )


def _return_part(
    results: Results,
    scenario: Scenario,
    observed: bool,
    one: Strategy,
    other: Strategy,
    side: Side,
    sign: float,
) -> Part:
    """J of one strategy less J of another, against the margin with a sign."""
    return Part(
        label=f"J({one}) - J({other}), {_setting(scenario, observed)}",
        terms=difference(*_pair(results, measure.training_return, scenario, observed, one, other)),
        side=side,
        margin=sign * J_MARGIN * results.largest_return(scenario),
        unit=_PART["return"],
    )


def _inequality_part(
    results: Results,
    scenario: Scenario,
    observed: bool,
    one: Strategy,
    other: Strategy,
    side: Side,
) -> Part:
    """90% of I of one strategy less I of another, against zero."""
    first, second = _pair(results, measure.training_inequality, scenario, observed, one, other)
    return Part(
        label=f"{I_SCALE} I({one}) - I({other}), {_setting(scenario, observed)}",
        terms=((I_SCALE, first), (-1.0, second)),
        side=side,
        margin=0.0,
        unit=_PART["spread"],
    )


def _setting(scenario: Scenario, observed: bool) -> str:
    return f"{scenario}, filling {filling_word(observed)}"
