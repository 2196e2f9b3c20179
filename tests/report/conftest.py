"""A page modelled on the study `sharing`, and one Chromium for all tests that look at pages."""

import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, sync_playwright
from tests.lacking import lacking

from ethogram.core.findings import Claim, ClaimPart, Figure, Measured, Revision, Table, Verdict
from ethogram.core.introduction import Introduction
from ethogram.report import StudyPage
from ethogram.studies import plotting

SCENARIOS = ("cooperative", "mixed", "competitive")
FILLINGS = ("hidden", "observed")
STRATEGIES = ("always", "optional", "none", "random")

PUBLISHED = {
    ("cooperative", "always"): (99.0, 99.0),
    ("cooperative", "none"): (79.3, 99.0),
    ("cooperative", "optional"): (98.8, 99.0),
    ("mixed", "always"): (99.0, 99.0),
    ("mixed", "none"): (89.0, 99.0),
    ("mixed", "optional"): (93.6, 95.0),
    ("competitive", "always"): (25.4, 21.6),
    ("competitive", "none"): (69.4, 21.4),
    ("competitive", "optional"): (49.8, 59.4),
}

STATEMENTS: tuple[tuple[str, Verdict], ...] = (
    ("Agents that always communicate earn most and share most evenly in all settings.", "refuted"),
    ("The lead over agents that never communicate is larger when filling is hidden.", "confirmed"),
    ("Optional communication does as well as constant communication in cooperation.", "confirmed"),
    ("Optional does worse than constant in competition when filling is hidden.", "confirmed"),
    ("Random agents do worst everywhere.", "confirmed"),
    ("The displacement of agents settles within ten steps.", "undecided"),
    ("In cooperation, optional talk is commonest in the first steps, then falls.", "confirmed"),
    ("In competition the best-off optional agents earn more than any others.", "undecided"),
    ("Confirming agents talk more than changing ones in cooperation only.", "not run"),
)


REVISION = Revision(
    date="2026-11-05",
    change="A lead must exist to be larger.",
    reason="Without one the test says nothing.",
    known="A first run of all conditions.",
)


SHARED = Revision(
    date="2026-11-06", change="The margin is wider.", reason="It was narrow.", known="Nothing."
)
MEASURED = ClaimPart(
    compared="J(always) - J(none), mixed", effect=0.7, low=0.6, high=0.8, unit="reward per step",
    side="more than", margin=0.5,
)  # fmt: skip
MISSING = replace(
    MEASURED, compared="J(always) - J(none)", effect=None, low=None, high=None, note="not run: none"
)
PARTS = (MEASURED, MISSING)


def claim(number: int, statement: str, verdict: Verdict) -> Claim:
    ran = verdict != "not run"
    return Claim(
        number=number,
        statement=statement,
        source="section 3.4, figure 3.2",
        test="difference of the trials' means, margin 2 % of the largest possible return",
        effect=0.1234 * number if ran else None,
        low=0.1234 * number - 0.031 if ran else None,
        high=0.1234 * number + 0.031 if ran else None,
        unit="reward per step",
        p_value=min(1.0, 0.0002 * 3**number) if ran else None,
        verdict=verdict,
        note="" if ran else "The plan has no condition with optional communication.",
        side="more than" if ran else None,
        margin=0.5 if ran else None,
        compared="always - none" if ran else "",
        stated="2026-11-01",
        history=(REVISION,) if number == 2 else (SHARED,) if number in (3, 4) else (),
        depends_on=("J in validation: undecided",) if number == 2 else (),
        parts=PARTS if number == 1 else (),
    )


def table_3_2() -> Table:
    rng = np.random.default_rng(32)

    def measured(published: float) -> Measured:
        value = min(99.0, published + rng.normal(0, 1.5))
        low, high = value - 1.2, min(99.0, value + 1.2)
        return Measured(value=value, low=low, high=high, published=published)

    return Table(
        name="table-3-2",
        title="Table 3.2. Largest validation return.",
        caption="The largest individual return over trials, validation episodes and agents.",
        columns=("scenario", "communication", "filling hidden", "filling observed"),
        rows=tuple((*key, *map(measured, values)) for key, values in PUBLISHED.items()),
    )


def timeline() -> Table:
    rng = np.random.default_rng(33)
    return Table(
        name="table-3-3",
        title="Table 3.3. Ten agents that may communicate, step by step.",
        caption="Cooperative, filling hidden. A star marks the agent with the largest return.",
        columns=("agent", *map(str, range(1, 11))),
        rows=tuple(
            (f"{agent}{' ★' if agent == 4 else ''}", *rng.choice(list("○●▽▼△▲"), 10).tolist())
            for agent in range(1, 11)
        ),
    )


@plotting.style()
def curves(name: str, title: str, *, markers: bool = False) -> Figure:
    """A 3 x 2 grid of line plots with bands."""
    drawing, panels = plotting.new_figure(rows=3, columns=2)
    x = np.arange(1, 11) if markers else np.linspace(0, 20_000, 150)
    rows: list[tuple[str | float, ...]] = []
    for row, scenario in zip(panels, SCENARIOS, strict=True):
        for panel, filling in zip(row, FILLINGS, strict=True):
            panel.set_title(f"{scenario.capitalize()}, filling {filling}")
            for rank, (strategy, look) in enumerate(zip(STRATEGIES, plotting.SERIES, strict=False)):
                y = (1 - 0.15 * rank) * (1 - np.exp(-4 * x / x[-1] / (1 + rank)))
                plotting.draw_band(panel, x, y, y - 0.04, y + 0.04, look, strategy, markers=markers)
                rows += [(scenario, filling, strategy, *point) for point in zip(x, y, strict=True)]
        row[0].set_ylabel("reward per step")
    for panel in panels[-1]:
        panel.set_xlabel("step" if markers else "training episode")
    plotting.draw_legend(drawing, panels[0, 0])
    columns = ("scenario", "filling", "strategy", "x", "mean")
    data = Table(name=name, title=title, caption="", columns=columns, rows=tuple(rows))
    alt = f"{title} The order is always, optional, none, random in every panel."
    caption = "Mean over 20 trials; the band is the 95 % bootstrap interval."
    return Figure(
        name=name, title=title, caption=caption, alt=alt, svg=plotting.svg(drawing), data=data
    )


@plotting.style()
def boxes() -> Figure:
    rng = np.random.default_rng(36)
    drawing, panels = plotting.new_figure(rows=3, columns=2, share_x=True)
    for panel, scenario in zip(panels.flat, np.repeat(SCENARIOS, 2), strict=True):
        panel.set_title(scenario.capitalize())
        samples = {name: rng.normal(70 - 12 * rank, 8, 60) for rank, name in enumerate(STRATEGIES)}
        plotting.draw_boxes(panel, samples, plotting.SERIES)
    title = "Figure 3.6. Individual return in validation."
    data = Table(name="figure-3-6", title=title, caption="", columns=("x",), rows=((1.0,),))
    return Figure(
        name="figure-3-6",
        title=title,
        caption="Boxes span the quartiles.",
        alt="Box plots of the return by strategy.",
        svg=plotting.svg(drawing),
        data=data,
    )


@pytest.fixture(scope="session")
def sharing() -> StudyPage:
    titles = ("Reward.", "Overall reward.", "Inequality.", "Displacement.", "Communication.")
    return StudyPage(
        name="sharing",
        title="Sharing resources",
        question="Do agents that may tell each other where they go share better than silent ones?",
        introduction=Introduction(
            text="Ten agents share two resources.",
            source="A. Author, A thesis, 2020: chapter 3.",
            symbols={"J": "return, mean over agents", "I": "its standard deviation over agents"},
            case="second",
            frame=7,
            caption="An agent on its way.",
        ),
        plan="quick",
        plan_description="All 24 conditions with 4 trials of 2000 episodes: the direction only.",
        trials=4,
        cases_done=24,
        cases_planned=24,
        date="2026-11-20",
        seconds=161.3,
        command="ethogram run sharing --plan quick --out results",
        digest="9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
        settings={
            "world": {"scenario": list(SCENARIOS), "agents": 10, "resources": 2, "steps": 100},
            "learner": {"rate": 0.1, "discount": 0.9, "epsilon": {"decay": 0.9995, "last": 0.01}},
            "trials": 4,
        },
        versions={"ethogram": "0.1.0", "jax": "0.10.1", "numpy": "2.4.0", "python": "3.11.7"},
        claims=[claim(number, *said) for number, said in enumerate(STATEMENTS, start=1)],
        tables=[table_3_2(), timeline()],
        figures=[
            *(
                curves(f"figure-3-{number}", f"Figure 3.{number}. {title}", markers=number > 3)
                for number, title in enumerate(titles, start=1)
            ),
            boxes(),
        ],
    )


@pytest.fixture(scope="session")
def bare(sharing: StudyPage) -> StudyPage:
    """A study that was planned and never run."""
    return replace(
        sharing, name="bare", trials=None, cases_done=0, seconds=0.0, settings={}, versions={},
        claims=[], tables=[], figures=[],
    )  # fmt: skip


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    executable = next(filter(None, map(shutil.which, names)), None)
    if executable is None:
        lacking(f"no browser here (looked for {', '.join(names)}): pages were not looked at")
    flags = (
        "--no-sandbox --disable-gpu --disable-quic --no-first-run "
        "--disable-background-networking --disable-component-update --disable-sync"
    )
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=executable, args=flags.split())
        yield chromium
        chromium.close()


@pytest.fixture
def open_tab(browser: Browser) -> Iterator[Callable[..., Page]]:
    """A new tab with the given screen, closed after the test."""
    contexts = []

    def new(width: int = 1280, height: int = 900, **settings: Any) -> Page:
        contexts.append(
            browser.new_context(viewport={"width": width, "height": height}, **settings)
        )
        return contexts[-1].new_page()

    yield new
    for context in contexts:
        context.close()
