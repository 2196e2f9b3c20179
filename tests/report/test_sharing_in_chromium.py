"""The page of a real study, from its run to the browser."""

import numpy as np
import pytest
from tests.report.test_pages_in_chromium import pixels

from ethogram import cli
from ethogram.report.site import OPENING

FIGURES = {f"figure-3-{number}" for number in range(1, 7)} | {"table-3-3", "table-3-4"}
CHANGES = ("strategy=optional,random", "episodes=20", "validation_episodes=2", "record_every=5")


@pytest.fixture(scope="module")
def index(tmp_path_factory):
    """The report on a moment of the study `sharing`."""
    folder = tmp_path_factory.mktemp("results")
    command = ["run", "sharing", "--plan=smoke", "--engine=inline", f"--out={folder}"]
    assert cli.main([*command, *(f"--set={change}" for change in CHANGES)]) == cli.DONE
    assert cli.main(["report", str(folder)]) == cli.DONE
    return folder / "index.html"


def test_its_figures_are_painted_its_claims_shown_and_nothing_is_fetched(index, open_tab):
    page = open_tab()
    fetched, complaints = [], []
    page.on("request", lambda request: fetched.append(request.url))
    page.on("console", lambda message: complaints.append(message.text))
    page.goto(index.as_uri())
    page.get_by_role("link", name="Sharing resources").click()
    page.wait_for_load_state("networkidle")
    assert "J. Talamini, Artificial" in page.locator("header.title").inner_text()
    drawings = page.locator("figure .scroll > svg").all()
    assert len(drawings) == len(FIGURES | {OPENING})
    for drawing in drawings:
        colours = np.unique(pixels(drawing).reshape(-1, 3), axis=0)
        assert len(colours) > 50
    assert page.locator("ol.claims > li").count() == 9
    assert page.locator("table caption").filter(has_text="Table 3.2").count() == 1
    assert len(fetched) == 2  # the two pages
    assert complaints == []


def test_its_data_stand_beside_it_as_files(index):
    folder = index.parent / "report" / "sharing"
    assert {path.stem for path in folder.glob("*.svg")} == FIGURES | {OPENING}
    assert {path.stem for path in folder.glob("*.csv")} == FIGURES | {
        "table-3-2",
        "returns",
        "acts",
    }
