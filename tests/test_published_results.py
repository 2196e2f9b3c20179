"""The results in the documentation are those of the records beside them."""

import shutil
from pathlib import Path

import pytest

from ethogram import cli

RESULTS = Path(__file__).parents[1] / "docs" / "results"


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The report on the records, written anew."""
    folder = tmp_path_factory.mktemp("results") / "records"
    shutil.copytree(RESULTS / "records", folder)
    assert cli.main(["report", str(folder)]) == cli.DONE
    return folder / "report"


def test_pages_say_what_the_records_say(report):
    pages = sorted(report.glob("*.md"))
    assert pages
    for page in pages:
        assert (RESULTS / page.name).read_text() == page.read_text()


def test_data_files_hold_what_the_records_hold(report):
    tables = sorted(report.glob("*/*.csv"))
    assert tables
    for table in tables:
        published = RESULTS / table.relative_to(report)
        assert published.read_text() == table.read_text()
        drawn = published.with_suffix(".svg").exists()
        assert drawn == table.with_suffix(".svg").exists()
