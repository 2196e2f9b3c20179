"""The seven claims of the chapter as tests.

The unit is the run, and a number is that of the last year unless something else is said.

Margins.  Correlations are Pearson's.  The chapter gives no numbers, so: "strong" is more than 0.7
(claim 1); an indicator tells quality if their correlation is more than 0.5 and does not if it is
less (2, 6, 7); "anti-correlated" is less than -0.5, "loosely" between -0.5 and 0.5 (4).  "Few
journals" are a fourth of them: they hold more than half of the papers of all years where papers
concentrate, and no more than 0.35 where they spread evenly (0.25 and a little for chance) (3).
Papers "fall" if the last year has fewer than the first; qualities form "a bell near q_max / 2" if,
in the last five years, their mean lies within a tenth of the range of its middle and their skewness
between -0.5 and 0.5; that of the initial power law is 0.9 (5).

All of this was stated before the run, but for what `history` says.  What else the claims
could be measured by is a field of `Choices`; `robustness` tests them by it, to see what hangs on
the choice.

The claims are about 20 years of 10 steps, and what is learned in 300 episodes; after less they are
tested to show where they point, and left undecided.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from ethogram.core.findings import Side
from ethogram.studies.chapter import Measure, attribute
from ethogram.studies.publishing.condition import (
    MILD,
    SMALL,
    STEPS_PER_YEAR,
    STRICT,
    YEARS,
    Condition,
    Size,
)
from ethogram.studies.publishing.history import STATED, history
from ethogram.studies.publishing.results import (
    Results,
    growth,
    last_correlation,
    off_centre,
    share_of_few,
    skewness,
)
from ethogram.studies.statistics import ClaimSpec, Need, Part

EPISODES = 300  # of training, that the chapter's figures are after (sheet of the study)
STRONG, TELLS, LOOSE = 0.7, 0.5, 0.5
EVEN, CONCENTRATED = 0.35, 0.5
NEAR, SYMMETRIC = 0.1, 0.5
CORRELATION, SHARE = "correlation", "share"  # units


class Choices(NamedTuple):
    """What the chapter leaves open; the defaults are what is stated."""

    correlation: Callable[[str], Measure] = last_correlation  # of an indicator and quality
    share: Measure = share_of_few  # of the papers, in few journals
    sizes: tuple[Size, ...] = (SMALL,)  # of the systems that claims 3 and 4 speak of


AS_STATED = Choices()


def specs(
    results: Results, scenarios: Sequence[Condition], choices: Choices = AS_STATED
) -> list[ClaimSpec]:
    """The claims that are about any of some scenarios, in the order of their numbers."""
    static = _static(scenarios)
    authors = [at for at in scenarios if at.author == "learned"]
    editors = [at for at in scenarios if at.editor == "learned"]
    found = []
    if static:
        found += [spec(results, scenarios, choices) for spec in _ABOUT_STATIC]
    if authors:
        found.append(_authors_learn(results, authors, choices))
    if editors:
        found.append(_editors_learn(results, editors, choices))
    return [replace(spec, stated=STATED, history=history(spec.number)) for spec in found]


def _h_index_tells(results: Results, scenarios: Sequence[Condition], choices: Choices) -> ClaimSpec:
    return ClaimSpec(
        number=1,
        statement="The h-index and the quality of authors correlate strongly in every scenario.",
        source="section 7.5.1, figures 7.2 to 7.9",
        test="In each scenario the correlation of h-index and quality over authors is above 0.7.",
        parts=_parts(results, choices, "h_index", scenarios, "more than", STRONG),
        needs=_needs(results, scenarios),
    )


def _impact_factor_tells_if_mild(
    results: Results, scenarios: Sequence[Condition], choices: Choices
) -> ClaimSpec:
    static = _static(scenarios)
    return ClaimSpec(
        number=2,
        statement="Impact factors tell the mean quality of what journals publish with mild "
        "scrutiny only, of the static editors.",
        source="section 7.5.2",
        test="The correlation of impact factor and mean quality over journals is above 0.5 with "
        "mild-scrutiny editors and below 0.5 with improve-only editors, whatever the authors.",
        parts=(
            *_parts(results, choices, "impact_factor", _of(static, MILD), "more than", TELLS),
            *_parts(results, choices, "impact_factor", _of(static, STRICT), "less than", TELLS),
        ),
        needs=_needs(results, static),
    )


def _random_spreads(
    results: Results, scenarios: Sequence[Condition], choices: Choices
) -> ClaimSpec:
    named = _named(scenarios, choices)
    sides: dict[str, tuple[Side, float]] = {
        "random": ("at most", EVEN),
        "minded": ("more than", CONCENTRATED),
    }
    parts = [
        _part(results, f"share, {at.description}", choices.share, at, *sides[at.author], SHARE)
        for author in sides
        for at in named
        if at.author == author
    ]
    return ClaimSpec(
        number=3,
        statement="Random authors spread papers evenly over journals, minded authors concentrate "
        "them in few.",
        source="section 7.5.1, figures 7.2 to 7.5",
        test="Of the papers of all years, the fourth of the journals that has most has at most "
        "0.35 with random authors (figures 7.2, 7.4), and more than half with minded ones (7.3, "
        "7.5).",
        parts=tuple(parts),
        needs=_needs(results, named),
    )


def _acceptance_tells(
    results: Results, scenarios: Sequence[Condition], choices: Choices
) -> ClaimSpec:
    named = _named(scenarios, choices)
    random, minded = ([at for at in named if at.author == who] for who in ("random", "minded"))
    return ClaimSpec(
        number=4,
        statement="With random authors acceptance rates are anti-correlated with mean published "
        "quality, with minded authors loosely correlated.",
        source="section 7.5.1, figures 7.2 to 7.5",
        test="The correlation of acceptance rate and mean quality over journals is below -0.5 with "
        "random authors (figures 7.2, 7.4), and between -0.5 and 0.5 with minded ones (7.3, 7.5).",
        parts=(
            *_parts(results, choices, "acceptance_rate", random, "less than", -LOOSE),
            *_parts(results, choices, "acceptance_rate", minded, "within", LOOSE),
        ),
        needs=_needs(results, named),
    )


def _strict_declines(
    results: Results, scenarios: Sequence[Condition], choices: Choices
) -> ClaimSpec:
    del choices  # nothing is open here
    strict = _of(_static(scenarios), STRICT)
    parts = []
    for at in strict:
        parts += [
            _part(results, f"papers, {at.description}", growth, at, "less than", 0.0, SHARE),
            _part(
                results, f"centre, {at.description}", off_centre, at, "within", NEAR, "of the range"
            ),
            _part(
                results,
                f"skewness, {at.description}",
                skewness,
                at,
                "within",
                SYMMETRIC,
                "skewness",
            ),
        ]
    return ClaimSpec(
        number=5,
        statement="With improve-only editors the papers of a year become fewer, and their "
        "qualities turn from a power law to a bell near the middle of the range.",
        source="section 7.5.2",
        test="The last year has fewer papers than the first; in the last five, the mean quality "
        "lies within a tenth of the range of its middle, and the skewness within 0.5 of none.",
        parts=tuple(parts),
        needs=_needs(results, strict),
    )


def _authors_learn(results: Results, at: Sequence[Condition], choices: Choices) -> ClaimSpec:
    return ClaimSpec(
        number=6,
        statement="With authors that learn, the number of papers of a journal goes with their "
        "quality, and the impact factor does not.",
        source="section 7.5.3, figure 7.9",
        test="Over journals, the correlation of number of papers and mean quality is above 0.5, "
        "that of impact factor and mean quality below.",
        parts=(
            *_parts(results, choices, "papers", at, "more than", TELLS),
            *_parts(results, choices, "impact_factor", at, "less than", TELLS),
        ),
        needs=_needs(results, at),
    )


def _editors_learn(results: Results, at: Sequence[Condition], choices: Choices) -> ClaimSpec:
    return ClaimSpec(
        number=7,
        statement="With editors that learn, impact factor and mean quality correlate.",
        source="section 7.5.3, figure 7.8",
        test="The correlation of impact factor and mean quality over journals is above 0.5.",
        parts=_parts(results, choices, "impact_factor", at, "more than", TELLS),
        needs=_needs(results, at),
    )


_ABOUT_STATIC = (
    _h_index_tells,
    _impact_factor_tells_if_mild,
    _random_spreads,
    _acceptance_tells,
    _strict_declines,
)


def _parts(
    results: Results,
    choices: Choices,
    name: str,
    scenarios: Sequence[Condition],
    side: Side,
    margin: float,
) -> tuple[Part, ...]:
    """A part for each scenario: where the correlation of an indicator with quality lies."""
    measure, words = choices.correlation(name), name.replace("_", " ")
    return tuple(
        _part(results, f"{words}, {at.description}", measure, at, side, margin, CORRELATION)
        for at in scenarios
    )


def _part(
    results: Results,
    label: str,
    measure: Measure,
    at: Condition,
    side: Side,
    margin: float,
    unit: str,
) -> Part:
    terms = ((1.0, results.trials(measure, at)),)
    return Part(label=label, terms=terms, side=side, margin=margin, unit=unit)


def _static(scenarios: Sequence[Condition]) -> list[Condition]:
    return [at for at in scenarios if "learned" not in (at.author, at.editor)]


def _named(scenarios: Sequence[Condition], choices: Choices) -> list[Condition]:
    """Those that section 7.5.1 names where it compares authors: figures 7.2 to 7.5."""
    return [at for at in _static(scenarios) if at.size in choices.sizes]


def _of(scenarios: Sequence[Condition], editor: str) -> list[Condition]:
    return [at for at in scenarios if at.editor == editor]


def _needs(results: Results, scenarios: Sequence[Condition]) -> tuple[Need, ...]:
    """The chapter's simulations, and its training of those who learn."""
    learn = [at for at in scenarios if "learned" in (at.author, at.editor)]
    return tuple(
        Need(
            verb=f"{verb} for",
            unit=size.replace("_", " "),
            needed=needed,
            run=results.least(attribute(size), of),
        )
        for size, of, verb, needed in (
            ("years", scenarios, "simulated", YEARS),
            ("steps_per_year", scenarios, "simulated", STEPS_PER_YEAR),
            ("episodes", learn, "trained", EPISODES),
        )
    )
