"""The pages as a reader sees them, in a real browser."""

import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Locator, Page
from tests.report.player import FRAMES, crossing

from ethogram.core.findings import Claim, Measured, Table
from ethogram.core.introduction import Introduction
from ethogram.core.scene import Shape, tints
from ethogram.report import (
    Comparison,
    Replay,
    StudyPage,
    compare_pages,
    write,
    write_comparison,
)

HOSTILE = (
    "<script>document.title='run'</script><img src=x onerror=alert(1)>"
    "\"'`&amp;{{ 7*7 }}\u202e\u05e9\u05dc\u05d5\u05dd"  # ends right to left
)

# What a reader gets: the colour of the text, and of whatever is painted behind it.
CONTRAST = """element => {
  const rgb = text => text.match(/[\\d.]+/g).map(Number)
  const luminance = colour => rgb(colour).slice(0, 3)
    .map(part => part / 255)
    .map(part => part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4)
    .reduce((sum, part, i) => sum + part * [0.2126, 0.7152, 0.0722][i], 0)
  let behind = element
  while (rgb(getComputedStyle(behind).backgroundColor)[3] === 0) behind = behind.parentElement
  const [dark, light] = [
    luminance(getComputedStyle(element).color),
    luminance(getComputedStyle(behind).backgroundColor),
  ].sort((a, b) => a - b)
  return (light + 0.05) / (dark + 0.05)
}"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, sharing: StudyPage, bare: StudyPage) -> Path:
    part = replace(bare, name="part", cases_done=3, failures=[("case 7", "ValueError: no")])
    return write(tmp_path_factory.mktemp("pages"), [sharing, bare, part]).parent


def url(folder: Path, name: str = "sharing") -> str:
    path = folder / "index.html" if name == "index" else folder / "report" / f"{name}.html"
    return path.as_uri()


def pixels(shown: Page | Locator) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(shown.screenshot())).convert("RGB"))


def test_every_figure_is_painted(folder: Path, open_tab: Callable[..., Page]) -> None:
    page = open_tab()
    page.goto(url(folder))
    drawings = page.locator("figure svg")
    assert drawings.count() == 6
    for drawing in drawings.all():
        box = drawing.bounding_box()
        assert box is not None
        assert box["width"] > 500
        assert box["height"] > 300
        assert drawing.get_attribute("aria-label")
        assert len(np.unique(pixels(drawing).reshape(-1, 3), axis=0)) > 50


def test_nothing_is_fetched_and_nothing_is_complained_of(
    folder: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    fetched: list[str] = []
    complaints: list[str] = []
    page.on("request", lambda request: fetched.append(request.url))
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    visited = [url(folder, name) for name in ("index", "sharing", "bare", "part")]
    for address in visited:
        page.goto(address, wait_until="networkidle")
    assert [address for address in fetched if not address.startswith("data:")] == visited
    assert complaints == []


def test_the_page_forbids_itself_the_network(folder: Path, open_tab: Callable[..., Page]) -> None:
    page = open_tab()
    page.goto(url(folder))
    refused = page.evaluate("fetch('http://127.0.0.1:9/').then(() => 'sent', () => 'refused')")
    policy = page.locator('meta[http-equiv="Content-Security-Policy"]').get_attribute("content")
    assert refused == "refused"
    assert policy is not None
    assert "default-src 'none'" in policy


@pytest.mark.parametrize("name", ["index", "sharing", "part"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_all_text_has_contrast(
    folder: Path, open_tab: Callable[..., Page], scheme: str, name: str
) -> None:
    page = open_tab(color_scheme=scheme)
    page.goto(url(folder, name))
    for kind in ("body", ".verdict", ".question", ".beneath", ".none", ".interval", "a", "code"):
        for element in page.locator(f"{kind}:visible").all()[:12]:
            assert element.evaluate(CONTRAST) >= 4.5, kind


def test_light_and_dark_differ_in_paper_and_in_the_ink_of_figures(
    folder: Path, open_tab: Callable[..., Page]
) -> None:
    seen = {}
    for scheme in ("light", "dark"):
        page = open_tab(color_scheme=scheme)
        page.goto(url(folder))
        seen[scheme] = pixels(page.locator("figure svg").first)
    assert seen["light"].shape == seen["dark"].shape
    assert np.median(seen["light"]) > 240
    assert np.median(seen["dark"]) < 40
    assert seen["light"].min() < 60
    assert seen["dark"].max() > 200


@pytest.mark.parametrize("name", ["index", "sharing", "bare", "part"])
def test_a_phone_scrolls_wide_things_in_their_own_box_and_never_the_page(
    folder: Path, open_tab: Callable[..., Page], name: str
) -> None:
    page = open_tab(width=390)
    page.goto(url(folder, name))
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    if name == "sharing":
        wide = page.locator(".table .scroll").first
        assert wide.evaluate("box => box.scrollWidth > box.clientWidth")


def test_names_without_a_break_do_not_make_a_phone_scroll_sideways(
    tmp_path: Path, open_tab: Callable[..., Page], sharing: StudyPage
) -> None:
    long = "verylongnamewithoutanybreak" * 3
    scene = crossing(
        title=long,
        palette=tints(long, long),
        captions=(long,) * FRAMES,
        chapters=tuple(f"{long}{frame // 9}" for frame in range(FRAMES)),
        shapes=(Shape("circle", 0.8, long),),
        words=(long,),
        said=np.zeros((FRAMES, 1), int),
        series={long: np.zeros((FRAMES, 2))},
    )
    claim = replace(
        sharing.claims[0], statement=long, test=long, source=long, note=long, unit=long,
        compared=long, depends_on=(long,),
    )  # fmt: skip
    table = Table(name=long, title=long, caption=long, columns=(long, "J"), rows=((long, 1.0),))
    study = replace(
        sharing, title=long, question=long, plan=long, plan_description=long, command=long,
        settings={long: {f"{long}_a.b": long}}, versions={long: long}, failures=[(long, long)],
        claims=[claim], tables=[table], figures=[replace(sharing.figures[-1], title=long)],
        introduction=Introduction(text=long, source=long, symbols={long: long}, caption=long),
        replays=[Replay(name=f"{number}-{long}", scene=scene) for number in range(2)],
    )  # fmt: skip
    index = write(tmp_path, [study])
    compared = tmp_path / "compare.html"
    pair = compare_pages(study, replace(study, settings={long: long}))
    write_comparison(compared, Comparison(a=long, b=long, studies=[pair], only_a=[long]))
    page = open_tab(width=390)
    for file in (index, tmp_path / "report" / "sharing.html", compared):
        page.goto(file.as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, file.name


def test_settings_break_between_words(folder: Path, open_tab: Callable[..., Page]) -> None:
    page = open_tab()
    page.goto(url(folder))
    for cell in page.locator(".pairs td, .pairs th").all()[:40]:
        words = cell.evaluate(
            """cell => {
              const text = cell.firstChild, range = document.createRange(), broken = []
              for (const word of (text?.data ?? "").matchAll(/[^\\s.]+/g)) {
                range.setStart(text, word.index)
                range.setEnd(text, word.index + word[0].length)
                if (range.getClientRects().length > 1) broken.push(word[0])
              }
              return broken
            }"""
        )
        assert words == []


def test_verdicts_differ_in_word_and_shape_not_only_in_colour(
    folder: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    page.goto(url(folder))
    page.add_style_tag(content="* { color: black !important; background: white !important; }")
    tally = page.locator(".tally li")
    words = [" ".join(text.split()) for text in tally.all_inner_texts()]
    assert words == ["5 confirmed", "1 refuted", "2 undecided", "1 not run"]
    icons = [pixels(tally.nth(index).locator("svg")) for index in range(4)]
    for index, icon in enumerate(icons):
        for other in icons[index + 1 :]:
            assert icon.shape != other.shape or (icon != other).mean() > 0.05


def test_the_keyboard_reaches_the_content_first_and_then_every_link(
    folder: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    page.goto(url(folder))
    page.keyboard.press("Tab")
    focused = page.locator(":focus")
    assert focused.inner_text() == "Skip to the content"
    box = focused.bounding_box()
    assert box is not None
    assert box["y"] >= 0
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "content"


def test_landmarks_captions_and_headings_of_cells_are_there(
    folder: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    page.goto(url(folder))
    for role in ("banner", "navigation", "main", "contentinfo"):
        assert page.get_by_role(role).count() == 1
    assert page.get_by_role("heading", level=1).count() == 1
    table = page.locator("#table-3-2 table")
    assert table.locator("caption").inner_text().startswith("Table 3.2.")
    assert table.locator("tbody th[scope=row]").count() == 18
    assert table.locator("thead th[scope=colgroup]").count() == 2


def test_a_table_shows_measured_published_and_a_marked_difference(
    folder: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    page.goto(url(folder))
    row = page.locator("#table-3-2 tbody tr").first.locator("th, td")
    assert row.all_inner_texts()[:5] == [
        "cooperative",
        "always",
        "99.0 [97.8, 99.0]",
        "99.0",
        "0.0",
    ]
    assert page.locator("#table-3-2 td .outside").count() > 0


def test_a_claim_that_was_not_run_shows_no_effect(
    folder: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    page.goto(url(folder))
    assert page.locator("#claim-9 .finding").inner_text().strip() == "not run"
    assert "0.123 reward per step" in page.locator("#claim-1 .finding").inner_text()
    assert page.locator(".margin").count() == 8  # one where there is an effect


def test_a_claim_shows_its_margin_and_its_history(
    folder: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    page.goto(url(folder))
    finding = page.locator("#claim-2 .finding")
    assert "claimed: more than 0.50 reward per step" in finding.inner_text()
    line = finding.locator(".margin")
    assert line.get_attribute("aria-label") == (
        "Claimed: more than 0.50 reward per step. Effect: 0.247 reward per step [0.216, 0.278]."
    )
    assert len(np.unique(pixels(line).reshape(-1, 3), axis=0)) > 5
    said = " ".join(page.locator("#claim-2 dl").inner_text().split())
    assert "Changed 2026-11-05: A lead must exist to be larger. Why: Without one" in said
    assert "Known by then: A first run of all conditions." in said
    assert "J in validation: undecided" in said
    above = page.locator("#section-claims + p").inner_text()
    assert above.startswith("Each was first stated before the run")
    assert "Claims 2, 3 and 4: their tests have changed since" in above
    assert "2026-11-01" in page.locator("#claim-1 dl").inner_text()


def test_the_comparisons_of_a_claim_are_folded_away_until_somebody_asks_for_them(
    folder: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    page.goto(url(folder))
    assert page.locator(".claim details").count() == 1  # of the claim that has several
    listed = page.locator("#claim-1 details li")
    assert not listed.first.is_visible()
    page.locator("#claim-1 summary").click()
    assert [" ".join(text.split()) for text in listed.all_inner_texts()] == [
        "J(always) - J(none), mixed: 0.70 reward per step [0.60, 0.80]; "
        "claimed: more than 0.50 reward per step",
        "J(always) - J(none): claimed: more than 0.50 reward per step; not run: none",
    ]


def test_a_change_that_several_claims_share_stands_once(
    folder: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    page.goto(url(folder))
    text = page.locator("section", has=page.locator("#section-claims")).inner_text()
    assert text.count("The margin is wider.") == 1
    assert "Of claims 3 and 4 changed 2026-11-06: The margin is wider." in text
    for number in (3, 4):
        said = " ".join(page.locator(f"#claim-{number} dl").inner_text().split())
        assert "Changed 2026-11-06, as is said above of claims 3 and 4" in said
    assert (folder / "report" / "sharing.md").read_text().count("The margin is wider.") == 1


def test_a_page_opens_with_what_it_is_about(folder: Path, open_tab: Callable[..., Page]) -> None:
    page = open_tab()
    page.goto(url(folder))
    opening = " ".join(page.locator("header.title").inner_text().split())
    for words in (
        "Ten agents share two",
        "J return, mean over agents",
        "A. Author, A thesis, 2020",
    ):
        assert words in opening
    top = page.locator(".symbols").bounding_box()
    first = page.locator("#claim-1").bounding_box()
    assert top is not None
    assert first is not None
    assert top["y"] < first["y"]


def test_what_is_missing_or_failed_is_said_first(
    folder: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    page.goto(url(folder, "part"))
    notices = page.locator(".notice").all_inner_texts()
    assert "3 of 24 cases have a record" in notices[0]
    assert "case 7" in notices[1]
    assert "ValueError: no" in notices[1]


def test_any_text_is_shown_as_text(
    tmp_path: Path, open_tab: Callable[..., Page], sharing: StudyPage
) -> None:
    claim = Claim(
        number=1, statement=HOSTILE, source=HOSTILE, test=HOSTILE, effect=1.0, low=0.0, high=2.0,
        unit=HOSTILE, p_value=0.5, verdict="undecided", note=HOSTILE,
    )  # fmt: skip
    table = Table(
        name=HOSTILE,
        title=HOSTILE,
        caption=HOSTILE,
        columns=(HOSTILE, "J"),
        rows=((HOSTILE, Measured(value=1.0, published=2.0)), ("lone \ud800 surrogate", None)),
    )
    figure = replace(
        sharing.figures[-1], name="figure", title=HOSTILE, caption=HOSTILE, alt=HOSTILE
    )
    study = StudyPage(
        name=HOSTILE, title=HOSTILE, question=HOSTILE, plan=HOSTILE, plan_description=HOSTILE,
        trials=1, cases_done=1, cases_planned=2, failures=[(HOSTILE, HOSTILE)], date=HOSTILE,
        seconds=1.0, command=HOSTILE, digest=HOSTILE, settings={HOSTILE: {HOSTILE: HOSTILE}},
        versions={HOSTILE: HOSTILE}, claims=[claim], tables=[table], figures=[figure],
    )  # fmt: skip
    page = open_tab()
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("dialog", lambda dialog: complaints.append(dialog.message))
    page.goto(write(tmp_path, [study]).as_uri())
    page.get_by_role("rowheader").get_by_role("link").click()
    assert page.title().startswith("<script>")
    assert page.locator("h1").text_content() == HOSTILE
    assert page.locator("#claim-1 h3 [dir]").text_content() == HOSTILE
    assert page.locator("figure svg").get_attribute("aria-label") == HOSTILE
    assert page.locator("main script, main img").count() == 0
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert complaints == []
