"""Figures 2.1 to 2.4, and the words of a learned language."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ethogram.campaign.study import Records
from ethogram.core.findings import Figure
from ethogram.studies.language.plan import CURVE, SELECTED, Condition
from ethogram.studies.language.published import REFERENCE_REWARD, VALIDATION_REWARD
from ethogram.studies.language.results import SETTINGS, Results, Setting, validation_return
from ethogram.studies.plotting import (
    BOX_COLUMNS,
    INK,
    SERIES,
    Row,
    Series,
    data_table,
    draw_boxes,
    draw_legend,
    draw_mean,
    fullest,
    new_figure,
    style,
    svg,
)
from ethogram.studies.statistics import interval_of_mean

if TYPE_CHECKING:  # slow to load, and only drawing needs it
    from matplotlib.axes import Axes

LEARNED, SILENCE, OPTIMAL, NO_COMMUNICATION, *REFERENCES = SERIES
POLICIES = (NO_COMMUNICATION, OPTIMAL, LEARNED, *REFERENCES)  # as `Setting.selected` has them
THIN = 1.0  # points, of a line that is there to compare with
MARKED = 20  # a line of no more points than these has a marker at each
BOXES = (0.0, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0)  # e of figure 2.3
LEARNING = (Setting(2, 2), Setting(3, 3), Setting(4, 4))  # of figure 2.4
SETTING_COLUMNS = ("robots", "targets")
ROW = 0.2  # inches of an association's row
FULL_SQUARE = 80.0  # points squared, of a word that is certain
SEEN = 0.005  # the least probability of a word that is drawn


@style()
def figures(records: Records) -> list[Figure]:
    """Every figure that the records have data for."""
    results = Results.of(records)
    drawn = [
        _averaged(results),
        _validation(results),
        _boxes(results),
        _learning(results),
        _words(results),
    ]
    return [figure for figure in drawn if figure is not None]


def _averaged(results: Results) -> Figure | None:
    """Figure 2.1, of the settings that were run whole."""
    whole = results.settings_with(CURVE)
    if not whole:
        return None
    drawing, panels = new_figure(1, 1)
    panel = panels[0, 0]
    averaged = results.normalised(whole, CURVE).mean(0)
    rows = draw_mean(panel, CURVE, averaged, LEARNED, "learned")
    panel.set(xlabel="expressiveness e", ylabel="normalised R_val")
    return Figure(
        name="figure-2-1",
        title="Figure 2.1: Normalised validation reward against expressiveness",
        caption="R_val scaled, in each trial and setting, to mean 0 and deviation 1 over all |W|; "
        "averaged over the settings of which all were run, (n_r, n_t) = "
        f"{_listed(whole)}; mean over trials with 95% band (of fewer than five, their range).",
        alt="Normalised validation reward against expressiveness from 0 to 4, one line; highest "
        f"at e = {CURVE[averaged.mean(0).argmax()]:g}.",
        svg=svg(drawing),
        data=data_table("figure-2-1", ("e", "mean", "low", "high"), rows),
    )


def _validation(results: Results) -> Figure | None:
    """Figure 2.2."""
    return _panels(
        results.settings,
        name="figure-2-2",
        title="Figure 2.2: Validation reward against expressiveness",
        caption="Mean R_val over trials with 95% bands and bars (of fewer than five, their "
        "range); crosses: the thesis' "
        "Table 2.2. Lines across: hand-made reference controllers that know the targets of all "
        "robots (informed) or of none.",
        alt="A panel per number of robots and targets: R_val of learned policies against "
        "expressiveness, with both baselines and two reference controllers.",
        columns=("series", "e", "mean", "low", "high"),
        labels=("expressiveness e", "R_val"),
        draw=lambda panel, setting: _draw_validation(panel, results, setting),
    )


def _draw_validation(panel: "Axes", results: Results, setting: Setting) -> list[Row]:
    return [
        *_curve(panel, results, setting, False),
        *_curve(panel, results, setting, True),
        *_dot(panel, results, setting.optimal, OPTIMAL, "Opt"),
        *_dot(panel, results, setting.no_communication, NO_COMMUNICATION, "NoComm"),
        *_references(panel, setting),
        *_printed(panel, setting),
    ]


def _curve(panel: "Axes", results: Results, setting: Setting, silence: bool) -> list[Row]:
    """R_val of learned policies, those that may be silent or those that may not."""
    wanted = (*setting, "learned", silence)
    line = [at for at in results.by_condition if (*at[:3], at.silence) == wanted]
    if not line:
        return []
    e = [condition.expressiveness for condition in line]
    samples = [validation_return(results.by_condition[condition]) for condition in line]
    look, name = (SILENCE, "learned or silence") if silence else (LEARNED, "learned")
    markers = len(line) <= (1 if silence else MARKED)
    drawn = draw_mean(panel, e, np.stack(samples, 1), look, name, markers=markers)
    if silence:
        panel.lines[-1].set_linewidth(THIN)
    return [(name, *row) for row in drawn]


def _dot(
    panel: "Axes", results: Results, condition: Condition, look: Series, name: str
) -> list[Row]:
    """A baseline as a dot with its interval."""
    if condition not in results.by_condition:
        return []
    e, samples = condition.expressiveness, validation_return(results.by_condition[condition])
    low, high = interval_of_mean(samples)
    panel.vlines(e, low, high, color=look.colour)
    panel.plot(e, samples.mean(), color=look.colour, marker=look.marker, linestyle="", label=name)
    return [(name, e, float(samples.mean()), float(low), float(high))]


def _references(panel: "Axes", setting: Setting) -> list[Row]:
    """The reference controllers as lines across."""
    rows: list[Row] = []
    for (name, per_robot), look in zip(REFERENCE_REWARD.items(), REFERENCES, strict=True):
        if setting.targets in per_robot:
            level = setting.robots * per_robot[setting.targets]
            panel.axhline(level, color=look.colour, linestyle=look.dash, lw=THIN, label=name)
            rows.append((name, None, level, None, None))
    return rows


def _printed(panel: "Axes", setting: Setting) -> list[Row]:
    """What Table 2.2 says of the setting, as crosses."""
    keys = [(*setting, e) for e in SELECTED]
    reward = [(key[2], VALIDATION_REWARD[key][0]) for key in keys if key in VALIDATION_REWARD]
    if reward:
        panel.plot(*zip(*reward, strict=True), color=INK, marker="x", linestyle="", label="thesis")
    return [("thesis", e, level, None, None) for e, level in reward]


def _boxes(results: Results) -> Figure | None:
    """Figure 2.3, of the settings that were run at each e."""
    settings = {e: run for e in BOXES if (run := results.settings_with([e]))}
    if not settings:
        return None
    drawing, panels = new_figure(1, 1)
    panel = panels[0, 0]
    samples = {f"{e:g}": results.normalised(run, [e]).reshape(-1) for e, run in settings.items()}
    rows = draw_boxes(panel, samples, [LEARNED] * len(samples))
    panel.set(xlabel="expressiveness e", ylabel="normalised R_val")
    return Figure(
        name="figure-2-3",
        title="Figure 2.3: Spread of the normalised validation reward",
        caption="Every trial of every setting, scaled in each of them to mean 0 and deviation 1 "
        f"over all |W| that were run; (n_r, n_t) = {_listed_by_e(settings)}. Boxes are "
        "quartiles, whiskers reach 1.5 times their distance.",
        alt="Box plots of normalised validation reward at values of expressiveness: "
        f"{', '.join(samples)}.",
        svg=svg(drawing),
        data=data_table("figure-2-3", ("e", *BOX_COLUMNS), rows),
    )


def _learning(results: Results) -> Figure | None:
    """Figure 2.4."""

    def draw(panel: "Axes", setting: Setting) -> list[Row]:
        rows: list[Row] = []
        for look, (name, condition) in zip(POLICIES, setting.selected().items(), strict=True):
            data = results.by_condition.get(condition)
            if data is not None:
                thousands, reward = data["point"].values / 1000, data["training_return"].values
                rows += [(name, *row) for row in draw_mean(panel, thousands, reward, look, name)]
        return rows

    run = results.by_condition.keys()
    shown = [
        one
        for one in results.settings
        if (one in LEARNING or one not in SETTINGS) and not run.isdisjoint(one.selected().values())
    ]
    return _panels(
        shown,
        name="figure-2-4",
        title="Figure 2.4: Learning reward during training",
        caption="R_learn, the return of training episodes averaged since the last point; mean "
        "over trials with 95% bands (of fewer than five, their range).",
        alt="A panel per setting: learning reward against training episodes for three values of "
        "expressiveness and both baselines.",
        columns=("policy", "thousand episodes", "mean", "low", "high"),
        labels=("training episodes (thousands)", "R_learn"),
        draw=draw,
    )


def _words(results: Results) -> Figure | None:
    """What each talker of one trial says for each association that it can know."""
    spoken = [
        at for at in results.by_condition if at.talkers == "learned" and at.vocabulary_size > 0
    ]
    if not spoken:
        return None
    condition = max(spoken, key=lambda at: (-abs(at.expressiveness - 1), at.associations))
    meaning = results.by_condition[condition]["meaning"].values[0]
    first = 0 if condition.silence else 1
    rows: list[Row] = [
        (talker + 1, guided + 1, target + 1, word, float(probability))
        for (talker, guided, target, word), probability in np.ndenumerate(meaning)
        if word >= first and guided != talker
    ]
    return Figure(
        name="words",
        title=f"The words of a learned language: {condition.description}",
        caption="The first trial. A square's area is the probability of a word, for each "
        "association that a talker can know: two large squares in a column are a homonym, several "
        "in a row are synonyms.",
        alt=f"A panel for each of {condition.robots} talkers: associations against words, with "
        "squares as large as the probability that the talker says the word.",
        svg=_draw_words(meaning, first),
        data=data_table("words", ("talker", "guided", "target", "word", "probability"), rows),
    )


def _draw_words(meaning: np.ndarray, first: int) -> str:
    """A panel per talker, with a square per association and word, from word `first` on."""
    talkers, _, targets, words = meaning.shape
    associations = (talkers - 1) * targets
    down = math.ceil(talkers / 2)
    drawing, panels = new_figure(
        down, 2, height=down * (0.55 + ROW * associations), share_x=False, share_y=False
    )
    for panel in panels.flat[talkers:]:
        panel.set_axis_off()
    for talker, panel in zip(range(talkers), panels.flat, strict=False):
        others = [robot for robot in range(talkers) if robot != talker]
        said = meaning[talker, others].reshape(associations, words)
        row, word = np.nonzero(said >= SEEN)
        area = FULL_SQUARE * said[row, word]
        panel.scatter(word, row, s=area, marker="s", color=LEARNED.colour, lw=0, zorder=3)
        names = [
            f"robot {one + 1} → target {goal + 1}" for one in others for goal in range(targets)
        ]
        panel.set_yticks(range(associations), names)
        panel.set_xticks(range(first, words), ["silence", *map(str, range(1, words))][first:])
        panel.set(title=f"talker {talker + 1}", xlabel="word")
        panel.set(xlim=(first - 0.6, words - 0.4), ylim=(associations - 0.4, -0.6))
        panel.grid(visible=True, axis="both")
    return svg(drawing)


def _panels(
    settings: Sequence[Setting],
    *,
    name: str,
    title: str,
    caption: str,
    alt: str,
    columns: tuple[str, ...],
    labels: tuple[str, str],
    draw: Callable[["Axes", Setting], Sequence[Row]],
) -> Figure | None:
    """A figure with a panel per setting, at most three in a row; none without a setting."""
    if not settings:
        return None
    across = min(3, len(settings))
    drawing, panels = new_figure(math.ceil(len(settings) / across), across, share_y=False)
    rows: list[Row] = []
    for panel in panels.flat[len(settings) :]:
        panel.set_axis_off()
    for setting, panel in zip(settings, panels.flat, strict=False):
        panel.set_title(setting.description)
        rows += [(*setting, *row) for row in draw(panel, setting)]
    for panel in panels[-1]:
        panel.set_xlabel(labels[0])
    for panel in panels[:, 0]:
        panel.set_ylabel(labels[1])
    draw_legend(drawing, fullest(panels))
    return Figure(
        name=name,
        title=title,
        caption=caption,
        alt=alt,
        svg=svg(drawing),
        data=data_table(name, SETTING_COLUMNS + columns, rows),
    )


def _listed_by_e(settings: Mapping[float, Sequence[Setting]]) -> str:
    """Which settings were run at which e, those at which the same ones were run together."""
    together: dict[str, list[str]] = {}
    for e, run in settings.items():
        together.setdefault(_listed(run), []).append(f"{e:g}")
    return "; ".join(f"{run} at e = {', '.join(at)}" for run, at in together.items())


def _listed(settings: Sequence[Setting]) -> str:
    return ", ".join(f"({one.robots}, {one.targets})" for one in settings)
