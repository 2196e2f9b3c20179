"""What the player is given: numbers as exact as their own range allows, within a page's size."""

import base64
import gzip
import json

import numpy as np
import pytest
from tests.report.player import FRAMES, crossing, driving

from ethogram.core.errors import EthogramError
from ethogram.core.scene import Shape
from ethogram.report import Replay, page_bytes
from ethogram.report.replay import NAN_CODE, STEPS, encode_replays, subsample


def decoded(stored: dict[str, str], frames: int) -> np.ndarray:
    """Numbers per frame, as the player reads them."""
    steps = np.frombuffer(gzip.decompress(base64.b64decode(stored["data"])), "<i2")
    at = np.cumsum(steps.reshape(frames, -1), axis=0, dtype=np.int16)
    low, step = np.frombuffer(base64.b64decode(stored["ranges"]), "<f4").reshape(2, -1)
    return np.where(at == NAN_CODE, np.nan, low + (at.astype(int) + STEPS // 2) * step)


def of_two(far: float) -> np.ndarray:
    """A shape that crosses the field, and one that leaps far away once."""
    near = crossing().position
    other = np.full_like(near, 4.0)
    other[7] = far
    return np.concatenate([near, other], 1)


@pytest.mark.parametrize("far", [1e3, -1e9, 3e38, np.nan, np.inf])
def test_a_shape_far_away_takes_no_precision_from_the_others(far: float) -> None:
    cast = {"shapes": (Shape("circle", 0.8),) * 2, "tint": np.zeros((FRAMES, 2), int)}
    position = of_two(far)
    text = encode_replays([Replay(name="case", scene=crossing(position=position, **cast))])
    seen = decoded(json.loads(text)[0]["arrays"]["position"], FRAMES).reshape(FRAMES, 2, 2)
    np.testing.assert_allclose(seen[:, 0], position[:, 0], atol=14 / STEPS)
    if np.isfinite(far):
        np.testing.assert_allclose(seen[7, 1], far, rtol=1e-4)
    else:
        assert np.isnan(seen[7, 1]).all()


def test_a_vertex_far_away_takes_no_precision_from_the_others_and_padding_is_no_number() -> None:
    scene = driving()
    assert scene.vertices is not None
    form = scene.vertices.copy()
    form[7, 1, 2, 0] = 1e9
    (plain,) = json.loads(encode_replays([Replay(name="case", scene=driving(vertices=form))]))
    seen = decoded(plain["arrays"]["vertices"], FRAMES).reshape(form.shape)
    np.testing.assert_array_equal(np.isnan(seen), np.isnan(form))
    near = np.delete(seen[:, 1, :4].reshape(FRAMES, 8), 4, 1)
    wanted = np.delete(form[:, 1, :4].reshape(FRAMES, 8), 4, 1)
    np.testing.assert_allclose(near, wanted, atol=2 / STEPS)
    assert plain["vertices"] == form.shape[2]
    assert plain["background"] == [["line", [[0.0, 6.0], [16.0, 6.0]], 2, 2.0]]


def test_a_shape_of_which_nothing_can_be_drawn_is_hidden() -> None:
    scene = driving()
    assert scene.vertices is not None
    form, position = scene.vertices.copy(), scene.position.copy()
    form[3, 1, 2:] = np.nan  # two vertices are left
    position[5, 0, 1] = np.inf
    lost = driving(vertices=form, position=position)
    (plain,) = json.loads(encode_replays([Replay(name="case", scene=lost)]))
    steps = np.frombuffer(gzip.decompress(base64.b64decode(plain["arrays"]["tint"]["data"])), "<i2")
    tint = np.cumsum(steps.reshape(FRAMES, 2), axis=0)
    hidden = [tuple(each) for each in np.argwhere(tint < 0)]
    assert hidden == [(3, 1), (5, 0)]


def test_what_does_not_fit_loses_frames_evenly_and_what_does_keeps_them_all() -> None:
    rng = np.random.default_rng(1)
    long = crossing(
        position=rng.normal(size=(5000, 1, 2)), tint=np.zeros((5000, 1), int),
        captions=("",) * 5000, series={},
    )  # fmt: skip
    replays = [Replay(name="long", scene=long), Replay(name="short", scene=crossing())]
    whole = encode_replays(replays)
    text = encode_replays(replays, room=len(whole) // 3)
    assert len(text) <= len(whole) // 3
    first, second = json.loads(text)
    frames, step = first["thinned"]
    assert (frames, first["frames"]) == (5000, len(range(0, 5000, step)))
    assert first["seconds"] == pytest.approx(long.frame_seconds * step)
    assert "thinned" not in second
    assert second["frames"] == FRAMES
    assert encode_replays(replays, room=len(whole)) == whole


def test_where_not_one_frame_fits_the_page_says_so_in_its_place() -> None:
    (plain,) = json.loads(encode_replays([Replay(name="case", scene=crossing())], room=100))
    assert plain["error"] == "even a single frame needs more room than this page has for it"


@pytest.mark.parametrize("step", [2, 3, 7, FRAMES, 100])
def test_what_was_anew_in_a_frame_left_out_is_anew_in_the_next_one_shown(step: int) -> None:
    fresh = np.zeros((FRAMES, 1), bool)
    fresh[[0, 5, 20]] = True
    thin = subsample(crossing(fresh=fresh), step)
    assert thin.fresh is not None
    since = [0, *range(1, FRAMES, step)]  # of each frame shown, the first one after the last shown
    shown = range(0, FRAMES, step)
    wanted = [fresh[first : last + 1].any() for first, last in zip(since, shown, strict=False)]
    assert thin.fresh[:, 0].tolist() == wanted
    assert thin.captions == tuple(f"frame {frame}" for frame in shown)


@pytest.mark.parametrize("megabytes", [0.0, -1.0, np.nan, np.inf])
def test_a_page_without_a_size_is_refused(megabytes: float) -> None:
    with pytest.raises(EthogramError, match="allowed: a number above 0"):
        page_bytes(megabytes)
