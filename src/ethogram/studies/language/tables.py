"""Tables 2.2 and 2.3 beside their published numbers, the returns, and the language."""

from collections.abc import Mapping

import numpy as np

from ethogram.campaign.study import Records
from ethogram.core.findings import Cell, Measured, Table
from ethogram.studies.chapter import Measure
from ethogram.studies.language import metrics
from ethogram.studies.language import results as measure
from ethogram.studies.language.plan import SELECTED
from ethogram.studies.language.published import THOUSAND_EPISODES, VALIDATION_REWARD
from ethogram.studies.language.results import Results
from ethogram.studies.statistics import Trials, measured

SETTING = ("n_r", "n_t")  # columns

RETURNS: dict[str, Measure] = {
    "R_val": measure.validation_return,
    "noise-free": measure.mean_of("noise_free_return"),
    "discounted": measure.mean_of("discounted_return"),
    "silenced": measure.mean_of("silenced_return"),
    "scrambled": measure.mean_of("scrambled_return"),
}
LANGUAGE: dict[str, Measure] = {
    "lost when silenced": measure.lost("silenced"),
    "lost when scrambled": measure.lost("scrambled"),
    "influence (bits)": measure.influence,
    "target told": measure.of_speech(metrics.target_information),
    "association told": measure.of_speech(metrics.association_information),
    "effective vocabulary": measure.of_speech(metrics.effective_vocabulary),
    "synonymy": measure.of_speech(metrics.synonymy),
    "homonymy": measure.of_speech(metrics.homonymy),
    "agreement": measure.of_speech(metrics.agreement),
}


def tables(records: Records) -> list[Table]:
    """Every table of which a row was run."""
    results = Results.of(records)
    made = [_table_2_2(results), _table_2_3(results), _returns(results), _language(results)]
    return [table for table in made if table.rows]


def _table_2_2(results: Results) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for setting in results.settings:
        for e in SELECTED:
            condition = setting.learned(e)
            trials = results.trials(measure.validation_return, condition)
            mean, deviation = VALIDATION_REWARD.get((*setting, e), (None, None))
            value = measured(trials, published=mean)
            if value is not None:
                spread = _deviation(trials, deviation)
                rows.append((*setting, f"{e:g}", condition.vocabulary_size, value, spread))
    return Table(
        name="table-2-2",
        title="Table 2.2: Validation reward for selected values of expressiveness",
        caption="|W| is the integer part of e n_r n_t. Mean of R_val over trials with a 95% "
        "interval, and its standard deviation over trials; the thesis does not say over "
        "what its own was taken.",
        columns=(*SETTING, "e", "|W|", "R_val, mean", "R_val, deviation"),
        rows=tuple(rows),
    )


def _table_2_3(results: Results) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for setting in results.settings:
        policies = setting.selected()
        printed = THOUSAND_EPISODES.get(setting, [None] * len(policies))
        for (policy, condition), number in zip(policies.items(), printed, strict=True):
            trials = results.trials(measure.thousand_episodes, condition)
            value = measured(trials, published=number)
            if value is not None:
                rows.append((*setting, policy, value))
    return Table(
        name="table-2-3",
        title="Table 2.3: Thousands of episodes to 95% of the final learning reward",
        caption="Until the learning reward is first within 5% of its final value, the mean over "
        "the last tenth of training; mean over trials with a 95% interval or range.",
        columns=(*SETTING, "policy", "episodes (thousands)"),
        rows=tuple(rows),
    )


def _returns(results: Results) -> Table:
    return Table(
        name="returns",
        title="Return in validation",
        caption="Sum over all agents and steps, mean over trials with a 95% interval or range. "
        "R_val: actions are sampled. Noise-free: without the noise of sampling. Discounted: "
        f"eq. 2.1 with the learner's discount{_discounts(results)}, and with the initial state's "
        "reward. Silenced: nobody hears anything. Scrambled: "
        "what is said is exchanged between episodes.",
        columns=(*SETTING, "policy", *RETURNS),
        rows=_rows(results, RETURNS),
    )


def _discounts(results: Results) -> str:
    found = {float(data.attrs["discount"]) for data in results.by_condition.values()}
    return f" = {' and '.join(f'{one:g}' for one in sorted(found))}" if found else ""


def _language(results: Results) -> Table:
    return Table(
        name="language",
        title="The language that emerged",
        caption="Means over talkers, then over trials, with a 95% interval or range. Lost: R_val "
        "less the return with the channel silenced or scrambled. Influence: what a word changes "
        "in the movement of another robot. Target and association told: mutual information of "
        "the word with what the talker knows, 1 if it tells all. Effective vocabulary: exp of "
        "the entropy of words. Synonymy: words per association. Homonymy: associations per word. "
        "Agreement: how often two talkers use the same word for an association that both can "
        "know, which takes three robots.",
        columns=(*SETTING, "policy", *LANGUAGE),
        rows=_rows(results, LANGUAGE),
    )


def _rows(results: Results, measures: Mapping[str, Measure]) -> tuple[tuple[Cell, ...], ...]:
    """A row for every condition that was run."""
    return tuple(
        (
            condition.robots,
            condition.targets,
            condition.policy,
            *(_mean(results.trials(each, condition)) for each in measures.values()),
        )
        for condition in results.by_condition
    )


def _mean(trials: Trials) -> Measured | None:
    """The mean over trials; None where it is of something that is not defined."""
    if trials.values is None or np.isnan(trials.values).all():
        return None
    return measured(trials)


def _deviation(trials: Trials, published: float | None) -> Measured | None:
    """The sample standard deviation over trials; None where it takes more of them."""
    if trials.values is None or trials.values.size < 2:
        return None
    return Measured(value=float(trials.values.std(ddof=1)), published=published)
