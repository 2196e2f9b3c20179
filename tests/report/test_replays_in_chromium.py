"""The player as a viewer uses it, in a real browser, with scenes made here and with stored ones."""

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page
from tests.report.player import (
    BLUE,
    FRAMES,
    HEIGHT,
    HOSTILE,
    RED,
    WIDTH,
    at,
    centre,
    crossing,
    driving,
    extent,
    frames,
    heard,
    opened,
    pixels,
    until,
)

from ethogram import cli
from ethogram.core.errors import EthogramError
from ethogram.core.recorded import groups_by_trial
from ethogram.core.scene import Shape, tints
from ethogram.report import Replay, StudyPage, write, write_replay
from ethogram.report.replay import encode_replays, subsample

NASTY = (
    "</script>",
    "<script>window.ran=1</script>",
    "<!--",
    "-->",
    "]]>",
    "<img src=x onerror=alert(1)>",
    '"',
    "'",
    "`${window.ran=1}`",
    "&lt;",
    "&",
    "<",
    ">",
    "\\",
    "\\u003c",
    "\u2028",
    "\u202e",
    "\u05e9",
    "\u0645\u0631",
    "\U0001f916",
    "e\u0301",
    "{{ 7 * 7 }}",
    "{% raw %}",
    "javascript:alert(1)",
    "=1+1",
    "\t",
    " ",
    "%3Cb%3E",
    "\x7f",
    "\ufeff",
)
RECORDS = Path(__file__).parents[2] / "docs" / "results" / "records"
WORLDS = ("sharing", "language", "publishing")


@pytest.mark.parametrize(("frame", "colour"), [(0, BLUE), (13, BLUE), (30, RED), (40, RED)])
def test_scrubbing_shows_what_the_scene_has_in_that_frame(
    tmp_path: Path, open_tab: Callable[..., Page], frame: int, colour: tuple[int, int, int]
) -> None:
    scene = crossing()
    page = opened(tmp_path, open_tab, scene)
    page.locator("[data-part=frame]").fill(str(frame))
    assert at(page) == frame
    assert page.locator("[data-part=caption]").inner_text() == f"frame {frame}"
    found = centre(pixels(page.locator("[data-part=canvas]")), colour)
    assert found is not None
    x, y = scene.position[frame, 0]
    np.testing.assert_allclose(found, (x / WIDTH, 1 - y / HEIGHT), atol=0.01)


def test_polygons_turn_and_change_their_form_above_a_background_that_stays(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = opened(tmp_path, open_tab, driving(), color_scheme="light")
    canvas = page.locator("[data-part=canvas]")
    for frame, car, body in (
        (0, (3, 1), (3, 3)),
        (20, (2.8, 2.8), (3, 1.8)),
        (40, (1, 3), (3, 0.6)),
    ):
        page.locator("[data-part=frame]").fill(str(frame))
        seen = pixels(canvas)
        assert centre(seen, BLUE) == pytest.approx((4 / WIDTH, 1 - 6 / HEIGHT), abs=0.01)
        assert extent(seen, BLUE) == pytest.approx(car, abs=0.2)
        assert extent(seen, RED) == pytest.approx(body, abs=0.2)
        scale = seen.shape[1] / WIDTH
        lane = np.abs(seen[:, round(9 * scale)] - (189, 186, 177)).max(1) < 8
        assert lane.sum() == pytest.approx(2 * scale, abs=3)
    page.locator("[data-part=frame]").fill("20")
    slope = np.argwhere(np.abs(pixels(canvas) - BLUE).max(2) < 12).T
    assert np.corrcoef(*slope)[0, 1] < -0.5  # up to the right


def test_a_single_frame_is_shown_without_what_would_play_it(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    one = subsample(driving(series={"way": np.zeros((FRAMES, 1))}), FRAMES)
    page = opened(tmp_path, open_tab, one, crossing())
    assert frames(page) == 1
    assert centre(pixels(page.locator("[data-part=canvas]")), BLUE) is not None
    parts = ("frame", "play", "chart", "lines")
    assert not any(page.locator(f"[data-part={part}]").is_visible() for part in parts)
    page.locator("[data-part=scene]").select_option("case 2")
    until(page, lambda: frames(page) == FRAMES)
    assert all(page.locator(f"[data-part={part}]").is_visible() for part in parts)


def test_it_moves_while_it_plays_and_stands_when_it_is_stopped(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = opened(tmp_path, open_tab, crossing())
    canvas, play = page.locator("[data-part=canvas]"), page.locator("[data-part=play]")
    before = pixels(canvas)
    play.click()
    until(page, lambda: at(page) > 3)
    play.click()
    stopped, frame = pixels(canvas), at(page)
    assert (before != stopped).any()
    page.wait_for_timeout(200)
    assert at(page) == frame
    assert (pixels(canvas) == stopped).all()
    assert play.inner_text() == "Play"


def test_it_stops_at_the_end_and_begins_again_if_asked_to(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = opened(tmp_path, open_tab, crossing())
    page.locator("[data-part=speed]").select_option(index=5)
    page.locator("[data-part=play]").click()
    until(page, lambda: at(page) == 40)
    until(page, lambda: page.locator("[data-part=play]").inner_text() == "Play")
    page.locator("[data-part=loop]").check()
    page.locator("[data-part=play]").click()
    until(page, lambda: at(page) > 20)
    until(page, lambda: at(page) < 20)
    assert page.locator("[data-part=play]").inner_text() == "Pause"


def test_between_two_frames_shapes_move_unless_they_are_there_anew(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    x = np.where(np.arange(FRAMES) % 2, WIDTH - 1, 1)
    there_and_back = np.stack([x, np.full(FRAMES, 6.0)], 1)[:, None]
    for fresh in (None, np.ones((FRAMES, 1), bool)):
        scene = crossing(position=there_and_back, frame_seconds=160.0, fresh=fresh)
        page = opened(tmp_path, open_tab, scene)
        canvas = page.locator("[data-part=canvas]")
        before = centre(pixels(canvas), BLUE)
        page.locator("[data-part=speed]").select_option(index=5)
        page.locator("[data-part=play]").click()
        page.wait_for_timeout(1000)
        after = centre(pixels(canvas), BLUE)
        assert at(page) == 0
        assert before is not None
        assert after is not None
        way = after[0] - before[0]
        assert way == 0 if fresh is not None else 0.01 < way < 0.8
        page.locator("[data-part=play]").click()  # a stopped player shows the frame itself
        assert centre(pixels(canvas), BLUE) == before


def test_nothing_glides_for_those_who_want_less_motion(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = opened(tmp_path, open_tab, crossing(frame_seconds=160.0), reduced_motion="reduce")
    before = pixels(page.locator("[data-part=canvas]"))
    page.locator("[data-part=speed]").select_option(index=5)
    page.locator("[data-part=play]").click()
    page.wait_for_timeout(500)
    assert at(page) == 0
    assert (pixels(page.locator("[data-part=canvas]")) == before).all()


def test_chapters_are_gone_to_and_shown(tmp_path: Path, open_tab: Callable[..., Page]) -> None:
    chapters = tuple(f"year {1 + frame // 10}" for frame in range(FRAMES))
    page = opened(tmp_path, open_tab, crossing(chapters=chapters))
    choice = page.locator("[data-part=chapter]")
    years = choice.locator("option").all_inner_texts()
    assert years == [f"year {year}" for year in range(1, 6)]
    choice.select_option(label="year 3")
    assert at(page) == 20
    page.locator("[data-part=frame]").fill("39")
    assert choice.evaluate("each => each.selectedOptions[0].label") == "year 4"
    plain = opened(tmp_path, open_tab, crossing())
    assert not plain.locator("[data-part=chapter]").is_visible()


def test_a_trial_is_chosen_where_there_are_several(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    scenes = [crossing(captions=(f"trial {trial}",) * FRAMES) for trial in (1, 2)]
    replays = [
        Replay(name="case", scene=scene, trial=trial) for trial, scene in enumerate(scenes, start=1)
    ]
    file = tmp_path / "replay.html"
    write_replay(file, "toy", [*replays, Replay(name="alone", scene=crossing())])
    page = open_tab()
    page.goto(file.as_uri())
    caption, trial = page.locator("[data-part=caption]"), page.locator("[data-part=trial]")
    until(page, lambda: caption.inner_text() == "trial 1")
    trial.select_option("2")
    until(page, lambda: caption.inner_text() == "trial 2")
    page.locator("[data-part=scene]").select_option("alone")
    until(page, lambda: caption.inner_text() == "frame 0")
    assert not trial.is_visible()


def test_keys_step_jump_and_play(tmp_path: Path, open_tab: Callable[..., Page]) -> None:
    page = opened(tmp_path, open_tab, crossing())
    page.locator("[data-part=frame]").focus()
    for key, frame in (
        ("ArrowRight", 1),
        ("PageDown", 11),
        ("ArrowLeft", 10),
        ("PageUp", 0),
        ("ArrowLeft", 0),
        ("End", 40),
        ("ArrowRight", 40),
        ("Home", 0),
    ):
        page.keyboard.press(key)
        assert at(page) == frame, key
    page.keyboard.press(" ")
    until(page, lambda: at(page) > 2)
    page.keyboard.press("k")
    assert page.locator("[data-part=play]").inner_text() == "Play"


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_stored_scenes_of_each_world_are_drawn_and_move(
    tmp_path: Path, open_tab: Callable[..., Page], world: str, scheme: str
) -> None:
    width = 1280 if scheme == "light" else 390
    page = open_tab(width=width, height=800, color_scheme=scheme)
    asked, complaints = heard(page)
    manifests = sorted((RECORDS / world / "manifests").iterdir())
    stored = [json.loads(manifest.read_text())["content"] for manifest in manifests]
    case = next(each["case"]["name"] for each in stored if groups_by_trial(each["layout"]))
    file = tmp_path / "replay.html"
    done = cli.main(["replay", str(RECORDS), world, case, f"--out={file}", "--no-show"])
    assert done == cli.DONE
    page.goto(file.as_uri())
    until(page, lambda: frames(page) > 5)
    box = page.locator("#replay").bounding_box()
    assert box is not None
    assert width < 1280 or box["height"] <= 800  # stage and controls are seen together
    canvas = page.locator("[data-part=canvas]")
    first = pixels(canvas)
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 5
    page.locator("[data-part=play]").click()
    until(page, lambda: at(page) > 1)
    page.locator("[data-part=play]").click()
    assert (pixels(canvas) != first).any()
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert asked == [file.as_uri()]
    assert complaints == []
    assert file.stat().st_size < 600_000


def test_words_of_neighbours_stay_apart_on_a_phone(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    agents = 10
    x = np.linspace(2, WIDTH - 2, agents)
    scene = crossing(
        shapes=(Shape("circle", 0.35),) * agents,
        position=np.tile(np.stack([x, np.full(agents, 3.0)], 1), (FRAMES, 1, 1)),
        tint=np.zeros((FRAMES, agents), int),
        words=("coming to 1",),
        said=np.zeros((FRAMES, agents), int),
        series={},
    )
    page = opened(tmp_path, open_tab, scene, width=390, color_scheme="light")
    ink = (pixels(page.locator("[data-part=canvas]")) < 60).all(2)
    longest = max(
        sum(1 for _ in same) for row in ink for dark, same in groupby(row.tolist()) if dark
    )
    assert 30 < longest < 100  # the rim around one word, not a bar over all of them
    assert ink.sum() > 10 * 11 * 3  # each of them is there


def test_lines_have_names_and_colours_of_their_own_over_an_axis_of_frames(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    series = {"return": np.linspace([0, 1], [1, 0], FRAMES), "level": np.zeros((FRAMES, 1))}
    page = opened(tmp_path, open_tab, crossing(series=series))
    lines = page.locator("[data-part=lines] li")
    assert lines.all_inner_texts() == ["return 1", "return 2", "level"]
    strokes = [
        line.evaluate("each => getComputedStyle(each).borderTopColor")
        for line in page.locator("[data-part=lines] .stroke").all()
    ]
    tints = [
        spot.evaluate("each => getComputedStyle(each).backgroundColor")
        for spot in page.locator("[data-part=legend] .swatch").all()
    ]
    assert len({*strokes, *tints}) == len(strokes) + len(tints)
    chart = pixels(page.locator("[data-part=chart]"))
    for stroke in strokes:
        colour = [int(part) for part in re.findall(r"\d+", stroke)[:3]]
        assert (np.abs(chart - colour).max(2) < 40).sum() > 100  # it is drawn in that colour
    level = (chart[:, 60:-20] < 150).all(2).mean(1)  # the axis is the one level grey line
    below = chart[int(level.argmax()) + 6 :]
    assert level.max() > 0.9
    assert (below < 160).all(2).sum() > 30  # numbers stand below it
    assert page.get_by_label("loop").count() == 1


@pytest.mark.parametrize(("low", "shown"), [(4.94e-4, "0"), (-0.321, "-0.321")])
def test_the_bounds_of_lines_stand_beside_them_whole(
    tmp_path: Path, open_tab: Callable[..., Page], low: float, shown: str
) -> None:
    """Their texts, from where they end to where they begin."""
    series = {"distance": np.linspace([low], [58.6], FRAMES)}
    write_replay(
        tmp_path / "replay.html", "toy", [Replay(name="case", scene=crossing(series=series))]
    )
    page = open_tab()
    page.add_init_script(
        """const fill = CanvasRenderingContext2D.prototype.fillText;
        window.texts = {};
        CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
          if (this.textAlign === "right") texts[text] = x - this.measureText(text).width;
          fill.call(this, text, x, y);
        };"""
    )
    page.goto((tmp_path / "replay.html").as_uri())
    until(page, lambda: frames(page) > 0)
    begins = page.evaluate("texts")
    assert begins.keys() == {shown, "58.6"}
    assert min(begins.values()) >= 0


def test_a_series_that_would_be_flat_has_a_scale_of_its_own(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    series = {
        "distance": np.linspace([0], [28_000], FRAMES),
        "collisions": np.linspace([0], [490], FRAMES),
        "level": np.zeros((FRAMES, 1)),
    }
    page = opened(tmp_path, open_tab, crossing(series=series))
    names = page.locator("[data-part=lines] li").all_inner_texts()
    assert names == ["distance", "collisions (right)", "level"]


def test_a_page_keeps_to_its_size_and_says_which_frames_it_left_out(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(2000, 5, 2))
    changes = {
        "position": noise,
        "tint": np.zeros((2000, 5), int),
        "shapes": (Shape("circle", 0.1),) * 5,
        "captions": tuple(f"frame {frame}" for frame in range(2000)),
        "series": {},
    }
    file = tmp_path / "replay.html"
    replays = [Replay(name="long", scene=crossing(**changes)), Replay(name="b", scene=crossing())]
    write_replay(file, "toy", replays, page_bytes=75_000)
    assert 60_000 < file.stat().st_size <= 75_000
    page = open_tab()
    page.goto(file.as_uri())
    until(page, lambda: frames(page) > 0)
    note = page.locator("[data-part=thinned]")
    step = int(re.findall(r"every (\d+)", note.inner_text())[0])
    assert note.inner_text().startswith("of 2000 frames every ")
    assert frames(page) == math.ceil(2000 / step)
    page.locator("[data-part=frame]").fill("3")
    assert page.locator("[data-part=caption]").inner_text() == f"frame {3 * step}"
    page.locator("[data-part=scene]").select_option("b")
    until(page, lambda: frames(page) == FRAMES)
    assert not note.is_visible()


def test_a_page_has_ten_replays_of_many_and_says_so(
    tmp_path: Path, open_tab: Callable[..., Page], bare: StudyPage
) -> None:
    replays = [Replay(name=f"case {number}", scene=crossing()) for number in range(12)]
    study = replace(bare, replays=replays)
    folder = write(tmp_path, [study]).parent
    page = open_tab()
    page.goto((folder / "report" / "bare.html").as_uri())
    choice = page.locator("[data-part=scene]")
    shown = choice.locator("option").all_inner_texts()
    assert len(shown) == 10
    assert [shown[0], shown[-1]] == ["case 0", "case 11"]
    assert "2 more" in page.locator("#section-replays + p").inner_text()
    page.locator("[data-part=frame]").fill("7")
    choice.select_option("case 4")
    until(page, lambda: at(page) == 0)


def test_text_of_a_scene_is_shown_and_never_run(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    scene = crossing(
        title=HOSTILE,
        palette=tints(HOSTILE, HOSTILE),
        captions=(HOSTILE,) * FRAMES,
        shapes=(Shape("circle", 0.8, HOSTILE),),
        words=(HOSTILE,),
        said=np.zeros((FRAMES, 1), int),
        series={HOSTILE: np.zeros((FRAMES, 1))},
    )
    page = opened(tmp_path, open_tab, scene)
    assert page.locator("h1").inner_text() == HOSTILE
    assert HOSTILE in page.locator("[data-part=caption]").inner_text()
    assert page.locator("[data-part=legend] li").first.inner_text() == HOSTILE
    assert page.locator("img").count() == 0
    assert page.title() != "run"
    # nor can a script that somebody put in later
    ran = page.evaluate(
        "() => { const s = document.createElement('script'); s.textContent = 'window.ran = 1';"
        "document.body.append(s); return window.ran === 1 }"
    )
    assert not ran


def test_drawn_texts_are_shown_letter_by_letter_and_never_run(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    rng = np.random.default_rng(6)
    texts = ["".join(rng.choice(NASTY, rng.integers(1, 6))) for _ in range(3 * FRAMES)]
    captions, chapters, names = (tuple(texts[at::3]) for at in range(3))
    scene = crossing(
        captions=captions,
        chapters=chapters,
        palette=tints(*names[:2]),
        shapes=(Shape("circle", 0.8, names[2]),),
        words=names[3:4],
        said=np.zeros((FRAMES, 1), int),
        series={names[4]: np.zeros((FRAMES, 1))},
    )
    cases = [Replay(name=f"{number} {name}", scene=scene) for number, name in enumerate(names[:10])]
    write_replay(tmp_path / "replay.html", names[5], cases)
    page = open_tab()
    dialogs: list[str] = []
    page.on("dialog", lambda dialog: dialogs.append(dialog.message))
    page.goto((tmp_path / "replay.html").as_uri())
    until(page, lambda: frames(page) > 0)

    def said(part: str) -> list[str]:
        return page.eval_on_selector_all(part, "found => found.map(each => each.textContent)")

    seen = []
    for frame in range(FRAMES):
        page.locator("[data-part=frame]").fill(str(frame))
        seen += said("[data-part=caption]")
    assert tuple(seen) == captions
    begun = [name for at, name in enumerate(chapters) if not at or name != chapters[at - 1]]
    assert said("[data-part=chapter] option") == begun
    assert said("[data-part=legend] li span:last-child") == list(names[:2])
    assert said("[data-part=scene] option") == [case.name for case in cases]
    assert page.evaluate("window.ran") is None
    assert dialogs == []


def test_a_damaged_scene_shows_a_message_not_a_blank(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = opened(tmp_path, open_tab, None)
    error = page.locator("[data-part=error]")
    error.wait_for()
    assert error.inner_text() == "This replay cannot be shown: it is cut short."
    text = (tmp_path / "replay.html").read_text()
    assert '"error"' in text
    whole = opened(tmp_path, open_tab, crossing())
    text = (tmp_path / "replay.html").read_text()
    whole_scene = encode_replays([Replay(name="case", scene=crossing())])
    data = json.loads(whole_scene)[0]["arrays"]["tint"]["data"]
    short = encode_replays([Replay(name="case", scene=crossing(tint=np.zeros((FRAMES, 1), int)))])
    other = json.loads(short)[0]["arrays"]["tint"]["data"]
    assert data in text
    (tmp_path / "replay.html").write_text(text.replace(f'"frames": {FRAMES}', '"frames": 40'))
    assert other != data
    whole.reload()
    whole.locator("[data-part=error]").wait_for()
    assert "its numbers are cut short" in whole.locator("[data-part=error]").inner_text()


def test_nothing_of_an_earlier_scene_is_left_when_a_damaged_one_is_chosen(
    tmp_path: Path, open_tab: Callable[..., Page]
) -> None:
    page = opened(tmp_path, open_tab, crossing(), None)
    page.locator("[data-part=play]").click()
    page.locator("[data-part=scene]").select_option("case 2")
    page.locator("[data-part=error]").wait_for()
    for part in ("canvas", "space", "chart"):
        assert not page.locator(f"[data-part={part}]").is_visible()
    assert page.locator("[data-part=play]").inner_text() == "Play"
    page.locator("[data-part=scene]").select_option("case")
    until(page, lambda: frames(page) > 0)
    assert centre(pixels(page.locator("[data-part=canvas]")), BLUE) is not None


def test_what_is_no_number_is_not_drawn(tmp_path: Path, open_tab: Callable[..., Page]) -> None:
    scene = crossing()
    position, way = scene.position.copy(), scene.series["way"].copy()
    position[5, 0, 0] = np.nan
    way[5:10] = np.nan
    page = opened(tmp_path, open_tab, crossing(position=position, series={"way": way}))
    canvas = page.locator("[data-part=canvas]")
    page.locator("[data-part=frame]").fill("5")
    assert centre(pixels(canvas), BLUE) is None
    page.locator("[data-part=frame]").fill("6")
    found = centre(pixels(canvas), BLUE)
    assert found is not None
    np.testing.assert_allclose(found[0], scene.position[6, 0, 0] / WIDTH, atol=0.01)


def test_what_cannot_be_replayed_is_refused_with_the_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    foreign = tmp_path / "mine.html"
    foreign.write_text("my own page")
    with pytest.raises(EthogramError, match="no page of Ethogram's"):
        write_replay(foreign, "toy", [Replay(name="case", scene=crossing())])
    for words, said in (
        (["sharing", "nobody"], "nobody"),
        (["rules", "x"], "rules"),
    ):
        command = ["replay", str(RECORDS), *words, "--no-show"]
        assert cli.main(command) == cli.WRONG
        assert said in capsys.readouterr().err
