import json

import numpy as np
import pytest

from ethogram.core.errors import EthogramError
from ethogram.core.scene import Scene, Shape


def scene(**changes):
    parts = {
        "title": "two <b>robots</b>",
        "bounds": (0.0, 0.0, 1.0, 1.0),
        "frame_seconds": 0.1,
        "palette": ("idle", "busy"),
        "shapes": (Shape("circle", 0.1, "1"), Shape("square", 0.2)),
        "links": ((0, 1),),
        "position": np.linspace(0, 1, 12, dtype=np.float32).reshape(3, 2, 2),
        "tint": np.array([[0, 1], [1, -1], [0, 0]]),
        "words": ("hello",),
        "said": np.array([[-1, 0], [0, -1], [-1, -1]]),
        "captions": ("a", "b", "c"),
        "series": {"distance": np.ones((3, 1), np.float32)},
    }
    return Scene(**(parts | changes))


def test_a_scene_comes_back_from_its_dataset_as_it_was():
    before = scene()
    after = Scene.from_dataset(before.to_dataset())
    plain = ("title", "bounds", "frame_seconds", "palette", "shapes", "links", "words", "captions")
    for name in plain:
        assert getattr(after, name) == getattr(before, name)
    for name in ("position", "tint", "said"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    np.testing.assert_array_equal(after.series["distance"], before.series["distance"])


def test_an_array_that_does_not_fit_the_cast_is_named():
    with pytest.raises(EthogramError, match=r"tint is \(3, 1\), not \(3, 2\)"):
        scene(tint=np.zeros((3, 1), int))
    with pytest.raises(EthogramError, match="captions is 1, not 3"):
        scene(captions=("alone",))


def test_a_line_must_join_shapes_of_the_cast():
    with pytest.raises(EthogramError, match=r"a line joins \(0, 2\), but there are only 2 shapes"):
        scene(links=((0, 1), (0, 2)))
    with pytest.raises(EthogramError, match=r"a line joins \(-1, 0\)"):
        scene(links=((-1, 0),))


def test_a_scene_stored_before_there_were_lines_has_none():
    stored = scene(links=()).to_dataset()
    assert "links" not in json.loads(stored.attrs["scene"])  # the same bytes as ever
    assert Scene.from_dataset(stored).links == ()
