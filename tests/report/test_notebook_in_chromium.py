"""A scene as a notebook shows it: in a frame of another page, in a real browser."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import FrameLocator, Page

from ethogram.core.scene import Scene, Shape, tints

HOSTILE = "\"'></iframe></script><script>document.title='run'</script><img src=x onerror=alert(1)>"
FRAMES = 21


def rising(axes: int = 2, **changes) -> Scene:
    """A shape that goes up."""
    way = np.linspace(0.1, 0.9, FRAMES)
    position = np.zeros((FRAMES, 1, axes))
    position[:, 0, -1] = way
    scene = Scene(
        title="rising",
        bounds=(-0.5, 0.0, 0.5, 1.0),
        frame_seconds=0.05,
        palette=tints("going"),
        shapes=(Shape("circle" if axes == 2 else "cube", 0.05),),
        position=position,
        tint=np.zeros((FRAMES, 1), int),
        captions=tuple(f"frame {frame}" for frame in range(FRAMES)),
        series={"way": way[:, None]},
    )
    return replace(scene, **changes)


def opened(tmp_path: Path, page: Page, scene: Scene) -> FrameLocator:
    """A page with what a notebook would put into it, and the frame in that."""
    file = tmp_path / "notebook.html"
    file.write_text(
        "<!doctype html><html><head><meta charset='utf-8'><title>mine</title>"
        "<link rel='icon' href='data:,'></head>"
        f"<body><p>above</p>{scene._repr_html_()}<p>below</p></body></html>"
    )
    page.goto(file.as_uri())
    frame = page.frame_locator("iframe")
    frame.locator(f"#replay[data-frames='{FRAMES}']").wait_for()
    return frame


@pytest.mark.parametrize(("axes", "scheme"), [(2, "light"), (3, "dark")])
def test_it_plays_in_its_frame_and_asks_for_nothing(
    tmp_path: Path, open_tab: Callable[..., Page], axes: int, scheme: str
) -> None:
    page = open_tab(color_scheme=scheme)
    asked: list[str] = []
    complaints: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on(
        "console",
        lambda message: complaints.append(message.text) if message.type == "error" else None,
    )
    page.on("pageerror", lambda error: complaints.append(str(error)))
    frame = opened(tmp_path, page, rising(axes))
    assert frame.locator("#replay").get_attribute("data-frame") == "0"
    frame.locator("[data-part=play]").click()
    frame.locator("#replay:not([data-frame='0'])").wait_for()
    paper = frame.locator("body").evaluate("body => getComputedStyle(body).backgroundColor")
    assert (min(map(int, paper[4:-1].split(","))) > 128) == (scheme == "light")
    assert page.locator("body > p").all_inner_texts() == ["above", "below"]
    assert asked == [(tmp_path / "notebook.html").as_uri()]
    assert complaints == []


def test_the_player_is_in_sight_and_nothing_of_the_site_is(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    frame = opened(tmp_path, page, rising())
    assert frame.locator("h1").inner_text() == "rising"
    assert frame.locator(".bar, .kicker, a[href*=index]").count() == 0
    held = page.locator("iframe").bounding_box()
    legend = frame.locator("[data-part=legend]").bounding_box()
    assert held is not None
    assert legend is not None
    assert legend["y"] + legend["height"] <= held["y"] + held["height"]
    assert held["width"] > 1200


def test_text_of_a_scene_is_shown_and_neither_leaves_the_frame_nor_runs(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = open_tab()
    page.on("dialog", lambda dialog: pytest.fail(f"it ran: {dialog.message}"))
    scene = rising(
        title=HOSTILE,
        palette=tints(HOSTILE),
        captions=(HOSTILE,) * FRAMES,
        shapes=(Shape("circle", 0.05, HOSTILE),),
        words=(HOSTILE,),
        said=np.zeros((FRAMES, 1), int),
        series={HOSTILE: np.zeros((FRAMES, 1))},
    )
    frame = opened(tmp_path, page, scene)
    assert frame.locator("h1").inner_text() == HOSTILE
    assert HOSTILE in frame.locator("[data-part=caption]").inner_text()
    assert page.locator("iframe").get_attribute("title") == f"Replay: {HOSTILE}"
    assert frame.locator("img").count() == page.locator("img").count() == 0
    assert page.locator("body > *").count() == 3
    assert page.title() == "mine"


def test_text_that_cannot_be_encoded_is_replaced() -> None:
    shown = rising(title="half \ud800 a pair")._repr_html_()
    assert "half ? a pair" in shown
    shown.encode()
