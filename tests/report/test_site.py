import json
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from tests.report.player import WIDTH, crossing

from ethogram.core.errors import EthogramError
from ethogram.report import Replay, StudyPage, write
from ethogram.report.render.frames import MARGIN
from ethogram.report.site import replay_page, slug


class Anchors(HTMLParser):
    """The ids and the links of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.feed(text)

    def handle_starttag(self, _: str, attrs: list[tuple[str, str | None]]) -> None:
        for key, value in attrs:
            if key == "id":
                self.ids.append(value or "")
            elif key == "href":
                self.links.append(value or "")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, sharing: StudyPage, bare: StudyPage) -> Path:
    return write(tmp_path_factory.mktemp("site"), [sharing, bare]).parent


def test_every_link_leads_to_a_file_or_an_anchor_that_is_there(folder: Path) -> None:
    for page in folder.rglob("*.html"):
        anchors = Anchors(page.read_text())
        assert len(anchors.links) > 2
        for link in anchors.links:
            path, _, fragment = link.partition("#")
            if fragment:
                assert fragment in anchors.ids
            elif not path.startswith("data:"):
                assert (page.parent / path).is_file(), link


def test_no_id_stands_twice_on_a_page(folder: Path) -> None:
    for page in folder.rglob("*.html"):
        ids = Anchors(page.read_text()).ids
        assert len(ids) == len(set(ids))


def test_the_front_page_counts_the_verdicts_of_each_study(sharing: StudyPage) -> None:
    assert sharing.tally() == {"confirmed": 5, "refuted": 1, "undecided": 2, "not run": 1}


def test_the_same_pages_give_the_same_bytes(
    folder: Path, tmp_path: Path, sharing: StudyPage, bare: StudyPage
) -> None:
    write(tmp_path, [sharing, bare])
    for path in folder.rglob("*"):
        if path.is_file():
            assert (tmp_path / path.relative_to(folder)).read_bytes() == path.read_bytes()


def test_a_study_that_is_gone_leaves_no_page_behind(
    tmp_path: Path, sharing: StudyPage, bare: StudyPage
) -> None:
    write(tmp_path, [sharing, bare])
    write(tmp_path, [bare])
    assert {path.name for path in (tmp_path / "report").iterdir()} == {
        "bare.html",
        "bare.md",
        "files.json",
    }


def test_two_studies_with_one_name_are_refused_before_anything_is_written(
    tmp_path: Path, bare: StudyPage
) -> None:
    with pytest.raises(EthogramError, match="Two studies have the name 'bare'"):
        write(tmp_path / "out", [bare, replace(bare, title="Another")])
    assert not (tmp_path / "out").exists()


def test_a_table_and_a_figure_with_one_name_are_refused(tmp_path: Path, sharing: StudyPage) -> None:
    figure = replace(sharing.figures[0], name="table-3-2")
    with pytest.raises(EthogramError, match=r"tables and figures of study 'sharing'.*'table-3-2'"):
        write(tmp_path, [replace(sharing, figures=[figure])])


def test_a_study_opens_with_the_picture_it_names_or_with_its_first_scene(
    tmp_path: Path, sharing: StudyPage
) -> None:
    there = crossing().position
    scenes = {"first": crossing(position=there), "second": crossing(position=there - 1)}
    replays = [Replay(name=name, scene=scene) for name, scene in scenes.items()]
    named = replace(sharing, replays=replays, figures=[], tables=[])
    assert named.opening is not None
    assert (named.opening.scene, named.opening.frame) == (scenes["second"], 7)
    assert named.opening.caption == "An agent on its way."
    other = replace(named, replays=replays[:1])
    assert other.opening is not None
    assert (other.opening.scene, other.opening.caption) == (scenes["first"], "crossing")
    assert replace(named, replays=[Replay(name="second", scene=None, error="no")]).opening is None
    write(tmp_path, [named])
    drawn = ET.parse(tmp_path / "report" / "sharing" / "opening.svg").getroot()
    discs = list(drawn.iter("{http://www.w3.org/2000/svg}circle"))
    x = scenes["second"].position[7, 0, 0]
    room = float(drawn.get("width", "").removesuffix("px")) - 2 * MARGIN
    assert float(discs[-1].get("cx", "")) == pytest.approx(room * x / WIDTH, abs=0.1)
    assert discs[-1].get("fill") == "#0072b2"
    text = (tmp_path / "report" / "sharing.md").read_text()
    assert "](sharing/opening.svg)" in text
    assert text.index("return, mean over agents") < text.index("## Claims")


def test_a_claim_of_a_study_of_its_own_needs_no_source(tmp_path: Path, sharing: StudyPage) -> None:
    claims = [replace(claim, source="") for claim in sharing.claims]
    write(tmp_path, [replace(sharing, claims=claims, figures=[], tables=[])])
    text = (tmp_path / "report" / "sharing.html").read_text()
    assert "<dt>Source</dt>" not in text
    assert "thesis" not in text.replace("A thesis, 2020", "")
    assert "\n   ()" not in (tmp_path / "report" / "sharing.md").read_text()


def test_without_studies_the_front_page_says_so(tmp_path: Path) -> None:
    assert "No study has been run yet" in write(tmp_path, []).read_text()


def test_a_slug_is_a_plain_file_name_and_different_for_different_names() -> None:
    names = ["sharing", "Sharing", "../../etc", "a/b", "a b", "a\0b", "עברית", "x" * 300, "", "."]
    slugs = [slug(name) for name in names]
    assert slugs[0] == "sharing"
    assert len(set(slugs)) == len(names)
    assert all(set(s) <= set("abcdefghijklmnopqrstuvwxyz0123456789_-") for s in slugs)
    assert all(0 < len(s) < 80 for s in slugs)


def test_the_page_as_markdown_says_what_the_page_says(folder: Path, sharing: StudyPage) -> None:
    text = (folder / "report" / "sharing.md").read_text()
    for claim in sharing.claims:
        assert f"{claim.number}. **{claim.verdict}**: " in text
    for figure in sharing.figures:
        assert f"](sharing/{figure.name}.svg)" in text
    for link in re.findall(r"\]\((.+?)\)", text):
        assert (folder / "report" / link).is_file()


def test_text_cannot_become_markup_in_markdown(tmp_path: Path, bare: StudyPage) -> None:
    hostile = "<b>a</b> | [x](y) *z*\n# `h` $m$ &amp;"
    write(tmp_path, [replace(bare, title=hostile, command=hostile)])
    text = (tmp_path / "report" / "bare.md").read_text()
    shown = r"\<b\>a\</b\> \| \[x\](y) \*z\* \# \`h\` \$m\$ \&amp;"
    assert text.startswith(f"# {shown}\n")
    assert r"`<b>a</b> \| [x](y) *z* # 'h' $m$ &amp;`" in text


def test_a_page_shows_cases_from_first_to_last_before_it_shows_further_trials():
    def shown(cases: int, trials: int) -> list[tuple[str, int]]:
        replays = [
            Replay(name=str(case), scene=None, error="none", trial=trial)
            for case in range(cases)
            for trial in range(1, trials + 1)
        ]
        return [(found["name"], found["trial"]) for found in _shown(replays)]

    assert shown(2, 2) == [("0", 1), ("1", 1), ("0", 2), ("1", 2)]
    many = shown(28, 3)
    assert many == [(str(case), 1) for case in range(0, 28, 3)]
    some = shown(6, 3)
    assert some[:6] == [(str(case), 1) for case in range(6)]
    assert some[6:] == [(str(case), 2) for case in range(4)]


def _shown(replays: list[Replay]) -> list[dict[str, Any]]:
    page = replay_page("toy", replays)
    text = page.split('id="replay-scenes">')[1].split("</script>")[0]
    return json.loads(text)
