"""What tests of the player share: a toy scene, and how to look at the page that plays it."""

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Locator, Page

from ethogram.core.scene import BackgroundShape, Scene, Shape, Tint, tints
from ethogram.report import Replay, write_replay

HOSTILE = "</script><script>document.title='run'</script><img src=x onerror=alert(1)>\u202e\u05e9"
BLUE, RED = (0, 114, 178), (213, 94, 0)
FRAMES, WIDTH, HEIGHT = 41, 16.0, 9.0


def crossing(**changes) -> Scene:
    """A disc that goes from left to right in a field of 16 to 9, and turns red half way."""
    x = np.linspace(1, WIDTH - 1, FRAMES)
    settings = {
        "title": "crossing",
        "bounds": (0.0, 0.0, WIDTH, HEIGHT),
        "frame_seconds": 0.05,
        "palette": tints("going", "gone"),
        "shapes": (Shape("circle", 0.8),),
        "position": np.stack([x, np.full(FRAMES, 6.0)], 1)[:, None],
        "tint": (np.arange(FRAMES) >= FRAMES // 2).astype(int)[:, None],
        "captions": tuple(f"frame {frame}" for frame in range(FRAMES)),
        "series": {"way": x[:, None]},
    }
    return Scene(**(settings | changes))


CAR = ((-1.5, -0.5), (1.5, -0.5), (1.5, 0.5), (-1.5, 0.5))  # long and narrow
ROAD = ((0.0, 6.0), (WIDTH, 6.0))


def driving(**changes) -> Scene:
    """A car on a road that turns by a right angle, and a soft square that becomes a flat one."""
    turn = np.linspace(0, np.pi / 2, FRAMES)
    tall = 1 - 0.8 * np.linspace(0, 1, FRAMES)
    form = np.full((FRAMES, 2, 5, 2), np.nan)  # one vertex more than is used
    form[:, 1, :4] = np.array(((-1, -1), (1, -1), (1, 1), (-1, 1)))
    form[:, 1, :4, 1] *= tall[:, None]
    settings = {
        "palette": (Tint("car", "#0072b2"), Tint("body", "#d55e00"), Tint("road", "#bdbab1")),
        "shapes": (Shape("polygon", 1.0, "", CAR), Shape("polygon", 1.5)),
        "background": (BackgroundShape("line", ROAD, 2, 2.0),),
        "position": np.tile([(4.0, 6.0), (12.0, 2.0)], (FRAMES, 1, 1)),
        "tint": np.tile([0, 1], (FRAMES, 1)),
        "heading": np.stack([turn, 0 * turn], 1),
        "vertices": form,
        "series": {},
    }
    return crossing(**(settings | changes))


def opened(tmp_path: Path, open_tab: Callable[..., Page], *scenes: Scene | None, **screen) -> Page:
    """A page of its own with these scenes, called case, case 2, ...; None is a damaged one."""
    file = tmp_path / "replay.html"
    replays = [
        Replay(
            name=f"case {number}" if number > 1 else "case", scene=scene, error="it is cut short"
        )
        for number, scene in enumerate(scenes, start=1)
    ]
    write_replay(file, "toy", replays)
    page = open_tab(**screen)
    page.goto(file.as_uri())
    page.locator("#replay").wait_for()
    if scenes[0] is not None:
        until(page, lambda: frames(page) > 0)
    return page


def pixels(shown: Locator) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(shown.screenshot())).convert("RGB")).astype(int)


def centre(picture: np.ndarray, colour: tuple[int, int, int]) -> tuple[float, float] | None:
    """Where a colour is, in shares of the picture's width and height."""
    where = np.argwhere(np.abs(picture - colour).max(2) < 12)
    if len(where) < 50:
        return None
    y, x = where.mean(0)
    return x / picture.shape[1], y / picture.shape[0]


def extent(picture: np.ndarray, colour: tuple[int, int, int]) -> tuple[float, float]:
    """How wide and how high a colour is, in units of the field."""
    where = np.argwhere(np.abs(picture - colour).max(2) < 12)
    high, wide = np.ptp(where, axis=0) + 1
    return wide * WIDTH / picture.shape[1], high * HEIGHT / picture.shape[0]


def at(page: Page) -> int:
    """The frame that is shown."""
    return int(page.locator("#replay").get_attribute("data-frame") or 0)


def frames(page: Page) -> int:
    """How many there are, once the scene is read."""
    return int(page.locator("#replay").get_attribute("data-frames") or 0)


def until(page: Page, met: Callable[[], bool]) -> None:
    """Wait; the page's policy forbids the browser to do it by evaluating text."""
    for _ in range(400):
        if met():
            return
        page.wait_for_timeout(20)
    pytest.fail("it did not happen within eight seconds")


def heard(page: Page) -> tuple[list[str], list[str]]:
    """What the page will ask for, and what it will complain of, as it happens."""
    asked: list[str] = []
    complaints: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    return asked, complaints
