"""Videos, read back: every frame there, shown for as long as it should be, or a clear refusal."""

import json
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image, ImageSequence
from tests.report.player import BLUE, FRAMES, RED, WIDTH, crossing

from ethogram import cli
from ethogram.cli import commands
from ethogram.cli.gather import trials_of
from ethogram.core.errors import EthogramError
from ethogram.core.recorded import grouped, groups_by_trial
from ethogram.core.scene import Scene
from ethogram.report import Replay
from ethogram.report.render import video
from ethogram.report.render.frames import MARGIN, render_frame
from ethogram.report.render.video import write_video

RECORDS = Path(__file__).parents[3] / "docs" / "results" / "records"
WIDE = 160


def ffmpeg(*arguments: object) -> tuple[bytes, bytes]:
    """What it gives out and what it says."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, check=False)
    return done.stdout, done.stderr


def frames_of(file: Path) -> list[np.ndarray]:
    if file.suffix == ".mp4":
        decoded, said = ffmpeg("-i", file, "-f", "rawvideo", "-pix_fmt", "rgb24", "-")
        width, height = map(int, re.search(rb", (\d+)x(\d+)", said).groups())
        return list(np.frombuffer(decoded, np.uint8).reshape(-1, height, width, 3).astype(int))
    with Image.open(file) as image:
        return [
            np.asarray(frame.convert("RGB")).astype(int) for frame in ImageSequence.Iterator(image)
        ]


def durations_of(file: Path) -> list[int]:
    """How long each frame of an animated image is shown (ms)."""
    found = []
    with Image.open(file) as image:
        for at in range(image.n_frames):
            image.seek(at)
            image.load()
            found.append(image.info["duration"])
    return found


def disc(pixels: np.ndarray, colour: tuple[int, int, int]) -> float:
    """Where a disc is, in units of the scene; its colour may have suffered a little."""
    field = pixels[: pixels.shape[0] // 2, MARGIN:-MARGIN]
    columns = np.argwhere(np.abs(field - colour).max(2) < 40)[:, 1]
    return float((columns.mean() + 0.5) * WIDTH / field.shape[1])


def stored_case(world: str) -> str:
    """A case with a scene."""
    manifests = sorted((RECORDS / world / "manifests").iterdir())
    stored = [json.loads(manifest.read_text())["content"] for manifest in manifests]
    return next(each["case"]["name"] for each in stored if groups_by_trial(each["layout"]))


@pytest.mark.parametrize("suffix", [".gif", ".webp", ".mp4", ".GIF"])
def test_a_video_has_the_frames_of_its_scene(tmp_path: Path, suffix: str) -> None:
    scene, file = crossing(), tmp_path / "new" / f"video{suffix}"
    write_video(file, scene, width=WIDE)
    frames = frames_of(file)
    expected = np.asarray(render_frame(scene, 0, width=WIDE))
    assert len(frames) == FRAMES
    for at in (0, 10, 30, 40):
        assert frames[at].shape == expected.shape
        x = disc(frames[at], BLUE if at < FRAMES // 2 else RED)
        assert x == pytest.approx(scene.position[at, 0, 0], abs=0.3)
    assert list(file.parent.iterdir()) == [file]


@pytest.mark.parametrize("suffix", [".gif", ".webp"])
def test_each_frame_of_an_animated_image_is_shown_as_long_as_it_is_to_be(
    tmp_path: Path, suffix: str
) -> None:
    file = tmp_path / f"video{suffix}"
    write_video(file, crossing(), width=WIDE)
    assert durations_of(file) == [50] * FRAMES
    with Image.open(file) as image:
        assert image.info["loop"] == 0


def test_colours_of_a_gif_do_not_flicker(tmp_path: Path) -> None:
    scene, file = crossing(), tmp_path / "video.gif"
    write_video(file, scene, width=WIDE)
    with Image.open(file) as image:
        palettes = set()
        for at in range(image.n_frames):
            image.seek(at)
            palettes.add(bytes(image.global_palette.palette))
            assert image.disposal_method != 2
    assert len(palettes) == 1
    for at, pixels in enumerate(frames_of(file)):
        exact = np.asarray(render_frame(scene, at, width=WIDE)).astype(int)
        assert (pixels[exact.min(2) == 255] == 255).all()
        assert np.abs(pixels - exact).mean() < 0.5


def test_an_mp4_is_h264_at_the_scenes_pace(tmp_path: Path) -> None:
    file = tmp_path / "video.mp4"
    write_video(file, crossing(), width=WIDE)
    said = ffmpeg("-i", file)[1].decode()
    assert "Video: h264" in said
    assert "yuv420p" in said
    assert " 20 fps" in said
    assert "Duration: 00:00:02.05" in said  # 41 / 20


@pytest.mark.parametrize(("suffix", "frames"), [(".gif", 9), (".webp", 9), (".mp4", FRAMES)])
def test_too_many_frames_are_thinned_but_take_as_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, frames: int
) -> None:
    monkeypatch.setattr(video, "MOST_FRAMES", 10)
    file = tmp_path / f"video{suffix}"
    write_video(file, crossing(), width=WIDE)
    assert len(frames_of(file)) == frames
    if suffix != ".mp4":
        assert durations_of(file) == [250] * 8 + [50]


def test_a_gif_shows_no_frame_for_less_than_viewers_do(tmp_path: Path) -> None:
    for seconds, kept, shown in (
        (0.005, 11, {20}),  # every fourth
        (0.025, FRAMES, {20, 30}),  # in turn, since a GIF counts hundredths
        (0.02, FRAMES, {20}),
    ):
        file = tmp_path / "video.gif"
        write_video(file, crossing(frame_seconds=seconds), width=WIDE)
        durations = durations_of(file)
        assert len(durations) == kept
        assert set(durations) == shown
        assert sum(durations) / 1000 == pytest.approx(seconds * FRAMES, abs=0.02)


def test_a_scene_of_one_frame_is_a_video(tmp_path: Path) -> None:
    scene = crossing(
        position=np.full((1, 1, 2), 4.0), tint=np.zeros((1, 1), int), captions=("now",), series={}
    )
    for suffix in (".gif", ".webp", ".mp4"):
        write_video(tmp_path / f"video{suffix}", scene, width=WIDE)
        assert len(frames_of(tmp_path / f"video{suffix}")) == 1


@pytest.mark.parametrize("name", ["video.avi", "video", "video.gif.txt"])
def test_an_unknown_suffix_is_named_with_those_that_are_known(tmp_path: Path, name: str) -> None:
    with pytest.raises(EthogramError, match=r"\.gif, \.webp, \.mp4 can") as refused:
        write_video(tmp_path / name, crossing())
    assert repr(Path(name).suffix) in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_mp4_without_its_package_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(EthogramError, match=r"pip install 'ethogram\[video\]'"):
        write_video(tmp_path / "video.mp4", crossing(), width=WIDE)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("seconds", [1e-9, 1e6])
def test_a_scene_at_no_pace_that_a_video_has_is_refused(tmp_path: Path, seconds: float) -> None:
    with pytest.raises(EthogramError, match="shows a frame for"):
        write_video(tmp_path / "video.gif", crossing(frame_seconds=seconds))


@pytest.mark.parametrize("suffix", [".gif", ".webp", ".mp4"])
def test_a_video_that_fails_half_way_leaves_the_earlier_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    file = tmp_path / f"video{suffix}"
    write_video(file, crossing(), width=WIDE)
    earlier = file.read_bytes()

    def failing(scene: Scene, frame: int, *, width: int) -> Image.Image:
        if frame == 15:
            raise EthogramError("out of ink")
        return render_frame(scene, frame, width=width)

    monkeypatch.setattr(video, "render_frame", failing)
    with pytest.raises(EthogramError, match="out of ink"):
        write_video(file, crossing(), width=WIDE)
    assert file.read_bytes() == earlier
    assert list(tmp_path.iterdir()) == [file]


def test_where_nothing_can_be_written_the_reason_is_given(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(EthogramError, match="file"):
        write_video(tmp_path / "file" / "video.gif", crossing(), width=WIDE)
    (tmp_path / "folder.gif").mkdir()
    with pytest.raises(EthogramError, match=r"folder\.gif"):
        write_video(tmp_path / "folder.gif", crossing(), width=WIDE)


@pytest.mark.parametrize("world", ["sharing", "language", "publishing", "sensing"])
def test_stored_scenes_of_each_world_become_videos(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    world: str,
) -> None:
    monkeypatch.setattr(video, "MOST_FRAMES", 20)
    monkeypatch.setattr(video, "write_video", partial(write_video, width=240))
    file = tmp_path / "video.gif"
    command = ["replay", str(RECORDS), world, stored_case(world), f"--out={file}"]
    opened = []
    monkeypatch.setattr(commands.webbrowser, "open", opened.append)
    assert cli.main(command) == cli.DONE
    assert capsys.readouterr().out.strip() == str(file)
    assert opened == []  # a video is for others to show
    frames = frames_of(file)
    assert 10 <= len(frames) <= 20
    assert (frames[0] != frames[-1]).any()
    assert all((pixels[0] == 255).all() for pixels in frames)  # the paper is white
    assert len(np.unique(frames[0].reshape(-1, 3), axis=0)) > 20
    assert file.stat().st_size < 500_000


def test_the_format_is_what_is_asked_for_or_what_the_name_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    groups = grouped([crossing(), crossing(title="the other trial")])

    def trials(*_: object) -> dict[int, Replay]:
        return {replay.trial: replay for replay in trials_of("case", groups)}

    monkeypatch.setattr(commands, "trials_in", trials)
    monkeypatch.setattr(video, "write_video", partial(write_video, width=WIDE))

    def written(*options: str) -> str:
        code = cli.main(["replay", str(tmp_path), "toy", "case", "--no-show", *options])
        said = capsys.readouterr()
        assert code == (cli.WRONG if said.err else cli.DONE)
        return said.err or Path(said.out.strip()).relative_to(tmp_path).as_posix()

    assert written() == "report/toy-case.html"
    assert written("--format=gif") == "report/toy-case.gif"
    assert written("--format=mp4") == "report/toy-case.mp4"
    assert written(f"--out={tmp_path}/a.WEBP") == "a.WEBP"
    assert written(f"--out={tmp_path}/page") == "page"
    assert "Ethogram" in (tmp_path / "page").read_text()
    assert written(f"--out={tmp_path}/a.gif", "--format=gif") == "a.gif"
    assert '"trial": 2' in (tmp_path / "page").read_text()  # a page has all of them
    written("--trial=2")
    assert ">the other trial</h1>" in (tmp_path / "report" / "toy-case-trial-2.html").read_text()
    for options, said in (
        (["--trial=3"], "Unknown recorded trial '3'"),
        ([f"--out={tmp_path}/a.gif", "--format=mp4"], "disagree: leave one of them out, or let"),
        ([f"--out={tmp_path}/a.avi"], "Unknown format 'avi'. Allowed: gif, html, mp4, webp."),
        (["--format=avi"], "avi"),
    ):
        assert said in written(*options)

    del groups["scene"]["position"]
    assert "what is stored is no scene" in written("--format=gif")
