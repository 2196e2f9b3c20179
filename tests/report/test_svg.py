import xml.etree.ElementTree as ET

import numpy as np
import pytest

from ethogram.core.errors import EthogramError
from ethogram.report.svg import inline, standalone
from ethogram.studies.sensing.bodies_drawn import draw_bodies

LINKED = (
    '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">'
    '<defs><path id="m1" d="M 0 0"/><clipPath id="p1"><rect/></clipPath></defs>'
    '<use xlink:href="#m1" style="fill: #0072b2"/><g clip-path="url(#p1)" fill="#d55e00"/></svg>'
)


def test_two_drawings_share_no_id_and_each_use_finds_its_own() -> None:
    ids = set()
    for name in ("figure-1", "figure-2"):
        root = ET.fromstring(inline(LINKED, name=name, alt=""))
        marker, clip = (root.find(f"defs/{tag}").get("id") for tag in ("path", "clipPath"))  # type: ignore[union-attr]
        assert root.find("use").get("href") == f"#{marker}"  # type: ignore[union-attr]
        assert root.find("use").get("style") == "fill: #0072b2"  # type: ignore[union-attr]
        assert root.find("g").get("fill") == "#d55e00"  # type: ignore[union-attr]
        assert root.find("g").get("clip-path") == f"url(#{clip})"  # type: ignore[union-attr]
        ids |= {marker, clip}
    assert len(ids) == 4


def test_groups_that_say_nothing_are_left_out_and_what_they_hold_is_kept() -> None:
    grouped = (
        '<svg xmlns="http://www.w3.org/2000/svg"><g><g fill="red"><g><path d="M 0 0"/></g></g>'
        "<g><rect/></g></g><g/></svg>"
    )
    root = ET.fromstring(inline(grouped, name="f", alt=""))
    assert [element.tag for element in root.iter()] == ["svg", "g", "path", "rect"]
    assert [element.tag for element in root] == ["g", "rect"]


def test_an_inlined_drawing_is_an_image_with_its_text_as_text() -> None:
    root = ET.fromstring(inline(LINKED, name="f", alt='<b>"A" & B</b>'))
    assert root.tag == "svg"
    assert root.get("role") == "img"
    assert root.get("aria-label") == '<b>"A" & B</b>'


def test_a_drawing_alone_is_a_file_that_any_viewer_knows_as_svg() -> None:
    root = ET.fromstring(standalone(LINKED, name="f", alt=""))
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert "background" in root.get("style", "")


@pytest.mark.parametrize("svg", ["", "<svg", "<html/>", "<svg/><svg/>"])
def test_what_is_not_one_svg_is_refused_by_the_figures_name(svg: str) -> None:
    with pytest.raises(EthogramError, match="figure 'figure-1'"):
        inline(svg, name="figure-1", alt="")


HOSTILE = """<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"
 xmlns:h="http://www.w3.org/1999/xhtml" onload="run()" transform="scale(99)" width="100pt"
 style="position:fixed;fill:red;background:url(http://evil.example/1)">
<script>run()</script><h:script>run()</h:script><style>@import "http://evil.example/2";</style>
<foreignObject><h:iframe src="http://evil.example/3"/></foreignObject>
<image xlink:href="http://evil.example/4"/><image href="data:image/svg+xml;base64,PHN2Zy8+"/>
<image href="data:image/png;base64,iVBORw0KGgo="/>
<use href="http://evil.example/5#a"/><use xlink:href="data:image/svg+xml,x#a"/>
<a href="javascript:run()"><path id="a" d="M 0 0" onclick="run()"/></a>
<path class="skip" style="fill:url(http://evil.example/6);stroke:#123456;cursor:url(//evil.example/7)"/>
<path fill="u\\72l(http://evil.example/8)" mask="url(#a)" filter="url(http://evil.example/9)"/>
<path style="mask:image-set('http://evil.example/10' 1x);clip-path:url(#a)"/>
<set attributeName="href" to="javascript:run()"/><animate attributeName="d" values="M 1 1"/>
<text onfocus="run()" tabindex="0">run()</text></svg>"""


def test_nothing_of_a_drawing_runs_is_fetched_or_leads_elsewhere() -> None:
    for whole in (inline(HOSTILE, name="f", alt=""), standalone(HOSTILE, name="f", alt="")):
        root = ET.fromstring(whole)
        tags = {element.tag.rpartition("}")[2] for element in root.iter()}
        assert tags <= {"svg", "image", "use", "path", "text", "g"}
        for element in root.iter():
            for key, value in element.attrib.items():
                assert not key.startswith("on")
                assert key not in {"class", "tabindex", "transform", "filter"}
                assert "evil.example" not in value
                assert "javascript" not in value
                assert "svg+xml" not in value
        assert "position" not in root.get("style", "")
        assert "fill:red" in root.get("style", "")


def test_what_draws_is_kept_beside_what_does_not() -> None:
    root = ET.fromstring(inline(HOSTILE, name="f", alt=""))
    first, second, third = root.findall("path")[-3:]
    drawn = root.find(".//path[@id]")
    assert drawn is not None
    assert drawn.attrib == {"id": drawn.get("id"), "d": "M 0 0"}
    assert first.attrib == {"style": "stroke:#123456"}
    assert second.attrib == {"mask": f"url(#{drawn.get('id')})"}
    assert third.attrib == {"style": f"clip-path:url(#{drawn.get('id')})"}
    pictures = [each.attrib for each in root.findall("image")]
    assert pictures == [{}, {}, {"href": "data:image/png;base64,iVBORw0KGgo="}]
    assert root.find("text").text == "run()"  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("width", "share"),
    [("129.6pt", "0.250"), ("3.6in", "0.500"), ("345.6px", "0.500"), ("518.4pt", ""), ("", "")],
)
def test_a_drawing_narrower_than_a_page_keeps_its_share_of_it(width: str, share: str) -> None:
    root = ET.fromstring(inline(f'<svg width="{width}"/>', name="f", alt=""))
    assert root.get("style", "") == (f"--share: {share}" if share else "")


def test_one_body_is_drawn_as_large_as_it_is_beside_others() -> None:
    cells = np.array([(x, 0, 0) for x in range(4)])
    shares = []
    for count in (1, 4):
        svg = draw_bodies({f"worm {number}": cells for number in range(count)})
        root = ET.fromstring(inline(svg, name="f", alt=""))
        shares.append(root.get("style", ""))
    assert shares == ["--share: 0.250", ""]
