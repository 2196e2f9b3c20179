"""Two runs side by side as a reader sees them, in a real browser."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Page
from tests.report.test_pages_in_chromium import CONTRAST, HOSTILE

from ethogram.core.findings import Measured, Table
from ethogram.report import Comparison, StudyPage, compare_pages, write_comparison


def other_run(page: StudyPage) -> StudyPage:
    """The same study with one setting, one verdict, one row and one column changed."""
    first, *claims = page.claims
    validation, timeline = page.tables
    rows = [(*row[:2], shifted(row[2]), row[3], 1) for row in validation.rows]
    columns = (*validation.columns, "cases")
    return replace(
        page,
        plan="thesis",
        digest="1" * 64,
        settings={**page.settings, "trials": 20},
        versions={**page.versions, "jax": "0.11.0"},
        claims=[replace(first, verdict="confirmed"), *claims],
        tables=[replace(validation, columns=columns, rows=tuple(rows[1:])), timeline],
    )


def shifted(cell: object) -> Measured:
    assert isinstance(cell, Measured)
    assert cell.low is not None
    assert cell.high is not None
    return replace(cell, value=cell.value + 9, low=cell.low + 9, high=cell.high + 9)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory, sharing: StudyPage, bare: StudyPage) -> Path:
    file = tmp_path_factory.mktemp("compared") / "compare.html"
    studies = [compare_pages(sharing, other_run(sharing)), compare_pages(bare, bare)]
    write_comparison(
        file, Comparison(a="before", b="after", studies=studies, only_b=["language", "sensing"])
    )
    return file


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_it_fits_the_screen_fetches_nothing_and_runs_no_script(
    file: Path, open_tab: Callable[..., Page], width: int, scheme: str
) -> None:
    page = open_tab(width=width, color_scheme=scheme)
    fetched: list[str] = []
    complaints: list[str] = []
    page.on("request", lambda request: fetched.append(request.url))
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(file.as_uri(), wait_until="networkidle")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert [address for address in fetched if not address.startswith("data:")] == [file.as_uri()]
    assert complaints == []
    assert page.locator("script").count() == 0
    for kind in ("body", ".verdict", ".which", ".only", ".beneath", ".none", ".interval", "h4"):
        for element in page.locator(f"{kind}:visible").all()[:6]:
            assert element.evaluate(CONTRAST) >= 4.5, kind


def test_what_differs_is_said_in_words_and_what_does_not_is_left_out(
    file: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    page.goto(file.as_uri())
    assert page.locator("h1").inner_text() == "before and after"
    assert "Only B holds language, sensing." in page.locator("header.title").inner_text()
    assert page.get_by_text("1 of 9 verdicts differs.").count() == 1
    settings = page.locator("table.sided").filter(has_text="Settings that differ")
    assert settings.locator("tbody tr").all_inner_texts() == ["trials\t4\t20"]
    versions = page.locator("table.sided").filter(has_text="Versions that differ")
    assert versions.locator("tbody tr").all_inner_texts() == ["jax\t0.10.1\t0.11.0"]
    assert page.get_by_text("(the same data)").count() == 1
    assert page.get_by_text("No setting differs.").count() == 1


def test_claims_stand_side_by_side_and_a_changed_verdict_is_marked(
    file: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    page.goto(file.as_uri())
    claims = page.locator(".versus")
    assert claims.count() == 9
    assert "≠ another verdict" in claims.first.inner_text()
    assert page.get_by_text("another verdict").count() == 1
    one, other = (claims.first.locator(".finding").nth(index) for index in (0, 1))
    assert one.inner_text().split()[:2] == ["A", "refuted"]
    assert other.inner_text().split()[:2] == ["B", "confirmed"]
    beside = [found.bounding_box() for found in (one, other)]
    assert beside[0] is not None
    assert beside[1] is not None
    assert beside[0]["y"] == beside[1]["y"]
    assert beside[0]["x"] + beside[0]["width"] <= beside[1]["x"]


def test_tables_show_both_the_difference_and_what_only_one_has(
    file: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    page.goto(file.as_uri())
    table = page.locator("section.both").first
    rows = table.locator("tbody tr")
    texts = [" ".join(text.split()) for text in rows.all_inner_texts()]
    assert texts[0].startswith("cooperative always only in A 99.0 [97.8, 99.0]")
    assert "▲ intervals apart: +9.0 79.3" in texts[1]
    assert "cases only in B" in " ".join(table.locator("thead").inner_text().split())
    assert table.locator("tbody th[scope=row]").count() == 18
    assert table.locator("thead th[scope=colgroup]").count() == 2


def test_the_keyboard_reaches_the_content_the_studies_and_the_tables(
    file: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    page.goto(file.as_uri())
    reached = []
    for _ in range(6):
        page.keyboard.press("Tab")
        reached.append(page.evaluate("document.activeElement.innerText.split('\\n')[0]"))
    assert reached[:3] == [
        "Skip to the content",
        "Sharing resources",
        "Sharing resources",
    ]
    assert reached[3].startswith("Table 3.2.")


def test_any_text_is_shown_as_text(
    tmp_path: Path, open_tab: Callable[..., Page], sharing: StudyPage
) -> None:
    claim = replace(sharing.claims[0], statement=HOSTILE, unit=HOSTILE)
    table = Table(
        name=HOSTILE, title=HOSTILE, caption=HOSTILE, columns=(HOSTILE, "note", "J"),
        rows=((HOSTILE, HOSTILE, Measured(value=1.0, published=2.0)), ("\ud800", None, None)),
    )  # fmt: skip
    run = replace(
        sharing, name=HOSTILE, title=HOSTILE, plan=HOSTILE, date=HOSTILE, digest=HOSTILE,
        settings={HOSTILE: HOSTILE}, versions={HOSTILE: HOSTILE}, claims=[claim], tables=[table],
    )  # fmt: skip
    other = replace(run, settings={HOSTILE: f"{HOSTILE}!"}, tables=[replace(table, name="else")])
    again = replace(run, name="again")
    compared = Comparison(
        a=HOSTILE,
        b=HOSTILE,
        studies=[compare_pages(run, other), compare_pages(again, again)],
        only_a=[HOSTILE],
    )
    file = tmp_path / "compare.html"
    write_comparison(file, compared)
    page = open_tab(width=390)
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("dialog", lambda dialog: complaints.append(dialog.message))
    page.goto(file.as_uri())
    assert page.title().startswith("<script>")
    assert page.locator(".versus h4 [dir]").first.text_content() == HOSTILE
    assert page.locator("main script, main img").count() == 0
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert complaints == []
