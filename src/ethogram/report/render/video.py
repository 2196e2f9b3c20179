"""Scenes as videos that every viewer shows: animated GIF and WebP, and MP4 (H.264)."""

import io
import itertools
import math
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from ethogram.campaign.files import StorageError, write_whole
from ethogram.core.errors import EthogramError
from ethogram.core.scene import Scene
from ethogram.report.render.frames import WIDTH, render_frame

MOST_FRAMES = 600  # of an animated image
SHORTEST = 0.02  # s; viewers of GIF slow down what is shown for less
SLOWEST, FASTEST = 60.0, 0.001  # s, that a frame may be shown
COLOURS, EXACT = 255, 96  # of an animated image: in all, and kept as they are, the commonest
CELL = 4  # steps of red, green and blue that Pillow tells apart when it looks colours up
SAMPLE = 9  # frames from which the colours are chosen
QUALITY = "18"  # of MP4: the lower the better, from 0 to 51
SWIFT: dict[str, int] = {"method": 1, "quality": 20}  # of WebP: a fifth of the time, hardly larger


def write_video(file: Path, scene: Scene, *, width: int = WIDTH) -> None:
    """Write a scene as a video, whole or not at all, in place of an earlier one of that name.

    An MP4 has every frame.  A GIF or WebP has 600 at most, evenly chosen and shown for longer, so
    that the video takes as long; a GIF has none that is shown for less than 20 ms.

    Args:
        file: where to; its suffix (.gif, .webp, .mp4) is the format.
        scene: in the plane or in space.
        width: of the video (pixels), made even.

    Raises:
        EthogramError: the suffix is none of these, the scene has nothing to show, a package is
            missing, or the file cannot be written.

    """
    video = FORMATS.get(file.suffix.lower())
    if video is None:
        raise EthogramError(
            f"{str(file)!r} cannot be a video: {', '.join(FORMATS)} can, by the name's end, "
            f"and this one's is {file.suffix!r}."
        )
    if not FASTEST <= scene.frame_seconds <= SLOWEST:
        raise EthogramError(
            f"Scene {scene.title!r} shows a frame for {scene.frame_seconds} s; a video can from "
            f"{FASTEST} to {SLOWEST} s."
        )
    content = video(scene, width)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"Cannot write {str(file)!r}: {error.strerror or error}.") from error
    write_whole(file, content)


def _gif(scene: Scene, width: int) -> bytes:
    frames = _subsampled(scene, SHORTEST)
    images, palette = _quantized(scene, frames, width)
    durations = [10 * units for units in _durations(scene, frames, 0.01, SHORTEST)]
    # optimised: what does not change from a frame to the next is transparent
    return _animation(images, "GIF", durations, palette=palette, optimize=True)


def _webp(scene: Scene, width: int) -> bytes:
    frames = _subsampled(scene, FASTEST)
    images, _ = _quantized(scene, frames, width)
    durations = _durations(scene, frames, 0.001, FASTEST)
    return _animation(images, "WEBP", durations, lossless=True, **SWIFT)


def _subsampled(scene: Scene, shortest: float) -> range:
    """Every n-th frame, so that there are not too many and none is shown for too short a time."""
    count = len(scene.tint)
    step = max(math.ceil(count / MOST_FRAMES), math.ceil(shortest / scene.frame_seconds - 1e-9))
    return range(0, count, step)


def _durations(scene: Scene, frames: Sequence[int], unit: float, shortest: float) -> list[int]:
    """How many units (s) each frame is shown until the next is due, rounded with no drift."""
    due = np.round(scene.frame_seconds / unit * np.append(frames, len(scene.tint)))
    return np.maximum(np.diff(due), round(shortest / unit)).astype(int).tolist()


def _animation(
    images: Iterable[Image.Image], kind: str, durations: Sequence[int], **options: object
) -> bytes:
    """An image that begins again when it has ended; durations in ms."""
    content = io.BytesIO()
    first, *rest = images
    first.save(
        content, kind, save_all=True, append_images=rest, duration=durations, loop=0, **options
    )
    return content.getvalue()


def _quantized(
    scene: Scene, frames: Sequence[int], width: int
) -> tuple[Iterator[Image.Image], bytes]:
    """Images that share few colours, which then do not flicker, and these colours."""
    chosen = np.unique(np.linspace(0, len(frames) - 1, SAMPLE).round().astype(int))
    sample = [render_frame(scene, frames[at], width=width) for at in chosen]
    colours = _common_colours(np.concatenate([np.asarray(each) for each in sample]))
    # Pillow looks up the nearest colour for cells, from their darkest corners: with these as
    # colours it finds each exactly
    corners = Image.new("P", (1, 1))
    corners.putpalette((colours - colours % CELL).tobytes())
    palette = colours.tobytes()

    def quantized(frame: int) -> Image.Image:
        whole = render_frame(scene, frame, width=width)
        few = whole.quantize(palette=corners, dither=Image.Dither.NONE)
        few.putpalette(palette)
        return few

    return map(quantized, frames), palette


def _common_colours(pixels: UInt8[np.ndarray, "row column 3"]) -> UInt8[np.ndarray, "colour 3"]:
    """The commonest colours as they are, and those that stand best for others; one for a cell."""
    whole = pixels.reshape(-1, 3).astype(np.uint32) @ (1 << 16, 1 << 8, 1)
    found, counts = np.unique(whole, return_counts=True)
    commonest = found[np.argsort(-counts, kind="stable")[:EXACT], None]
    exact = (commonest >> (16, 8, 0) & 255).astype(np.uint8)
    image = Image.fromarray(pixels).quantize(COLOURS - len(exact), Image.Quantize.MEDIANCUT)
    mixed = np.array(image.getpalette(), np.uint8).reshape(-1, 3)
    colours = np.concatenate([exact, mixed])
    _, first = np.unique(colours // CELL, axis=0, return_index=True)
    return colours[np.sort(first)]


def _mp4(scene: Scene, width: int) -> bytes:
    try:
        from imageio_ffmpeg import get_ffmpeg_exe
    except ImportError as error:
        raise EthogramError(
            "MP4 needs a package that is not installed: pip install 'ethogram[video]'."
        ) from error
    try:
        encoder = get_ffmpeg_exe()
    except RuntimeError as error:
        raise EthogramError(f"MP4 needs ffmpeg: {error}") from error
    images = (render_frame(scene, frame, width=width) for frame in range(len(scene.tint)))
    return _encode(encoder, images, 1 / scene.frame_seconds)


def _encode(encoder: str, images: Iterator[Image.Image], rate: float) -> bytes:
    """What ffmpeg makes of images, so many a second.

    The package's own writer would fork this process, in which JAX may have threads.
    """
    first = next(images)
    size = f"{first.width}x{first.height}"
    given = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", f"{rate:.6f}", "-i", "-")
    made = ("-c:v", "libx264", "-crf", QUALITY, "-pix_fmt", "yuv420p", "-movflags", "+faststart")
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile() as log:
        file = Path(folder) / "video.mp4"
        command = (encoder, "-v", "error", *given, *made, str(file))
        try:
            with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=log) as process:
                assert process.stdin is not None
                for each in itertools.chain([first], images):
                    process.stdin.write(each.tobytes())
        except BrokenPipeError:
            pass  # it ended before it had all: its exit code says so
        if process.returncode:
            log.seek(0)
            reason = log.read().decode(errors="replace").strip() or f"code {process.returncode}"
            raise EthogramError(f"ffmpeg could not make the video: {reason}")
        return file.read_bytes()


FORMATS: dict[str, Callable[[Scene, int], bytes]] = {".gif": _gif, ".webp": _webp, ".mp4": _mp4}
