"""Scenes saved by the end of a file's name."""

import json
import re

import pytest
from PIL import Image
from tests.report.player import FRAMES, crossing

from ethogram.core.errors import EthogramError


def test_a_scene_is_saved_as_a_page_that_holds_it_and_again_in_its_place(tmp_path):
    file = tmp_path / "talks" / "talk.HTML"
    for title in ("a draft", "the talk"):
        crossing(title=title).save(str(file))
    page = file.read_text()
    assert page.startswith("<!doctype html>")
    (stored,) = json.loads(re.search(r'id="replay-scenes">(.*?)</script>', page)[1])
    assert (stored["title"], stored["frames"]) == ("the talk", FRAMES)


@pytest.mark.parametrize(("suffix", "kind"), [(".gif", "GIF"), (".webp", "WEBP")])
def test_a_scene_is_saved_as_a_video(tmp_path, suffix, kind):
    file = tmp_path / f"talk{suffix}"
    crossing().save(file)
    with Image.open(file) as image:
        assert (image.format, image.n_frames) == (kind, FRAMES)


def test_a_scene_is_saved_as_mp4(tmp_path):
    crossing().save(tmp_path / "talk.mp4")
    assert (tmp_path / "talk.mp4").read_bytes()[4:8] == b"ftyp"


def test_other_formats_and_pages_of_others_are_refused(tmp_path):
    for name in ("talk.pdf", "talk"):
        with pytest.raises(
            EthogramError, match=rf"{name}'; allowed: .* \.html, \.gif, \.webp, \.m"
        ):
            crossing().save(tmp_path / name)
    foreign = tmp_path / "mine.html"
    foreign.write_text("my own")
    with pytest.raises(EthogramError, match=r"mine\.html' is there and is no page of Ethogram's"):
        crossing().save(foreign)
    assert [file.name for file in tmp_path.iterdir()] == ["mine.html"]
