import hashlib
import json
import os
from pathlib import Path

import pytest

from ethogram.core.errors import EthogramError
from ethogram.report.files import LISTING, MARK, publish

PAGE = f"<html>{MARK}</html>"


def names(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_files_and_the_listing_of_them_are_all_that_is_written(tmp_path: Path) -> None:
    publish(tmp_path, {"report/a/b.csv": "1", "index.html": PAGE})
    assert names(tmp_path) == {"report/a/b.csv", "index.html", LISTING}


def test_what_an_earlier_report_wrote_goes_and_what_others_wrote_stays(tmp_path: Path) -> None:
    publish(tmp_path, {"report/old.html": PAGE, "report/old/a.csv": "1", "index.html": PAGE})
    (tmp_path / "report/mine.html").write_text("mine")
    publish(tmp_path, {"index.html": PAGE})
    assert names(tmp_path) == {"report/mine.html", "index.html", LISTING}
    assert not (tmp_path / "report/old").exists()


def test_an_old_file_that_was_changed_since_stays(tmp_path: Path) -> None:
    publish(tmp_path, {"report/old.csv": "1", "index.html": PAGE})
    (tmp_path / "report/old.csv").write_text("my notes")
    publish(tmp_path, {"index.html": PAGE})
    assert (tmp_path / "report/old.csv").read_text() == "my notes"


def test_a_page_that_is_not_ours_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("my own site")
    with pytest.raises(EthogramError, match="no page of Ethogram"):
        publish(tmp_path, {"index.html": PAGE})
    assert names(tmp_path) == {"index.html"}
    assert (tmp_path / "index.html").read_text() == "my own site"


VICTIM = hashlib.sha256(b"untouched").hexdigest()
LISTINGS = {
    "nothing": "",
    "a list": "[]",
    "a number": '{"index.html": 3}',
    "no hash": '{"../outside": "x"}',
    "a way out": json.dumps({"../outside": VICTIM}),
    "a way out in the middle": json.dumps({"report/../../outside": VICTIM}),
    "a NUL": json.dumps({"report/a\0b.md": VICTIM}),
    "half a character": json.dumps({"report/\ud800.md": VICTIM}),
    "100000 levels": '{"report/a.md": ' + "[" * 100_000,
}


@pytest.mark.parametrize("listing", LISTINGS.values(), ids=LISTINGS)
def test_a_damaged_listing_hinders_nothing_and_reaches_nothing(
    tmp_path: Path, listing: str
) -> None:
    outside = tmp_path / "outside"
    outside.write_text("untouched")
    folder = tmp_path / "out"
    publish(folder, {"index.html": PAGE})
    (folder / LISTING).write_text(listing)
    publish(folder, {"index.html": PAGE})
    assert outside.read_text() == "untouched"
    assert set(json.loads((folder / LISTING).read_text())) == {"index.html"}


def test_a_write_that_fails_leaves_the_old_page_whole_and_nothing_beside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    publish(tmp_path, {"index.html": PAGE})

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(EthogramError, match="No space left on device"):
        publish(tmp_path, {"index.html": PAGE + "new"})
    assert (tmp_path / "index.html").read_text() == PAGE
    assert names(tmp_path) == {"index.html", LISTING}


def test_after_a_report_cut_short_the_next_one_still_knows_every_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace = Path.replace

    def cut_at_index(path: Path, target: Path) -> Path:
        if target.name == "index.html":
            raise KeyboardInterrupt
        return replace(path, target)

    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", cut_at_index)
        with pytest.raises(KeyboardInterrupt):
            publish(tmp_path, {"report/old.csv": "1", "index.html": PAGE})
    assert names(tmp_path) == {"report/old.csv", LISTING}
    publish(tmp_path, {"index.html": PAGE})
    assert names(tmp_path) == {"index.html", LISTING}


def test_a_folder_that_cannot_be_one_gets_a_clear_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(EthogramError, match="file' is a file, not a folder"):
        publish(tmp_path / "file", {"index.html": PAGE})
