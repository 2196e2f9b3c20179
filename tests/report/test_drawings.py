import xml.etree.ElementTree as ET

import pytest

from ethogram.core.errors import EthogramError
from ethogram.report.drawings import alone, inlined

LINKED = (
    '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">'
    '<defs><path id="m1" d="M 0 0"/><clipPath id="p1"><rect/></clipPath></defs>'
    '<use xlink:href="#m1" style="fill: #0072b2"/><g clip-path="url(#p1)"/></svg>'
)


def test_two_drawings_share_no_id_and_each_use_finds_its_own() -> None:
    ids = set()
    for name in ("figure-1", "figure-2"):
        root = ET.fromstring(inlined(LINKED, name=name, alt=""))
        marker, clip = (root.find(f"defs/{tag}").get("id") for tag in ("path", "clipPath"))  # type: ignore[union-attr]
        assert root.find("use").get("href") == f"#{marker}"  # type: ignore[union-attr]
        assert root.find("use").get("style") == "fill: #0072b2"  # type: ignore[union-attr]
        assert root.find("g").get("clip-path") == f"url(#{clip})"  # type: ignore[union-attr]
        ids |= {marker, clip}
    assert len(ids) == 4


def test_groups_that_say_nothing_are_left_out_and_what_they_hold_is_kept() -> None:
    grouped = (
        '<svg xmlns="http://www.w3.org/2000/svg"><g><g fill="red"><g><path d="M 0 0"/></g></g>'
        "<g><rect/></g></g><g/></svg>"
    )
    root = ET.fromstring(inlined(grouped, name="f", alt=""))
    assert [element.tag for element in root.iter()] == ["svg", "g", "path", "rect"]
    assert [element.tag for element in root] == ["g", "rect"]


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
