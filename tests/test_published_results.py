"""The results in the documentation are those of the records beside them."""

import csv
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
        rows = (list(csv.reader(file.read_text().splitlines())) for file in (published, table))
        assert_alike(*rows, embedded="t-sne" in table.stem)
        drawn = published.with_suffix(".svg").exists()
        assert drawn == table.with_suffix(".svg").exists()


def assert_alike(published, anew, *, embedded=False):
    """Equal words, and numbers up to the rounding of another processor.

    t-SNE makes much of little: where the points of its maps lie is not compared.
    """
    assert len(published) == len(anew)
    assert published[0] == anew[0]
    for one, other in zip(published, anew, strict=True):
        places = ("first", "second") if embedded or "t-SNE" in one else ()
        for column, here, there in zip(published[0], one, other, strict=True):
            if here != there and column not in places:
                assert float(here) == pytest.approx(float(there), rel=1e-9)


def test_what_is_alike_differs_in_rounding_alone():
    table = [["map", "run", "first"], ["MDS", "1", "0.25"], ["t-SNE", "1", "7.5"]]
    assert_alike(table, [table[0], ["MDS", "1", "0.2500000000001"], ["t-SNE", "1", "-3.1"]])
    assert_alike(table, [table[0], ["MDS", "1", "0.7"], table[2]], embedded=True)
    for wrong in (["MDS", "1", "0.2501"], ["MDS", "2", "0.25"], ["PCA", "1", "0.25"]):
        with pytest.raises((AssertionError, ValueError)):
            assert_alike(table, [table[0], wrong, table[2]])
