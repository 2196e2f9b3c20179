import xml.etree.ElementTree as ET

import matplotlib
import numpy as np
import pytest

from ethogram.studies import plotting

X = np.linspace(0.0, 1.0, 20)


@plotting.style()
def sample() -> str:
    drawing, panels = plotting.new_figure(rows=2, columns=2)
    for panel in panels[0]:
        for series, name in zip(plotting.SERIES, ("one", "<two> & --", "three"), strict=False):
            plotting.draw_band(panel, X, X, X - 0.1, X + 0.1, series, name, markers=True)
        panel.set_title("a_title with 50 % & <")
    for panel in panels[1]:
        plotting.draw_boxes(panel, {"a": X, "b": X**2}, plotting.SERIES)
    plotting.draw_legend(drawing, panels[0, 0])
    return plotting.svg(drawing)


def test_a_drawing_is_the_same_bytes_each_time() -> None:
    assert sample() == sample()


def test_a_drawing_is_one_svg_with_neither_font_nor_style_nor_background() -> None:
    svg = sample()
    assert ET.fromstring(svg).tag == "{http://www.w3.org/2000/svg}svg"
    assert "<text" not in svg
    assert "<style" not in svg
    assert "#ffffff" not in svg


def test_text_and_axes_take_the_ink_of_the_page() -> None:
    svg = sample()
    assert svg.count("currentColor") > 20
    assert plotting.INK not in svg
    assert "#000000" not in svg


def test_a_users_own_settings_neither_reach_the_drawing_nor_are_changed() -> None:
    ours = sample()
    with matplotlib.rc_context({"lines.linewidth": 9.0, "font.size": 30.0}):
        assert sample() == ours
        assert matplotlib.rcParams["lines.linewidth"] == 9.0


def luminance(colour: str) -> float:
    parts = np.array([int(colour[start : start + 2], 16) / 255 for start in (1, 3, 5)])
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("series", plotting.SERIES, ids=lambda series: series.colour)
def test_every_series_stands_out_on_white_and_on_near_black(series: plotting.Series) -> None:
    assert (1.0 + 0.05) / (luminance(series.colour) + 0.05) >= 3
    assert (luminance(series.colour) + 0.05) / (luminance("#141517") + 0.05) >= 3


def test_no_two_series_share_a_colour_a_dash_or_a_marker() -> None:
    for part in ("colour", "dash", "marker"):
        assert len({getattr(series, part) for series in plotting.SERIES}) == len(plotting.SERIES)


@plotting.style()
def test_boxes_on_shared_axes_are_labelled_once() -> None:
    _, panels = plotting.new_figure(rows=2, columns=1, share_x=True)
    for panel in panels.flat:
        plotting.draw_boxes(panel, {"a": X, "b": X**2}, plotting.SERIES)
    assert [tick.get_text() for tick in panels[-1, 0].get_xticklabels()] == ["a", "b"]
    assert list(panels[-1, 0].get_xticks()) == [1, 2]


@plotting.style()
def test_an_empty_sample_leaves_its_place_empty() -> None:
    drawing, panels = plotting.new_figure()
    plotting.draw_boxes(panels[0, 0], {"a": X, "b": [], "c": X}, plotting.SERIES)
    assert [tick.get_text() for tick in panels[0, 0].get_xticklabels()] == ["a", "b", "c"]
    assert "nan" not in plotting.svg(drawing)
