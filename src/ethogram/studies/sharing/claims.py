"""The nine claims of the chapter as tests, with the history of each.

J and I of claims 1 to 5 are those of the last tenth of training, which is what figures 3.2 and
3.3 show; claims 6 to 9 speak of validation.  Margins: for J 2% of what can be earned in the
scenario, which is the range from the return of random choices to the optimum
(`ethogram.studies.sharing.earnings`); for the return of a single agent (claim 8) 2% of the largest
that it can have, 99 over 100 steps; for I 10% of the larger of the two values compared.  "Higher"
and "lower" mean by more than the margin, "not higher" and "matches" up to it.

The claims are about 20 000 episodes of 100 steps, and those on validation about 100 episodes more:
after less they are tested to show where they point, and left undecided.
"""

from functools import partial
from typing import NamedTuple

from ethogram.campaign.study import Records
from ethogram.core.findings import Claim, Side
from ethogram.studies.chapter import Measure
from ethogram.studies.sharing import results as measure
from ethogram.studies.sharing.compute import SHOWN
from ethogram.studies.sharing.history import (
    LEAD_EXISTS,
    NARROWER,
    OPTIMUM_REACHED,
    RETESTED,
    STATED,
    WITHOUT_RANDOM,
)
from ethogram.studies.sharing.plan import (
    SCENARIOS,
    SETTINGS,
    STRATEGIES,
    Condition,
    Strategy,
    filling_word,
)
from ethogram.studies.sharing.results import CLOSE, Results
from ethogram.studies.statistics import (
    ClaimSpec,
    Need,
    Part,
    Terms,
    Trials,
    difference,
    judge,
)
from ethogram.worlds.sharing.reward import Scenario

EPISODES, VALIDATION_EPISODES, STEPS = 20_000, 100, 100  # that the chapter speaks of
J_MARGIN = 0.02  # of what can be earned in the scenario
OWN_MARGIN = 0.02  # of the largest return of a single agent
I_SCALE = 0.9  # 0.9 a > b: a is higher than b by more than 10% of the larger value
HALF_A_STEP = 0.5
SHOWN_IN_FIGURE_3_6: tuple[Strategy, ...] = ("always", "none")  # beside optional
RETURN, SPREAD = "return", "return (standard deviation)"  # units


class Setting(NamedTuple):
    """Where two strategies are compared."""

    scenario: Scenario
    observed: bool

    @property
    def description(self) -> str:
        """For labels."""
        return f"{self.scenario}, filling {filling_word(self.observed)}"


EVERYWHERE = tuple(Setting(*setting) for setting in SETTINGS)


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
    parts = []
    for setting in EVERYWHERE:
        for other in _others("always"):
            parts.append(_training_return(results, setting, "always", other, "at least", -1))
            parts.append(_training_spread(results, setting, "always", other, "at most"))
    return ClaimSpec(
        number=1,
        statement="Always-communication has the highest overall return J and the lowest "
        "inequality I in all six settings.",
        source="section 3.4.1, figures 3.2 and 3.3",
        test="At the end of training, against each other strategy: J not lower by more than 2% "
        "of what can be earned, I not higher by more than 10%.",
        parts=tuple(parts),
        needs=_needs(results),
        stated=STATED,
        history=(NARROWER, RETESTED),
    )


def _lead_larger_when_hidden(results: Results) -> ClaimSpec:
    parts = []
    for scenario in SCENARIOS:
        hidden, observed = Setting(scenario, False), Setting(scenario, True)
        lead = partial(_lead, results, measure.training_return)
        parts.append(
            Part(
                label=f"lead in J, hidden - observed, {scenario}",
                terms=lead(hidden, 1.0) + lead(observed, -1.0),
                side="more than",
                margin=J_MARGIN * results.earnings(scenario).range,
                unit=RETURN,
            )
        )
        spread = partial(_lead, results, measure.training_inequality)
        spread_part = partial(Part, side="more than", margin=0.0, unit=SPREAD)
        parts += [
            spread_part(label=f"lead in I, {hidden.description}", terms=spread(hidden, -1.0)),
            spread_part(
                label=f"lead in I, {I_SCALE} hidden - observed, {scenario}",
                terms=spread(hidden, -I_SCALE) + spread(observed, 1.0),
            ),
        ]
    return ClaimSpec(
        number=2,
        statement="The lead of always-communication over no-communication is larger when the "
        "filling is hidden.",
        source="section 3.4.1",
        test="At the end of training, in every scenario: the lead in J is larger by more than 2% "
        "of what can be earned; there is a lead in I with hidden filling, and it is larger by "
        "more than 10%.",
        parts=tuple(parts),
        needs=_needs(results),
        stated=STATED,
        history=(LEAD_EXISTS, NARROWER, RETESTED),
    )


def _optional_matches(results: Results) -> ClaimSpec:
    parts = []
    for observed in (False, True):
        setting = Setting("cooperative", observed)
        parts += [
            _training_return(results, setting, "optional", "always", "within", 1),
            _training_spread(results, setting, "optional", "always", "at most"),
            _training_spread(results, setting, "always", "optional", "at most"),
        ]
    return ClaimSpec(
        number=3,
        statement="Optional communication matches always-communication in the cooperative "
        "scenario, whether the filling is hidden or observed.",
        source="section 3.4.1",
        test="At the end of training, equivalence: J within 2% of what can be earned, I within "
        "10%.",
        parts=tuple(parts),
        needs=_needs(results),
        stated=STATED,
        history=(NARROWER, RETESTED),
    )


def _optional_worse(results: Results) -> ClaimSpec:
    parts = []
    for setting in (Setting("competitive", False), Setting("mixed", False)):
        parts.append(_training_return(results, setting, "optional", "always", "less than", -1))
        parts.append(_training_spread(results, setting, "optional", "always", "more than"))
    return ClaimSpec(
        number=4,
        statement="Optional communication is worse than always-communication in the competitive "
        "and the mixed scenario with hidden filling.",
        source="section 3.4.1",
        test="At the end of training: J lower by more than 2% of what can be earned and I higher "
        "by more than 10%.",
        parts=tuple(parts),
        needs=_needs(results),
        stated=STATED,
        history=(NARROWER, RETESTED),
    )


def _random_worst(results: Results) -> ClaimSpec:
    parts = []
    for setting in EVERYWHERE:
        for other in _others("random"):
            parts.append(_training_return(results, setting, "random", other, "less than", -1))
            parts.append(_training_spread(results, setting, "random", other, "more than"))
    return ClaimSpec(
        number=5,
        statement="The random strategy is the worst in every setting, in return and in inequality.",
        source="section 3.4.1",
        test="At the end of training, against each other strategy: J lower by more than 2% of "
        "what can be earned and I higher by more than 10%.",
        parts=tuple(parts),
        needs=_needs(results),
        stated=STATED,
        history=(NARROWER, RETESTED),
    )


def _settles(results: Results) -> ClaimSpec:
    settled = [
        Part(
            label=f"settling: {condition.description}",
            terms=((1.0, results.trials(measure.unsettled, condition)),),
            side="at most",
            margin=CLOSE * results.agents,
            unit="agents",
        )
        for condition in measure.conditions()
    ]
    in_time, first = [], []
    for setting in EVERYWHERE:
        always, *_ = _pair(results, measure.steps_to_optimum(setting[0]), setting, "always", "none")
        in_time.append(
            Part(
                label=f"always reaches the optimum: {setting.description}",
                terms=((1.0, always),),
                side="at most",
                margin=SHOWN,
                unit="steps",
            )
        )
        first += [
            Part(
                label=f"always before {other}: {setting.description}",
                terms=difference(
                    *_pair(results, measure.steps_to_optimum(setting[0]), setting, "always", other)
                ),
                side="at most",
                margin=HALF_A_STEP,
                unit="steps",
            )
            for other in _others("always")
        ]
    return ClaimSpec(
        number=6,
        statement="The displacement settles within 10 steps, and always-communication reaches "
        "the optimal one first.",
        source="section 3.4.2, figure 3.4",
        test="In validation: at step 10 no further than 5% of the agents from its later mean, for "
        "every strategy and setting; always-communication comes within 5% of the agents of the "
        "optimum by step 10, and no later than any other strategy (by more than half a step).",
        parts=(*settled, *in_time, *first),
        needs=_needs(results, validated=True),
        stated=STATED,
        history=(OPTIMUM_REACHED, RETESTED),
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
        needs=_needs(results, validated=True),
        stated=STATED,
        history=(RETESTED,),
    )


def _best_off(results: Results) -> ClaimSpec:
    setting, parts = Setting("competitive", True), []
    for other in SHOWN_IN_FIGURE_3_6:
        best = _pair(results, measure.best_return, setting, "optional", other)
        spread = _pair(results, measure.validation_inequality, setting, "optional", other)
        parts += [
            Part(
                label=f"best optional - best {other}",
                terms=difference(*best),
                side="more than",
                margin=OWN_MARGIN * results.largest_return(setting.scenario),
                unit=RETURN,
            ),
            _spread_part(f"{I_SCALE} I(optional) - I({other})", spread, "more than"),
        ]
    return ClaimSpec(
        number=8,
        statement="In the competitive scenario with observed filling, the best-off optional "
        "agents earn more than any agent of the other strategies, at higher inequality.",
        source="section 3.4.3, figure 3.6, table 3.2",
        test="In validation: the highest individual return of a trial is higher by more than 2% "
        "of the largest that there can be, and I by more than 10%, than with always- and with "
        "no-communication.",
        parts=tuple(parts),
        needs=_needs(results, validated=True),
        stated=STATED,
        history=(WITHOUT_RANDOM, RETESTED),
    )


def _when_they_speak(results: Results) -> ClaimSpec:
    confirming = measure.share_of_act("confirm, speaking")
    changing = measure.share_of_act("change, speaking")
    parts = [
        Part(
            label=condition.description,
            terms=difference(results.trials(more, condition), results.trials(less, condition)),
            side="more than",
            margin=0.0,
            unit="share of agents",
        )
        for condition, more, less in (
            (Condition("cooperative", "optional", False), confirming, changing),
            (Condition("competitive", "optional", True), changing, confirming),
        )
    ]
    return ClaimSpec(
        number=9,
        statement="Communicating while confirming is commoner than while changing in the "
        "cooperative case, and the other way round in the competitive one.",
        source="section 3.4.3, tables 3.3 and 3.4",
        test="In the first ten steps of validation, in the settings of the two tables: the share "
        "of agents that confirm and speak, against those that change and speak.",
        parts=tuple(parts),
        needs=_needs(results, validated=True),
        stated=STATED,
        history=(RETESTED,),
    )


def _needs(results: Results, *, validated: bool = False) -> tuple[Need, ...]:
    """What the chapter's claims are about, and the least with which anything was run."""
    needs = [
        Need(
            verb="trained for",
            unit="episodes",
            needed=EPISODES,
            run=results.least(measure.training_episodes),
        ),
        Need(
            verb="in episodes of",
            unit="steps",
            needed=STEPS,
            run=results.least(measure.episode_steps),
        ),
    ]
    if validated:
        watched = results.least(measure.validation_episodes)
        needs.append(
            Need(
                verb="watched for",
                unit="validation episodes",
                needed=VALIDATION_EPISODES,
                run=watched,
            )
        )
    return tuple(needs)


def _others(strategy: Strategy) -> tuple[Strategy, ...]:
    return tuple(other for other in STRATEGIES if other != strategy)


def _pair(
    results: Results, name: Measure, setting: Setting, one: Strategy, other: Strategy
) -> tuple[Trials, Trials]:
    """The trials of two strategies in one setting."""
    scenario, observed = setting
    return (
        results.trials(name, Condition(scenario, one, observed)),
        results.trials(name, Condition(scenario, other, observed)),
    )


def _lead(results: Results, name: Measure, setting: Setting, weight: float) -> Terms:
    """What always-communication has more than no-communication, weighted."""
    always, none = _pair(results, name, setting, "always", "none")
    return ((weight, always), (-weight, none))


def _training_return(
    results: Results, setting: Setting, one: Strategy, other: Strategy, side: Side, sign: int
) -> Part:
    pair = _pair(results, measure.training_return, setting, one, other)
    label = f"J({one}) - J({other}), {setting.description}"
    return _return_part(results, label, pair, setting, side, sign)


def _training_spread(
    results: Results, setting: Setting, one: Strategy, other: Strategy, side: Side
) -> Part:
    pair = _pair(results, measure.training_inequality, setting, one, other)
    return _spread_part(f"{I_SCALE} I({one}) - I({other}), {setting.description}", pair, side)


def _return_part(
    results: Results,
    label: str,
    pair: tuple[Trials, Trials],
    setting: Setting,
    side: Side,
    sign: int,
) -> Part:
    """The difference of two J against their margin, with a sign."""
    return Part(
        label=label,
        terms=difference(*pair),
        side=side,
        margin=sign * J_MARGIN * results.earnings(setting.scenario).range,
        unit=RETURN,
    )


def _spread_part(label: str, pair: tuple[Trials, Trials], side: Side) -> Part:
    """90% of one inequality less another against zero."""
    one, other = pair
    terms = ((I_SCALE, one), (-1.0, other))
    return Part(label=label, terms=terms, side=side, margin=0.0, unit=SPREAD)
