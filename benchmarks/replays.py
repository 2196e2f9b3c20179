"""How large pages with replays are, how soon they show something, and how smoothly they play.

    python benchmarks/replays.py [--json FILE]

Ten replays a page, each of 300 frames: 100 agents in the plane, and 200 voxels in space.  Chromium
opens the page from its file and plays it at eight times the normal speed.  "First picture" is from
the start of the navigation until the first scene has been drawn; "work" is the time that the
player's own code takes for a frame, at its median and at its 95th percentile; "frames per second"
are those that the browser then showed.  Without a graphics card the browser also computes every
pixel of the scenes in space on the processor, which "work" does not hold: both are given.
"""

import argparse
import json
import shutil
import statistics
import sys
import tempfile
from pathlib import Path

import numpy as np
from playwright.sync_api import sync_playwright

from ethogram.core.scene import GRADED_COLOURS, Scene, Shape, Tint, tints
from ethogram.report import Replay, write_replay

FRAMES, REPLAYS, SECONDS = 300, 10, 4.0
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = "--no-sandbox --disable-gpu --disable-quic --no-first-run"  # no graphics card anywhere
WATCH = """
window.spent = []; window.first = null;
const ask = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = act => ask(now => {
  const began = performance.now(); act(now); window.spent.push(performance.now() - began); });
const look = () => {
  const root = document.getElementById("replay");
  if (root && Number(root.dataset.frames) > 0) ask(() => { window.first = performance.now(); });
  else setTimeout(look, 1); };
document.addEventListener("DOMContentLoaded", look);
"""


def agents(seed: int, count: int = 100) -> Scene:
    """Agents that wander in the plane, each with a label and a word."""
    rng = np.random.default_rng(seed)
    position = 50 + np.cumsum(rng.normal(0, 0.5, (FRAMES, count, 2)), 0)
    return Scene(
        title="agents",
        bounds=(0.0, 0.0, 100.0, 100.0),
        frame_seconds=0.1,
        palette=tints("one kind", "another kind"),
        shapes=tuple(Shape("circle", 1.5, str(agent)) for agent in range(count)),
        position=position,
        tint=np.tile(np.arange(count) % 2, (FRAMES, 1)),
        words=("yes", "no"),
        said=rng.integers(-1, 2, (FRAMES, count)),
        captions=tuple(f"step {frame}" for frame in range(FRAMES)),
        series={"distance": position[..., 0]},
    )


def robot(seed: int, edges: tuple[int, int, int] = (10, 5, 4)) -> Scene:
    """A block of voxels that waves along x."""
    rng = np.random.default_rng(seed)
    cells = np.stack(np.meshgrid(*map(np.arange, edges), indexing="ij"), -1).reshape(-1, 3)
    time = np.arange(FRAMES)[:, None]
    wave = np.sin(0.3 * time + 0.7 * cells[:, 0] + rng.uniform(0, 6))
    position = 0.01 * (cells + 0.5) + np.zeros((FRAMES, 1, 1))
    position[..., 0] += 0.002 * time
    position[..., 2] += 0.003 * (1 + wave)
    turn = 0.1 * wave
    zero = np.zeros_like(turn)
    return Scene(
        title="robot",
        bounds=(0.0, 0.0, 1.0, 0.1),
        frame_seconds=0.1,
        palette=tuple(map(Tint, ("contracted", "at rest", "expanded"), GRADED_COLOURS)),
        shapes=tuple(Shape("cube", 0.005) for _ in cells),
        position=position,
        tint=np.ones(wave.shape, int),
        scale=1 + 0.1 * wave,
        orientation=np.stack([np.cos(turn / 2), zero, np.sin(turn / 2), zero], -1),
        captions=tuple(f"step {frame}" for frame in range(FRAMES)),
        series={"distance (mm)": 2.0 * time},
    )


def measured(name: str, scenes: list[Scene], folder: Path) -> dict[str, float | str]:
    """One page, opened and played."""
    file = folder / "replay.html"
    write_replay(file, "benchmark", [Replay(name=f"{n}", scene=s) for n, s in enumerate(scenes)])
    executable = next(filter(None, map(shutil.which, BROWSERS)))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=FLAGS.split())
        page = browser.new_context(viewport={"width": 1280, "height": 900}).new_page()
        page.add_init_script(WATCH)
        page.goto(file.as_uri())
        while (first := page.evaluate("window.first")) is None:
            page.wait_for_timeout(10)
        page.locator("[data-part=speed]").select_option(index=5)
        page.locator("[data-part=loop]").check()
        page.evaluate("window.spent = []")
        page.locator("[data-part=play]").click()
        page.wait_for_timeout(1000 * SECONDS)
        spent = sorted(page.evaluate("window.spent"))
        browser.close()
    return {
        "scene": name,
        "megabytes": file.stat().st_size / 1e6,
        "first": first / 1000,
        "work": statistics.median(spent),
        "work_95": spent[int(0.95 * len(spent))],
        "rate": len(spent) / SECONDS,
    }


def main() -> None:
    """Measure, print the table, and keep the figures where asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    pages = {"100 agents": agents, "200 voxels": robot}
    with tempfile.TemporaryDirectory() as folder:
        rows = [
            measured(name, [make(seed) for seed in range(REPLAYS)], Path(folder))
            for name, make in pages.items()
        ]
    print("| ten replays of | page, MB | first picture, s | work a frame, ms | frames per second |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for row in rows:
        print(
            f"| {row['scene']} | {row['megabytes']:.2f} | {row['first']:.2f} | "
            f"{row['work']:.2f} (95%: {row['work_95']:.2f}) | {row['rate']:.0f} |"
        )
    if options.json:
        found = {"python": sys.version.split()[0], "rows": rows}
        options.json.write_text(json.dumps(found))


if __name__ == "__main__":
    main()
