import json

import numpy as np
import pytest

from ethogram.core.errors import EthogramError
from ethogram.core.recorded import grouped, groups_by_trial
from ethogram.core.scene import COLOURS, GRADED_COLOURS, BackgroundShape, Scene, Shape, Tint, tints


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


TRIANGLE = ((1.0, 0.0), (-1.0, 0.5), (-1.0, -0.5))


def plane(**changes):
    """A polygon that keeps its form, one that does not, and a road under them."""
    form = np.zeros((3, 2, 4, 2), np.float32)
    form[:, 0] = np.nan
    parts = {
        "shapes": (Shape("polygon", 2.0, "car", TRIANGLE), Shape("polygon", 0.1)),
        "palette": (Tint("idle", COLOURS["green"]), Tint("road", "#123abc")),
        "background": (
            BackgroundShape("line", ((0.0, 0.0), (1.0, 0.5)), 1, 0.2),
            BackgroundShape("polygon", TRIANGLE, 1),
        ),
        "heading": np.linspace(0, 3, 6, dtype=np.float32).reshape(3, 2),
        "vertices": form,
    }
    return scene(**(parts | changes))


def test_polygons_background_and_colours_come_back_from_their_dataset():
    before = plane()
    after = Scene.from_dataset(before.to_dataset())
    for name in ("shapes", "background", "palette"):
        assert getattr(after, name) == getattr(before, name)
    for name in ("heading", "vertices"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))


def test_a_palette_in_the_default_colours_is_stored_as_before_palettes_had_any():
    flat = scene(palette=tints("idle", "busy"))
    space = {
        "position": np.zeros((3, 2, 3)),
        "scale": np.ones((3, 2)),
        "shapes": (Shape("cube", 1.0),) * 2,
    }
    graded = tuple(map(Tint, ("less", "as at rest", "more"), GRADED_COLOURS))
    for before in (flat, scene(palette=graded, **space)):
        stored = before.to_dataset()
        plain = json.loads(stored.attrs["scene"])
        assert plain["palette"] == [tint.label for tint in before.palette]
        assert not {"colours", "background"} & plain.keys()
        assert Scene.from_dataset(stored).palette == before.palette
    assert scene(palette=graded, **space).graded
    assert not scene(palette=graded[:2], **space).graded
    assert not flat.graded


def test_what_cannot_be_drawn_of_a_polygon_is_hidden_and_nothing_else():
    form = np.full((3, 2, 4, 2), np.nan)
    form[0, 1], form[1, 1, :3], form[2, 1, :2] = 0.0, 0.0, 0.0
    shown = plane(vertices=form, tint=np.zeros((3, 2), int)).visible()
    np.testing.assert_array_equal(shown, [[True, True], [True, True], [True, False]])
    lost = np.array([[0.0, np.nan], [np.inf, 0.0], [0.0, 0.0]])
    found = plane(heading=lost, tint=np.zeros((3, 2), int))
    np.testing.assert_array_equal(found.visible(), [[True, False], [False, True], [True, True]])
    np.testing.assert_array_equal(found.visible(1), [False, True])
    circles = scene(heading=lost, tint=np.zeros((3, 2), int))
    assert circles.visible().all()


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: Shape("blob", 1.0), "A shape is of kind 'blob'; allowed: circle, square"),
        (lambda: Shape("circle", float("inf")), "size inf; allowed: a finite number"),
        (lambda: Shape("circle", 1.0, "", TRIANGLE), "A circle has vertices"),
        (lambda: Shape("polygon", 1.0, "", TRIANGLE[:2]), "allowed: a tuple of 3 or more pairs"),
        (lambda: Shape("polygon", 1.0, "", np.zeros((4, 2))), "allowed: a tuple of 3 or more"),
        (lambda: Shape("polygon", 1.0, "", ((0, 0), (1, 0), (1, np.nan))), "of finite numbers"),
        (lambda: BackgroundShape("line", ((0, 0),), 0), "A line has vertices .* 2 or more"),
        (lambda: BackgroundShape("circle", TRIANGLE, 0), "allowed: line, polygon"),
        (lambda: BackgroundShape("line", TRIANGLE, 0, -1.0), "width -1.0; allowed: 0 or more"),
        (lambda: plane(vertices=None), "a polygon has vertices"),
        (lambda: plane(vertices=np.zeros((3, 2, 4))), r"vertices has shape \(3, 2, 4\); allowed"),
        (lambda: plane(heading=np.zeros((3, 1))), r"heading has shape \(3, 1\); allowed: \(3, 2\)"),
        (
            lambda: plane(background=(BackgroundShape("polygon", TRIANGLE, 2),)),
            "background has tint 2; allowed: entries of a palette of 2",
        ),
        (lambda: plane(position=np.zeros((3, 2, 3))), "in space there is a 'polygon'; allowed"),
        (
            lambda: scene(position=np.zeros((3, 2, 3)), heading=np.zeros((3, 2))),
            "in space there is a 'heading'",
        ),
    ],
)
def test_what_is_no_shape_is_refused_with_what_is_allowed(made, said):
    with pytest.raises(EthogramError, match=said):
        made()


def test_an_array_that_does_not_fit_the_cast_is_named():
    with pytest.raises(
        EthogramError, match=r"tint has shape \(3, 1\); allowed: \(3, 2\), of 3 frames"
    ):
        scene(tint=np.zeros((3, 1), int))
    with pytest.raises(EthogramError, match=r"fresh has shape \(2, 2\); allowed: \(3, 2\)"):
        scene(fresh=np.zeros((2, 2), bool))
    with pytest.raises(
        EthogramError, match=r"orientation has shape \(3, 2, 3\); allowed: \(3, 2, 4\)"
    ):
        scene(orientation=np.zeros((3, 2, 3)))
    for name in ("captions", "chapters"):
        with pytest.raises(EthogramError, match=f"{name} has as many entries as 1; allowed: 3"):
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


def test_a_scene_without_frames_is_refused():
    with pytest.raises(EthogramError, match=r"frames 0; allowed: one or more"):
        scene(position=np.zeros((0, 2, 2)), tint=np.zeros((0, 2), int), captions=(), series={})


def test_a_scene_may_have_fewer_frames_at_the_same_speed():
    frames, cast = 5, 2
    fresh = np.zeros((frames, cast), bool)
    fresh[1, 0] = fresh[4, 1] = True
    scene = Scene(
        title="Walk",
        bounds=(0, 0, 1, 1),
        frame_seconds=0.5,
        palette=tints("one"),
        shapes=(Shape("circle", 0.1),) * cast,
        position=np.arange(frames * cast * 2.0).reshape(frames, cast, 2),
        tint=np.zeros((frames, cast), int),
        fresh=fresh,
        captions=tuple("abcde"),
        series={"way": np.arange(5.0)[:, None]},
    )
    fewer = scene.every(2)
    assert (fewer.frame_seconds, fewer.captions) == (1.0, ("a", "c", "e"))
    np.testing.assert_array_equal(fewer.position, scene.position[::2])
    np.testing.assert_array_equal(fewer.series["way"][:, 0], [0, 2, 4])
    np.testing.assert_array_equal(fewer.fresh, [[0, 0], [1, 0], [0, 1]])
    np.testing.assert_array_equal(scene.every(9).fresh, [[0, 0]])
