"""Figures 3.1 to 3.6, and the timelines of tables 3.3 and 3.4."""

from collections.abc import Callable, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ethogram.campaign.study import Records
from ethogram.core.findings import Figure
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
from ethogram.studies.sharing.compute import SHOWN
from ethogram.studies.sharing.plan import (
    FILLINGS,
    SCENARIOS,
    STRATEGIES,
    Condition,
    filling_word,
)
from ethogram.studies.sharing.results import Results
from ethogram.worlds.sharing.reward import Scenario

if TYPE_CHECKING:  # slow to load, and only drawing needs it
    from matplotlib.axes import Axes

LOOK = dict(zip(STRATEGIES, SERIES, strict=False))  # every strategy looks the same throughout
SETTING_COLUMNS = ("scenario", "filling")
Reader = Callable[[xr.Dataset], tuple[np.ndarray, np.ndarray]]  # -> x [point], y [trial, point]


@style()
def figures(records: Records) -> list[Figure]:
    """Every figure that the records have data for."""
    results = Results.of(records)
    if not results.by_condition:
        return []
    drawn = [
        _rewards(results),
        _curves(results, "3.2", "Overall return", "training_return", "J"),
        _curves(results, "3.3", "Inequality", "training_inequality", "I"),
        _displacement(results),
        _communication(results),
        _individual_returns(results),
        _timeline(results, Condition("cooperative", "optional", False), "3.3"),
        _timeline(results, Condition("competitive", "optional", True), "3.4"),
    ]
    return [figure for figure in drawn if figure is not None]


def _rewards(results: Results) -> Figure:
    """Figure 3.1."""
    drawing, panels = new_figure(1, 1)
    panel = panels[0, 0]
    rows: list[Row] = []
    for scenario, series in zip(SCENARIOS, SERIES, strict=False):
        found = [data for at, data in results.by_condition.items() if at.scenario == scenario]
        if not found:
            continue
        payoff = found[0]["payoff"]
        panel.plot(
            payoff["filling"],
            payoff,
            color=series.colour,
            linestyle=series.dash,
            marker=series.marker,
            label=scenario,
        )
        rows += [
            (scenario, int(filling), float(reward))
            for filling, reward in zip(payoff["filling"].values, payoff.values, strict=True)
        ]
    panel.set_xlabel("agents on the resource")
    panel.set_ylabel("reward per step")
    draw_legend(drawing, panel)
    return Figure(
        name="figure-3-1",
        title="Figure 3.1: Reward functions in three scenarios",
        caption="What a place on a resource pays an agent, by how many agents share it.",
        alt="Reward against filling: rising in the cooperative scenario, falling in the "
        "competitive one, rising to the capacity and then falling in the mixed one.",
        svg=svg(drawing),
        data=data_table("figure-3-1", ("scenario", "filling", "reward"), rows),
    )


def _curves(results: Results, number: str, what: str, variable: str, quantity: str) -> Figure:
    """Figures 3.2 and 3.3."""
    return _strategies(
        results,
        lambda data: (data["point"].values, data[variable].values),
        name=f"figure-{number.replace('.', '-')}",
        title=f"Figure {number}: {what} {quantity} over training",
        caption=f"Mean {quantity} over trials, each point an average over the episodes since "
        "the last, with 95% bands. Exploration continues during training.",
        alt=f"A panel per scenario and filling: {quantity} against training episodes "
        "for the four strategies.",
        columns=("strategy", "episode", "mean", "low", "high"),
        labels=("training episodes", quantity),
    )


def _displacement(results: Results) -> Figure:
    """Figure 3.4."""
    return _strategies(
        results,
        lambda data: (data["step"].values[:SHOWN], data["displacement"].values[:, :SHOWN]),
        name="figure-3-4",
        title="Figure 3.4: Displacement during the first steps of validation",
        caption="Eq. 3.14, mean over trials with 95% bands. 0 is an even split; all "
        "agents on one of two resources, or nobody active, give the number of agents.",
        alt="A panel per scenario and filling: displacement over the first ten steps "
        "for the four strategies.",
        columns=("strategy", "step", "mean", "low", "high"),
        labels=("step", "displacement d"),
        markers=True,
    )


def _strategies(results: Results, read: Reader, *, markers: bool = False, **frame: Any) -> Figure:
    """A line per strategy in every panel; `frame` goes to `_panels`."""

    def draw(panel: "Axes", setting: tuple[Scenario, bool]) -> list[Row]:
        rows: list[Row] = []
        for strategy in STRATEGIES:
            condition = Condition(setting[0], strategy, setting[1])
            look = LOOK[strategy]
            line = _line(panel, results, condition, read, look, strategy, markers=markers)
            rows += [(strategy, *row) for row in line]
        return rows

    return _panels(results, draw=draw, **frame)


def _communication(results: Results) -> Figure:
    """Figure 3.5."""
    shown = (("communication", SERIES[0]), ("reward", SERIES[1]))

    def draw(panel: "Axes", setting: tuple[Scenario, bool]) -> list[Row]:
        condition = Condition(setting[0], "optional", setting[1])
        return [
            (variable, *row)
            for variable, series in shown
            for row in _line(
                panel,
                results,
                condition,
                lambda data, variable=variable: (  # type: ignore[misc]
                    data["step"].values[:SHOWN],
                    data[variable].values[:, :SHOWN],
                ),
                series,
                f"average {variable}",
                markers=True,
            )
        ]

    return _panels(
        results,
        name="figure-3-5",
        title="Figure 3.5: Communication and reward with optional communication",
        caption="Share of agents that speak (eq. 3.15) and mean reward (eq. 3.16) over the first "
        "steps of validation, mean over trials with 95% bands.",
        alt="A panel per scenario and filling: average communication and average reward "
        "over the first ten steps.",
        columns=("quantity", "step", "mean", "low", "high"),
        labels=("step", "share, reward"),
        draw=draw,
    )


def _individual_returns(results: Results) -> Figure:
    """Figure 3.6."""

    def draw(panel: "Axes", setting: tuple[Scenario, bool]) -> list[Row]:
        samples: dict[str, np.ndarray] = {}
        for strategy in STRATEGIES:
            data = results.by_condition.get(Condition(setting[0], strategy, setting[1]))
            returns = np.empty(0) if data is None else data["validation_return"].values
            samples[strategy] = returns.reshape(-1)
        return draw_boxes(panel, samples, list(LOOK.values()))

    return _panels(
        results,
        name="figure-3-6",
        title="Figure 3.6: Individual return in validation",
        caption="Return of every agent in every validation episode of every trial; boxes are "
        "quartiles, whiskers reach 1.5 times their distance.",
        alt="A panel per scenario and filling: box plots of individual return for the "
        "four strategies.",
        columns=("strategy", *BOX_COLUMNS),
        labels=("", "return"),
        draw=draw,
        legend=False,
    )


def _timeline(results: Results, condition: Condition, number: str) -> Figure | None:
    """Tables 3.3 and 3.4: what each agent of one episode does, step by step."""
    data = results.by_condition.get(condition)
    if data is None:
        return None
    preference, spoke = data["first_preference"].values[0], data["first_spoke"].values[0]
    changed = preference != np.pad(preference[:-1], ((1, 0), (0, 0)))
    best = int(data["validation_return"].values[0, 0].argmax())
    name, (steps, agents) = f"table-{number.replace('.', '-')}", preference.shape
    filling = filling_word(condition.observed)
    rows: list[Row] = [
        (
            agent + 1,
            step + 1,
            "change" if changed[step, agent] else "confirm",
            int(preference[step, agent]),
            "yes" if spoke[step, agent] else "no",
        )
        for agent in range(agents)
        for step in range(steps)
    ]
    return Figure(
        name=name,
        title=f"Table {number}: Optional communication, {condition.scenario}, filling {filling}",
        caption="The first steps of the first trial's first validation episode. Circle: confirms "
        "its preference; triangle down: changes it to resource 1; triangle up: to resource 2 (a "
        "number names any other). Filled: speaks. ★: earns most in the episode.",
        alt=f"A grid of {agents} agents by {steps} steps; {int(spoke.sum())} of "
        f"{spoke.size} acts are spoken and {int(changed.sum())} change a preference.",
        svg=_draw_timeline(preference, changed, spoke, best),
        data=data_table(name, ("agent", "step", "act", "preference", "speaks"), rows),
    )


def _draw_timeline(
    preference: np.ndarray, changed: np.ndarray, spoke: np.ndarray, best: int
) -> str:
    """A row of symbols per agent (the second axis), a column per step; the best agent starred."""
    steps, agents = preference.shape
    drawing, panels = new_figure(1, 1, height=0.9 + 0.24 * agents)
    panel = panels[0, 0]
    for (step, agent), speaks in np.ndenumerate(spoke):
        panel.plot(
            step + 1,
            agent + 1,
            marker=_symbol(bool(changed[step, agent]), int(preference[step, agent])),
            markersize=8,
            markeredgewidth=1.3,
            color=LOOK["always"].colour if speaks else INK,
            fillstyle="full" if speaks else "none",
        )
    names = [f"{agent + 1} ★" if agent == best else str(agent + 1) for agent in range(agents)]
    panel.set_yticks(range(1, agents + 1), names)
    panel.set_xticks(range(1, steps + 1))
    panel.set(xlabel="step", ylabel="agent", xlim=(0.4, steps + 0.6), ylim=(agents + 0.6, 0.4))
    panel.grid(visible=False)
    return svg(drawing)


def _symbol(changed: bool, preference: int) -> str:
    if not changed:
        return "o"
    return {1: "v", 2: "^"}.get(preference, f"${preference}$")


def _panels(
    results: Results,
    *,
    name: str,
    title: str,
    caption: str,
    alt: str,
    columns: tuple[str, ...],
    labels: tuple[str, str],
    draw: Callable[["Axes", tuple[Scenario, bool]], Sequence[Row]],
    legend: bool = True,
) -> Figure:
    """A figure with a row of panels per scenario that was run and a column per filling."""
    run = results.by_condition
    scenarios = [each for each in SCENARIOS if any(at.scenario == each for at in run)]
    fillings = [each for each in FILLINGS if any(at.observed == each for at in run)]
    drawing, panels = new_figure(len(scenarios), len(fillings))
    rows: list[Row] = []
    for (scenario, observed), panel in zip(product(scenarios, fillings), panels.flat, strict=True):
        panel.set_title(f"{scenario}, filling {filling_word(observed)}")
        drawn = draw(panel, (scenario, observed))
        rows += [(scenario, filling_word(observed), *row) for row in drawn]
    for panel in panels[-1]:
        panel.set_xlabel(labels[0])
    for panel in panels[:, 0]:
        panel.set_ylabel(labels[1])
    if legend:
        draw_legend(drawing, fullest(panels))
    return Figure(
        name=name,
        title=title,
        caption=caption,
        alt=alt,
        svg=svg(drawing),
        data=data_table(name, SETTING_COLUMNS + columns, rows),
    )


def _line(
    panel: "Axes",
    results: Results,
    condition: Condition,
    read: Reader,
    series: Series,
    label: str,
    *,
    markers: bool = False,
) -> list[Row]:
    """Draw the mean over trials with its band; return what was drawn, point by point."""
    data = results.by_condition.get(condition)
    if data is None:
        return []
    x, samples = read(data)
    return draw_mean(panel, x, samples, series, label, markers=markers)
