import xml.etree.ElementTree as ET

import pytest

from ethogram.core.errors import EthogramError
from ethogram.report.drawings import alone, inlined

LINKED = (
    '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">'
    '<defs><path id="m1" d="M 0 0"/><clipPath id="p1"><rect/></clipPath></defs>'
    '<use xlink:href="#m1" style="fill: #0072b2"/><g clip-path="url(#p1)"/></svg>'
)


def test_every_id_and_every_use_of_it_begin_with_the_figures_name() -> None:
    root = ET.fromstring(inlined(LINKED, name="figure-1", alt=""))
    assert {e.get("id") for e in root.iter() if e.get("id")} == {"figure-1.m1", "figure-1.p1"}
    assert root.find("use").get("href") == "#figure-1.m1"  # type: ignore[union-attr]
    assert root.find("use").get("style") == "fill: #0072b2"  # type: ignore[union-attr]
    assert root.find("g").get("clip-path") == "url(#figure-1.p1)"  # type: ignore[union-attr]


def test_an_inlined_drawing_is_an_image_with_its_text_as_text() -> None:
    root = ET.fromstring(inlined(LINKED, name="f", alt='<b>"A" & B</b>'))
    assert root.tag == "svg"
    assert root.get("role") == "img"
    assert root.get("aria-label") == '<b>"A" & B</b>'


def test_a_drawing_alone_is_a_file_that_any_viewer_knows_as_svg() -> None:
    root = ET.fromstring(alone(LINKED, name="f", alt=""))
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert "background" in root.get("style", "")


@pytest.mark.parametrize("svg", ["", "<svg", "<html/>", "<svg/><svg/>"])
def test_what_is_not_one_svg_is_refused_by_the_figures_name(svg: str) -> None:
    with pytest.raises(EthogramError, match="figure 'figure-1'"):
        inlined(svg, name="figure-1", alt="")
