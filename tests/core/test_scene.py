import json

import numpy as np
import pytest

from ethogram.core.errors import EthogramError
from ethogram.core.scene import Scene, Shape, Tint, grouped, groups_by_trial, tints


def scene(**changes):
    parts = {
        "title": "two <b>robots</b>",
        "bounds": (0.0, 0.0, 1.0, 1.0),
        "frame_seconds": 0.1,
        "palette": tints("idle", "busy"),
        "shapes": (Shape("circle", 0.1, "1"), Shape("square", 0.2)),
        "links": ((0, 1),),
        "position": np.linspace(0, 1, 12, dtype=np.float32).reshape(3, 2, 2),
        "tint": np.array([[0, 1], [1, -1], [0, 0]]),
        "words": ("hello",),
        "said": np.array([[-1, 0], [0, -1], [-1, -1]]),
        "fresh": np.array([[False, False], [True, False], [False, True]]),
        "captions": ("a", "b", "c"),
        "chapters": ("first", "first", "second"),
        "series": {"distance": np.ones((3, 1), np.float32)},
    }
    return Scene(**(parts | changes))


def test_a_scene_comes_back_from_its_dataset_as_it_was():
    before = scene()
    after = Scene.from_dataset(before.to_dataset())
    plain = ("title", "bounds", "frame_seconds", "palette", "shapes", "links", "words")
    for name in (*plain, "captions", "chapters"):
        assert getattr(after, name) == getattr(before, name)
    for name in ("position", "tint", "said", "fresh"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    np.testing.assert_array_equal(after.series["distance"], before.series["distance"])


def test_an_array_that_does_not_fit_the_cast_is_named():
    with pytest.raises(EthogramError, match=r"tint is \(3, 1\), not \(3, 2\)"):
        scene(tint=np.zeros((3, 1), int))
    with pytest.raises(EthogramError, match=r"fresh is \(2, 2\), not \(3, 2\)"):
        scene(fresh=np.zeros((2, 2), bool))
    with pytest.raises(EthogramError, match=r"orientation is \(3, 2, 3\), not \(3, 2, 4\)"):
        scene(orientation=np.zeros((3, 2, 3)))
    for name in ("captions", "chapters"):
        with pytest.raises(EthogramError, match=f"{name} is 1, not 3"):
            scene(**{name: ("alone",)})


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"position": np.zeros((3, 2, 4))}, r"axes \(4,\), not 2 or 3"),
        ({"position": np.zeros((3, 2))}, r"axes \(\), not 2 or 3"),
        ({"bounds": (0.0, 0.0, 1.0)}, "four numbers"),
        ({"bounds": (0.0, 0.0, 1.0, None)}, "bounds holds None"),
        ({"frame_seconds": float("nan")}, "frame_seconds holds nan"),
        ({"frame_seconds": 0.0}, "a time above 0"),
        ({"words": ("hello", 1)}, "words holds what is no text"),
        ({"palette": ("idle", "busy")}, r"palette holds 'idle'; allowed: Tint\(label, '#rrggbb'\)"),
        ({"palette": (Tint("idle", "red"), Tint("busy", "#00ff00"))}, "palette holds Tint"),
        ({"palette": tints("idle")}, "tint holds 1; allowed: -1 .* a palette of 1"),
        ({"series": {"distance": np.ones(3)}}, "distance is"),
    ],
)
def test_what_could_not_be_drawn_is_refused(changes, said):
    with pytest.raises(EthogramError, match=said):
        scene(**changes)


def test_a_line_must_join_shapes_of_the_cast():
    with pytest.raises(
        EthogramError, match=r"a line joins \(0, 2\); allowed: entries of its 2 shapes"
    ):
        scene(links=((0, 1), (0, 2)))
    with pytest.raises(EthogramError, match=r"a line joins \(-1, 0\)"):
        scene(links=((-1, 0),))


def test_a_scene_without_lines_and_chapters_is_stored_as_before_there_were_any():
    stored = scene(links=(), chapters=(), fresh=None).to_dataset()
    assert not {"links", "chapters"} & json.loads(stored.attrs["scene"]).keys()  # the same bytes
    assert "fresh" not in stored
    found = Scene.from_dataset(stored)
    assert (found.links, found.chapters, found.fresh) == ((), (), None)


def test_numbers_that_come_in_few_bits_are_stored_in_these_and_come_back_in_the_usual_types():
    before = scene(
        position=np.array([[[0.5, 1], [0, 0.25]]] * 3, np.float16),
        tint=np.array([[0, 1], [1, -1], [0, 0]], np.int8),
    )
    stored = before.to_dataset()
    assert (stored["position"].dtype, stored["tint"].dtype) == (np.float16, np.int8)
    after = Scene.from_dataset(stored)
    assert (after.position.dtype, after.tint.dtype) == (np.float32, np.int16)
    np.testing.assert_array_equal(after.position, before.position)
    np.testing.assert_array_equal(after.tint, before.tint)
    usual = scene(position=np.zeros((3, 2, 2)), tint=np.zeros((3, 2), int)).to_dataset()
    assert (usual["position"].dtype, usual["tint"].dtype) == (np.float32, np.int16)


def test_scenes_of_trials_are_groups_of_a_record_and_found_there_again():
    titles = ["one", "two", "three"]
    groups = grouped([scene(title=title) for title in titles])
    assert list(groups) == ["scene", "scene-2", "scene-3"]
    found = groups_by_trial(["results", "scene-10", "scenery", "scene-b", *groups])
    assert found == {1: "scene", 2: "scene-2", 3: "scene-3", 10: "scene-10"}
    assert [Scene.from_dataset(groups[found[trial]]).title for trial in (1, 2, 3)] == titles
