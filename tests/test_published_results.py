"""The results in the documentation are those of the records beside them."""

import shutil
from pathlib import Path

import pytest

from ethogram import cli

DOCS = Path(__file__).parents[1] / "docs"
RECORDS = sorted(DOCS.glob("results/**/records"))


@pytest.fixture(scope="module", params=RECORDS, ids=lambda path: str(path.relative_to(DOCS)))
def results(request, tmp_path_factory):
    """A folder of published results, and the report on its records, written anew."""
    folder = tmp_path_factory.mktemp("results") / "records"
    shutil.copytree(request.param, folder)
    assert cli.main(["report", str(folder)]) == cli.DONE
    return request.param.parent, folder / "report"


def test_pages_say_what_the_records_say(results):
    published, report = results
    pages = sorted(report.glob("*.md"))
    assert pages
    for page in pages:
        assert (published / page.name).read_text() == page.read_text()


def test_data_files_hold_what_the_records_hold(results):
    folder, report = results
    tables = sorted(report.glob("*/*.csv"))
    assert tables
    for table in tables:
        published = folder / table.relative_to(report)
        assert published.read_text() == table.read_text()
        drawn = published.with_suffix(".svg").exists()
        assert drawn == table.with_suffix(".svg").exists()
