"""How the studies draw: one look for every figure, and drawings that are the same byte for byte.

A drawing has no background and its text and axes are in `currentColor`, so that it takes the
ink of the page it stands on, light or dark.  Text is drawn as outlines: no font needs to be
there, and a figure is the same picture on every machine.  Series differ in colour, dash and
marker, so that none of the three alone has to carry the difference.

Nothing here touches pyplot; matplotlib's settings are changed only inside `style`, and a
user's own settings file has no influence:

    @style()
    def reward_figure(curves: Curves) -> Figure:
        drawing, panels = new_figure(rows=3, columns=2)
        for panel, condition in zip(panels.flat, curves):
            panel.set_title(condition.title)
            for series, line in zip(SERIES, condition.lines):
                rows += draw_mean(panel, line.episode, line.reward, series, line.name)
        draw_legend(drawing, fullest(panels))
        return Figure(..., svg=svg(drawing), data=data_table("rewards", columns, rows))
"""

import io
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ethogram.core.findings import Cell, Table
from ethogram.studies.statistics import interval_of_mean

if TYPE_CHECKING:  # slow to load, and only drawing needs it
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

Row = tuple[Cell, ...]  # of a figure's data

# matplotlib knows no currentColor: it draws with this colour, and `svg` puts the other in.
INK = "#010203"
PAGE_WIDTH = 7.2  # inches: at the page's text size, two panels side by side
PANEL_HEIGHT = 1.75  # inches

_STYLE: dict[str, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": INK,
    "axes.facecolor": "none",
    "axes.formatter.use_mathtext": True,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "axes.labelcolor": INK,
    "axes.labelsize": 8,
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlepad": 5,
    "axes.titlesize": 8.5,
    "axes.titleweight": "bold",
    "axes.xmargin": 0.02,
    "figure.constrained_layout.use": True,
    "figure.facecolor": "none",
    "font.family": "DejaVu Sans",  # comes with matplotlib
    "font.size": 8,
    "grid.alpha": 0.16,
    "grid.color": INK,
    "grid.linewidth": 0.5,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "lines.linewidth": 1.4,
    "lines.markersize": 4,
    "savefig.facecolor": "none",
    "svg.fonttype": "path",
    "svg.hashsalt": "ethogram",
    "text.color": INK,
    "xtick.color": INK,
    "xtick.labelsize": 7.5,
    "xtick.major.width": 0.6,
    "ytick.color": INK,
    "ytick.labelsize": 7.5,
    "ytick.major.size": 0,
}


@dataclass(frozen=True)
class Series:
    """How one series looks wherever it appears: colour, dash and marker say the same thing."""

    colour: str
    dash: str | tuple[float, tuple[float, ...]]
    marker: str


# The hues that Okabe and Ito (2008) chose to stay apart for colour-blind readers, kept to those
# with a contrast of at least 3 on white and on near-black; the fifth and sixth are darkened.
SERIES: tuple[Series, ...] = (
    Series("#0072b2", "-", "o"),
    Series("#d55e00", (0, (5, 1.6)), "s"),
    Series("#009e73", (0, (4, 1.4, 1, 1.4)), "^"),
    Series("#cc79a7", (0, (1, 1.2)), "D"),
    Series("#a87400", (0, (8, 2, 1, 2, 1, 2)), "v"),
    Series("#7d7d7d", (0, (2.5, 1)), "X"),
)


@contextmanager
def style() -> Iterator[None]:
    """Draw in Ethogram's look inside this block, or in a function that this decorates."""
    from matplotlib import style as matplotlib_style

    with matplotlib_style.context(["default", _STYLE]):
        yield


def new_figure(
    rows: int = 1,
    columns: int = 1,
    *,
    width: float = PAGE_WIDTH,
    height: float | None = None,
    share_x: bool | Literal["row", "col"] = "col",
    share_y: bool | Literal["row", "col"] = "row",
) -> "tuple[Drawing, np.ndarray[tuple[int, int], np.dtype[Any]]]":
    """A drawing and its panels as a (rows, columns) array of `Axes`; sizes in inches."""
    from matplotlib.figure import Figure as Drawing

    drawing = Drawing(figsize=(width, height or 0.5 + PANEL_HEIGHT * rows))
    panels = drawing.subplots(rows, columns, sharex=share_x, sharey=share_y, squeeze=False)
    return drawing, panels


def draw_band(
    axes: "Axes",
    x: ArrayLike,
    middle: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    series: Series,
    label: str,
    *,
    markers: bool = False,
) -> None:
    """Draw a line in the middle of its interval; `markers` for a few points, each worth seeing."""
    axes.fill_between(
        np.asarray(x), np.asarray(low), np.asarray(high), color=series.colour, alpha=0.2, lw=0
    )
    axes.plot(
        x,
        middle,
        color=series.colour,
        linestyle=series.dash,
        marker=series.marker if markers else "",
        label=label,
    )


def draw_mean(
    axes: "Axes",
    x: ArrayLike,
    samples: NDArray[Any],
    series: Series,
    label: str,
    *,
    markers: bool = False,
) -> list[Row]:
    """Draw the mean over trials, the first axis of `samples`, with its 95% band.

    Returns what was drawn as rows of x, mean, low, high.
    """
    mean = samples.mean(0)
    low, high = interval_of_mean(samples)
    draw_band(axes, x, mean, low, high, series, label, markers=markers)
    return [
        (float(at), *(float(number) for number in numbers))
        for at, *numbers in zip(np.asarray(x), mean, low, high, strict=True)
    ]


BOX_COLUMNS = ("minimum", "lower quartile", "median", "upper quartile", "maximum")


def draw_boxes(
    axes: "Axes", samples: Mapping[str, NDArray[Any]], series: Sequence[Series]
) -> list[Row]:
    """One box per named sample: quartiles, median in the page's ink, whiskers at 1.5 IQR.

    Returns, for each sample that is not empty, a row of its name and `BOX_COLUMNS`.
    """
    from matplotlib.colors import to_rgba

    drawn = axes.boxplot(
        [np.asarray(sample, dtype=float) for sample in samples.values()],
        manage_ticks=False,  # which would tick shared axes once per panel
        widths=0.55,
        patch_artist=True,
        medianprops={"color": INK, "linewidth": 1.4},
        flierprops={"marker": ".", "markersize": 3},
    )
    axes.set_xticks(np.arange(1, len(samples) + 1), list(samples))
    axes.set_xlim(0.5, len(samples) + 0.5)
    whiskers = np.reshape(drawn["whiskers"], (-1, 2))
    caps = np.reshape(drawn["caps"], (-1, 2))
    for look, box, whisker, cap, outliers in zip(
        series, drawn["boxes"], whiskers, caps, drawn["fliers"], strict=False
    ):
        box.set(facecolor=to_rgba(look.colour, 0.28), edgecolor=look.colour)
        for line in (*whisker, *cap):
            line.set_color(look.colour)
        outliers.set(markerfacecolor=look.colour, markeredgecolor="none")
    quartiles = (0, 0.25, 0.5, 0.75, 1)
    return [
        (name, *(float(quantile) for quantile in np.quantile(sample, quartiles)))
        for name, sample in samples.items()
        if np.size(sample)
    ]


def draw_legend(drawing: "Drawing", panel: "Axes", *, columns: int = 4) -> None:
    """Name the series of `panel` once, above all panels, the same everywhere."""
    handles, labels = panel.get_legend_handles_labels()
    drawing.legend(handles, labels, loc="outside upper left", ncols=columns, borderaxespad=0.2)


def fullest(panels: NDArray[Any]) -> "Axes":
    """The panel with the most series, to take the legend from."""
    axes: "Axes" = max(panels.flat, key=lambda panel: len(panel.get_legend_handles_labels()[0]))
    return axes


def data_table(figure: str, columns: tuple[str, ...], rows: Sequence[Row]) -> Table:
    """The numbers behind the figure of that name."""
    return Table(
        name=figure, title=f"Data of {figure}", caption="", columns=columns, rows=tuple(rows)
    )


def svg(drawing: "Drawing") -> str:
    """The drawing as one <svg> element, the same bytes for the same drawing."""
    page = io.StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with style():
        drawing.savefig(page, format="svg", metadata=nothing)
    element = page.getvalue()
    element = element[element.index("<svg") :]
    element = re.sub(r"<!--.*?-->\s*", "", element, flags=re.DOTALL)  # repeats every label
    # The default stylesheet would reach out of the drawing to the whole page.
    element = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>\s*", "", element, flags=re.DOTALL)
    element = element.replace("<svg ", '<svg stroke-linejoin="round" ', 1)
    element = re.sub(r'(?<= d=")[^"]*', _shortened, element)
    element = re.sub(r'(?<=translate\()[^)]*|(?<= [xy]=")[^"]*', _hundredths, element)
    element = re.sub(
        r'(?<= style=")[^"]*', lambda rules: re.sub(r"(?<=[:;]) ", "", rules[0]), element
    )
    # Names that nothing refers to, and indents: a fifth of a drawing of many panels.
    used = set(re.findall(r'(?:href="#|url\(#)([^")]+)', element))
    element = re.sub(r' id="([^"]*)"', lambda name: name[0] if name[1] in used else "", element)
    element = re.sub(r"\n\s+", "\n", element)
    return element.replace(INK, "currentColor")


def _shortened(path: re.Match[str]) -> str:
    """Path data to a hundredth of a point, which no eye sees, in a third of the bytes."""
    path_data = _hundredths(path).replace(" \n", " ").strip()
    if set(re.findall("[A-Za-z]", path_data)) <= set("MLz"):
        path_data = re.sub(r"M (\S+ \S+) L \1(?= M|$)", r"M \1 z", path_data)  # a dot
        path_data = path_data.replace(" L ", " ")  # what follows a move or a line is a line
    return path_data


def _hundredths(numbers: re.Match[str]) -> str:
    """Numbers with more decimals than two, rounded."""
    return re.sub(r"-?\d+\.\d{3,}", lambda number: f"{float(number[0]):.2f}", numbers[0])
