"""Robots in space as a viewer sees them, in a real browser that draws without a graphics card."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Locator, Page
from tests.report.player import HOSTILE, at, frames, heard, opened, pixels, until

from ethogram import cli
from ethogram.core.scene import GRADED_COLOURS, Scene, Shape, Tint, tints

RECORDS = Path(__file__).parents[2] / "docs" / "results" / "records"
FRAMES, EDGE, WAY = 31, 0.01, 0.06  # m


def crawling(**changes) -> Scene:
    """A voxel that slides along x, contracted at first, then at rest, then expanded."""
    x = np.linspace(0, WAY, FRAMES)
    scale = np.repeat([0.9, 1.0, 1.1], [10, 11, 10])
    settings = {
        "title": "crawling",
        "bounds": (0.0, 0.0, WAY, 2 * EDGE),
        "frame_seconds": 0.05,
        "palette": tuple(map(Tint, ("contracted", "at rest", "expanded"), GRADED_COLOURS)),
        "shapes": (Shape("cube", EDGE / 2),),
        "position": np.stack([x, np.zeros(FRAMES), np.full(FRAMES, EDGE / 2)], 1)[:, None],
        "tint": np.repeat([0, 1, 2], [10, 11, 10])[:, None],
        "scale": scale[:, None],
        "orientation": np.tile([1.0, 0.0, 0.0, 0.0], (FRAMES, 1, 1)),
        "captions": tuple(f"frame {frame}" for frame in range(FRAMES)),
        "series": {"distance (mm)": 1000 * x[:, None]},
    }
    return Scene(**(settings | changes))


def stage(page: Page) -> Locator:
    return page.locator("[data-part=space]")


def shown(page: Page, frame: int) -> np.ndarray:
    page.locator("[data-part=frame]").fill(str(frame))
    assert at(page) == frame
    return pixels(stage(page))


def coloured(picture: np.ndarray) -> np.ndarray:
    """Where there is strong colour: a voxel that is not at rest; row and column of each pixel."""
    return np.argwhere(np.ptp(picture, axis=2) > 60)


def test_the_colour_of_a_voxel_is_that_of_its_size_in_the_frame(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = opened(tmp_path, open_tab, crawling())
    for frame, strongest in ((0, 2), (9, 2), (21, 0), (30, 0)):  # blue, then red
        picture = shown(page, frame)
        where = coloured(picture)
        assert len(where) > 500
        assert picture[tuple(where.T)].mean(0).argmax() == strongest
    assert len(coloured(shown(page, 15))) == 0  # grey at rest


def test_without_following_a_voxel_goes_right_as_far_as_the_scene_says(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = opened(tmp_path, open_tab, crawling(scale=np.full((FRAMES, 1), 0.9)))
    shown(page, 15)
    page.locator("[data-part=follow]").uncheck()
    across = np.array([coloured(shown(page, frame))[:, 1].mean() for frame in (9, 12, 15, 18, 21)])
    steps = np.diff(across)
    assert (steps > 20).all()
    # equal steps in the scene; seen from the side they differ by perspective alone
    np.testing.assert_allclose(steps, steps.mean(), rtol=0.25)


def test_with_following_it_stays_in_the_middle_and_the_floor_passes(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = opened(tmp_path, open_tab, crawling(scale=np.full((FRAMES, 1), 0.9)))
    first, last = shown(page, 0), shown(page, 27)
    for picture in (first, last):
        middle = coloured(picture)[:, 1].mean() / picture.shape[1]
        assert middle == pytest.approx(0.5, abs=0.03)
    assert (first != last).any()


def test_it_turns_as_the_scene_says(tmp_path: Path, open_tab: Callable[..., Page]) -> None:
    angle = np.linspace(0, np.pi / 4, FRAMES)  # about the axis that looks at the viewer
    turning = np.stack([np.cos(angle / 2), 0 * angle, -np.sin(angle / 2), 0 * angle], 1)[:, None]
    still = crawling().position.copy()
    still[..., 0], still[..., 2] = 0.0, 2 * EDGE
    scene = crawling(scale=np.full((FRAMES, 1), 0.9), orientation=turning, position=still)
    page = opened(tmp_path, open_tab, scene)
    spans = [np.ptp(coloured(shown(page, frame)), axis=0)[1] for frame in (0, FRAMES - 1)]
    assert spans[1] > 1.15 * spans[0]  # the diagonal is longer than the edge


def test_keys_and_dragging_turn_the_view_and_a_key_sets_it_back(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = opened(tmp_path, open_tab, crawling())
    shown(page, 5)
    stage(page).focus()
    before = pixels(stage(page))
    seen = [before]
    for key in ("a", "w", "+"):
        page.keyboard.press(key)
        seen.append(pixels(stage(page)))
        assert (seen[-1] != seen[-2]).any(), key
    assert at(page) == 5
    page.keyboard.press("0")
    assert np.abs(pixels(stage(page)) - before).mean() < 0.1  # rounding of lines

    box = stage(page).bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 300, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 400, box["y"] + 200, steps=4)
    page.mouse.up()
    assert (pixels(stage(page)) != before).any()


def test_it_moves_while_it_plays_and_stands_when_it_is_stopped(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = opened(tmp_path, open_tab, crawling())
    before, play = pixels(stage(page)), page.locator("[data-part=play]")
    play.click()
    until(page, lambda: at(page) > 3)
    play.click()
    stopped, frame = pixels(stage(page)), at(page)
    assert (before != stopped).any()
    page.wait_for_timeout(200)
    assert at(page) == frame
    assert (pixels(stage(page)) == stopped).all()
    assert (shown(page, frame) == stopped).all()  # no longer between two frames


def test_robots_side_by_side_are_marked_and_plotted_together(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    grown = crawling(scale=np.full((FRAMES, 1), 1.1), tint=np.full((FRAMES, 1), 2))
    shrunk = crawling(scale=np.full((FRAMES, 1), 0.9), tint=np.zeros((FRAMES, 1), int))
    page = opened(tmp_path, open_tab, grown, shrunk)
    alone = shown(page, 15)
    page.locator("summary").click()
    page.locator("[data-part=beside] input").check()
    until(page, lambda: "B" in page.locator("[data-part=caption]").inner_text())
    both = shown(page, 15)
    red, blue = (
        (picture[..., 0] - picture[..., 2] > 60, picture[..., 2] - picture[..., 0] > 60)
        for picture in (alone, both)
    )
    assert red[0].any()
    assert not red[1].any()
    assert all(part.sum() > 200 for part in blue)
    legend = page.locator("[data-part=legend] li").all_inner_texts()
    assert legend[-2:] == ["A: case", "B: case 2"]
    assert page.locator("[data-part=caption]").inner_text() == "A frame 15; B frame 15"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_stored_robots_are_drawn_and_move(
    tmp_path: Path, open_tab: Callable[..., Page], scheme: str
) -> None:
    width = 1280 if scheme == "light" else 390
    page = open_tab(width=width, color_scheme=scheme)
    asked, complaints = heard(page)
    manifest = sorted((RECORDS / "sensing" / "manifests").iterdir())[0]
    case = json.loads(manifest.read_text())["content"]["case"]["name"]
    file = tmp_path / "replay.html"
    done = cli.main(["replay", str(RECORDS), "sensing", case, f"--out={file}", "--no-show"])
    assert done == cli.DONE
    page.goto(file.as_uri())
    until(page, lambda: frames(page) > 5)
    first = pixels(stage(page))
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 50
    page.locator("[data-part=play]").click()
    until(page, lambda: at(page) > 3)
    page.locator("[data-part=play]").click()
    assert (pixels(stage(page)) != first).any()
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert asked == [file.as_uri()]
    assert complaints == []
    assert file.stat().st_size < 1_000_000


def test_text_of_a_scene_is_shown_and_never_run(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    scene = crawling(
        title=HOSTILE,
        palette=tints(*[HOSTILE] * 3),
        captions=(HOSTILE,) * FRAMES,
        series={HOSTILE: np.zeros((FRAMES, 1))},
    )
    page = opened(tmp_path, open_tab, scene, scene)
    page.locator("summary").click()
    page.locator("[data-part=beside] input").check()
    until(page, lambda: "B " in page.locator("[data-part=caption]").inner_text())
    assert page.locator("[data-part=legend] li").first.inner_text() == HOSTILE
    assert page.locator("img").count() == 0
    assert page.title() != "run"


def test_a_stage_that_was_out_of_sight_is_drawn_when_it_is_seen(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = opened(tmp_path, open_tab, crawling())
    before = shown(page, 3)
    page.evaluate("document.getElementById('replay').hidden = true")
    page.wait_for_timeout(100)
    page.evaluate("document.getElementById('replay').hidden = false")
    page.wait_for_timeout(100)
    assert len(coloured(pixels(stage(page)))) > 500
    assert np.abs(pixels(stage(page)) - before).mean() < 0.1


def test_the_view_is_set_back_without_following_too(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = opened(tmp_path, open_tab, crawling())
    size = len(coloured(shown(page, 3)))
    page.locator("[data-part=follow]").uncheck()
    stage(page).focus()
    page.keyboard.press("+")
    page.keyboard.press("0")
    assert len(coloured(pixels(stage(page)))) == pytest.approx(size, rel=0.05)


def test_pages_carry_the_licence_of_what_draws_in_space(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    opened(tmp_path, open_tab, crawling())
    assert "three.js authors" in (tmp_path / "replay.html").read_text()


def test_without_webgl_a_message_says_what_is_missing(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = opened(tmp_path, open_tab, crawling())
    page.add_init_script(
        "const get = HTMLCanvasElement.prototype.getContext;"
        "HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {"
        "  return kind.startsWith('webgl') ? null : get.call(this, kind, ...rest); }"
    )
    page.reload()
    error = page.locator("[data-part=error]")
    error.wait_for()
    assert "need WebGL" in error.inner_text()
