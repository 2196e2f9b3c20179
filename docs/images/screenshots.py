"""Takes the pictures of pages that the documentation shows, from the published records.

    python docs/images/screenshots.py [FOLDER]

They are written into FOLDER, by default this one.  It needs Chromium and takes about a minute.
"""

import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Browser, Page, sync_playwright

from ethogram import cli

RECORDS = Path(__file__).parents[1] / "results" / "records"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = "--no-sandbox --disable-gpu --disable-quic --no-first-run"
BESIDE = ("tripod-shrink_limited-even", "worm-shrink_limited-uneven", "worm-tanh-uneven")


def opened(browser: Browser, file: Path, width: int, height: int) -> Page:
    """A page in a light window, its first scene drawn."""
    page = browser.new_page(viewport={"width": width, "height": height}, color_scheme="light")
    page.goto(file.as_uri())
    page.wait_for_timeout(1500)
    return page


def at_claims(page: Page) -> None:
    """The claims at the head of the window."""
    page.locator("#section-claims").evaluate("each => each.scrollIntoView()")


def robots(page: Page) -> None:
    """Four robots side by side, under way."""
    page.locator("[data-part=scene]").select_option("biped-tanh-even")
    page.locator("summary").click()
    for case in BESIDE:
        page.locator("[data-part=beside] label").filter(has_text=case).locator("input").check()
        page.wait_for_timeout(1000)
    page.locator("[data-part=frame]").fill("170")


def at_frame(frame: int) -> Callable[[Page], None]:
    """A moment of the first scene."""
    return lambda page: page.locator("[data-part=frame]").fill(str(frame))


def main() -> None:
    """Write the pages, look at them, and keep what is seen."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    executable = next(filter(None, map(shutil.which, BROWSERS)))
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        for study in ("sharing", "sensing"):
            shutil.copytree(RECORDS / study, folder / study)
        cli.main(["report", str(folder)])
        cases = {"publishing": "minded-mild_scrutiny-100-20-1000", "language": "3x3-learned-9"}
        for study, case in cases.items():
            file = folder / f"{study}.html"
            cli.main(["replay", str(RECORDS), study, case, f"--out={file}", "--no-show"])
        pages = folder / "report"
        browser = playwright.chromium.launch(executable_path=executable, args=FLAGS.split())
        for picture, file, width, height, show, part in (
            ("report", pages / "sharing.html", 1180, 1000, at_claims, ""),
            ("replay-robots", pages / "sensing.html", 1280, 900, robots, "#replay"),
            ("replay-publishing", folder / "publishing.html", 1280, 900, at_frame(83), "#replay"),
            ("replay-language", folder / "language.html", 480, 900, at_frame(7), "#replay"),
        ):
            page = opened(browser, file, width, height)
            show(page)
            page.evaluate("document.activeElement.blur()")
            page.wait_for_timeout(1000)
            seen = page.locator(part) if part else page
            seen.screenshot(path=out / f"{picture}.png")
            page.close()
        browser.close()


if __name__ == "__main__":
    main()
