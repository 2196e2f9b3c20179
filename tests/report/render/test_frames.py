"""Single frames: what the scene says is where it says, whatever it says."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.report.player import (
    BLUE,
    FRAMES,
    HEIGHT,
    HOSTILE,
    RED,
    WIDTH,
    centre,
    crossing,
    driving,
    extent,
)

from ethogram.core.errors import EthogramError
from ethogram.core.scene import (
    COLOURS,
    DEFAULT_COLOURS,
    GRADED_COLOURS,
    Scene,
    Shape,
    Tint,
    tints,
)
from ethogram.report.render.canvas import Canvas, letter_colour, text_width, truncate
from ethogram.report.render.frames import CHART, LINE, MARGIN, render_frame, render_svg
from ethogram.report.replay import subsample

WIDE = 320
GRADED = tuple(map(Tint, ("contracted", "at rest", "expanded"), GRADED_COLOURS))
GREY = (189, 186, 177)  # of a voxel at rest
TEXTS = (
    HOSTILE,
    "",
    "\n\r\n",
    "two\nlines",
    "\ud800 alone \udfff",
    "\x00\x1b[31m",
    "🤖👩‍👩‍👧 e\u0301\u0301\u0301",
    "שלום مرحبا",
    "x" * 10_000,
)


def stage(scene: Scene, frame: int, width: int = WIDE) -> np.ndarray:
    """The pixels of the scene itself, without what is written around it."""
    pixels = np.asarray(render_frame(scene, frame, width=width)).astype(int)
    left, bottom, right, top = scene.bounds
    space = scene.position.shape[2] == 3
    ratio = 16 / 9 if space else (right - left) / (top - bottom)
    across = width - 2 * MARGIN
    top_edge = MARGIN + LINE
    return pixels[top_edge : top_edge + round(across / ratio), MARGIN : MARGIN + across]


def where(pixels: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Row and column of every pixel of a colour."""
    return np.argwhere(np.abs(pixels - colour).max(2) < 12)


def bodies(*places: tuple[float, float, float], **changes) -> Scene:
    """One frame with cubes of one centimetre, at rest unless a scale says otherwise."""
    cast = len(places)
    settings = {
        "title": "bodies",
        "bounds": (-1.0, 0.0, 1.0, 1.0),
        "frame_seconds": 0.05,
        "palette": GRADED,
        "shapes": (Shape("cube", 0.005),) * cast,
        "position": np.array([places], float),
        "scale": np.ones((1, cast)),
        "tint": np.ones((1, cast), int),
        "captions": ("now",),
    }
    return Scene(**(settings | changes))


def middle(scene: Scene) -> np.ndarray:
    """The colour in the middle of the stage, at which the eye looks."""
    pixels = stage(scene, 0)
    return pixels[pixels.shape[0] // 2, pixels.shape[1] // 2]


@pytest.mark.parametrize(("frame", "colour"), [(0, BLUE), (13, BLUE), (30, RED), (40, RED)])
def test_a_disc_is_where_the_scene_says(frame: int, colour: tuple[int, int, int]) -> None:
    scene = crossing()
    pixels = stage(scene, frame, width=640)
    y, x = where(pixels, colour).mean(0)
    across, up = scene.position[frame, 0]
    found = x / pixels.shape[1], y / pixels.shape[0]
    np.testing.assert_allclose(found, (across / WIDTH, 1 - up / HEIGHT), atol=0.004)
    # a disc of radius 0.8 in a field of 16 to 9 has 1.4 % of its area
    share = len(where(pixels, colour)) / pixels[..., 0].size
    assert share == pytest.approx(np.pi * 0.8**2 / (WIDTH * HEIGHT), rel=0.05)


@pytest.mark.parametrize("kind", ["circle", "square", "ring", "text"])
def test_what_is_hidden_is_not_drawn_nor_are_its_lines_labels_and_words(kind: str) -> None:
    changes = {
        "shapes": (Shape(kind, 0.8, "seen"), Shape("circle", 0.1)),
        "position": np.tile([[4.0, 4.0], [7.0, 7.0]], (FRAMES, 1, 1)),
        "links": ((0, 1),),
        "words": ("hello",),
        "said": np.zeros((FRAMES, 2), int),
    }
    nothing = stage(crossing(tint=np.full((FRAMES, 2), -1), **changes), 0)
    assert (nothing[2:-2, 2:-2] == 255).all()
    assert (stage(crossing(tint=np.zeros((FRAMES, 2), int), **changes), 0) != nothing).any()


def test_squares_are_of_their_legends_colour_and_rings_are_empty() -> None:
    square, ring = (
        stage(crossing(shapes=(Shape(kind, 2.0),), position=np.full((FRAMES, 1, 2), 4.5)), 0)
        for kind in ("square", "ring")
    )
    inside = round(square.shape[0] / 2) + 5, round(square.shape[1] * 4.5 / WIDTH)
    np.testing.assert_array_equal(square[inside], BLUE)
    np.testing.assert_array_equal(ring[inside], 255)
    assert len(where(ring, BLUE)) > 0


@pytest.mark.parametrize(("frame", "wide", "high"), [(0, 3, 1), (FRAMES - 1, 1, 3)])
def test_a_polygon_is_where_it_is_and_turned_by_its_heading(
    frame: int, wide: float, high: float
) -> None:
    pixels = stage(driving(), frame, width=640)
    assert centre(pixels, BLUE) == pytest.approx((4 / WIDTH, 1 - 6 / HEIGHT), abs=0.01)
    assert extent(pixels, BLUE) == pytest.approx((wide, high), abs=0.15)


def test_a_polygon_turns_from_the_x_axis_towards_the_y_axis() -> None:
    heading = np.full((FRAMES, 2), np.pi / 4)
    rows, columns = where(stage(driving(heading=heading), 0, width=640), BLUE).T
    assert np.corrcoef(rows, columns)[0, 1] < -0.5  # up to the right


def test_a_polygon_takes_the_form_of_the_frame_in_the_size_that_it_has() -> None:
    form = [extent(stage(driving(), frame, width=640), RED) for frame in (0, 20, FRAMES - 1)]
    np.testing.assert_allclose(form, [(3, 3), (3, 1.8), (3, 0.6)], atol=0.15)
    half = driving(scale=np.full((FRAMES, 2), 0.5))
    assert extent(stage(half, 0, width=640), RED) == pytest.approx((1.5, 1.5), abs=0.15)


def test_a_background_lies_under_everything_in_the_colour_of_its_tint() -> None:
    pixels = stage(driving(), 0, width=640)
    scale = pixels.shape[1] / WIDTH
    row = pixels[round((HEIGHT - 6) * scale)]
    assert tuple(row[round(4 * scale)]) == BLUE
    assert tuple(row[round(9 * scale)]) == GREY
    lane = pixels[:, round(9 * scale)]
    assert (lane == GREY).all(1).sum() == pytest.approx(2 * scale, abs=2)
    bare = stage(driving(background=()), 0, width=640)
    assert (bare[round((HEIGHT - 6) * scale), round(9 * scale)] == 255).all()


def test_the_drawing_of_a_frame_has_its_polygons_and_its_background() -> None:
    scene = driving()
    for frame in (0, 20):
        drawn = render_svg(scene, frame)
        road, body = drawn.index('stroke="#bdbab1"'), drawn.index('fill="#d55e00"')
        assert drawn.index('fill="#0072b2"') > road
        assert body > road
        assert not re.search(r"\bnan\b", drawn)
    assert render_svg(scene, 0) != render_svg(scene, 20)


@pytest.mark.parametrize("kind", ["circle", "ring", "square"])
def test_any_other_shape_has_a_mark_in_the_direction_of_its_heading(kind: str) -> None:
    angle = np.linspace(0, 1.5 * np.pi, FRAMES)[:, None]
    position = np.full((FRAMES, 1, 2), 4.5)
    cast = {"shapes": (Shape(kind, 1.0),), "position": position, "tint": np.zeros((FRAMES, 1), int)}
    plain = stage(crossing(**cast), 0, width=640)
    scene = crossing(heading=angle, **cast)
    for frame, (across, up) in ((0, (1, 0)), (FRAMES - 1, (0, -1))):
        marked = np.argwhere((stage(scene, frame, width=640) != plain).any(2))
        y, x = marked.mean(0) * WIDTH / plain.shape[1]
        assert (x - 4.5, HEIGHT - 4.5 - y) == pytest.approx((1.25 * across, 1.25 * up), abs=0.2)
    lost = crossing(heading=np.full((FRAMES, 1), np.nan), **cast)
    np.testing.assert_array_equal(stage(lost, 0, width=640), plain)


def test_a_single_frame_has_no_chart_and_else_all_that_the_first_of_many_has() -> None:
    many = driving(series={"way": np.zeros((FRAMES, 1))})
    one = subsample(many, FRAMES)
    assert len(one.tint) == 1
    first, alone = (np.asarray(render_frame(scene, 0, width=WIDE)) for scene in (many, one))
    assert len(first) - len(alone) == CHART
    np.testing.assert_array_equal(stage(many, 0), stage(one, 0))
    assert render_svg(one, 0) == render_svg(many, 0)


def test_letters_on_a_colour_can_be_read() -> None:
    assert {letter_colour(colour) for colour in DEFAULT_COLOURS} == {"#ffffff"}
    assert letter_colour(COLOURS["silver"]) == letter_colour("#ffff00") == "#1d1d1b"


def test_lines_to_words_do_not_cross_the_numbers_of_those_above() -> None:
    def crowd(words: tuple[str, ...]) -> np.ndarray:
        """A column of three of which the lowest one speaks, with no room beside it."""
        y = np.array([0.5, 1.5, 2.5, 0.5, 0.5])
        x = np.array([8.0, 8.0, 8.0, 7.0, 9.0])
        return stage(
            crossing(
                shapes=tuple(Shape("circle", 0.45, str(agent)) for agent in range(5)),
                position=np.tile(np.stack([x, y], 1), (FRAMES, 1, 1)),
                tint=np.zeros((FRAMES, 5), int),
                words=words,
                said=np.tile([0, -1, -1, -1, -1], (FRAMES, 1)),
            ),
            0,
            width=640,
        )

    quiet, loud = crowd(("",)), crowd(("a rather long thing to say at all",))
    scale = quiet.shape[1] / WIDTH
    changed = (quiet != loud).any(2)
    gap = round((HEIGHT - 1.97) * scale) - 1, round(8 * scale)
    assert changed[gap[0] - 2 : gap[0] + 3, gap[1] - 2 : gap[1] + 3].any()  # there is a line
    for y in (1.5, 2.5):
        middle = round((HEIGHT - y) * scale), round(8 * scale)
        near = tuple(slice(at - 8, at + 8) for at in middle)
        assert not changed[near].any()


def test_a_scene_that_is_not_finite_somewhere_shows_the_rest() -> None:
    position = np.full((FRAMES, 2, 2), 4.0)
    position[:, 1] = (np.nan, np.inf)
    shapes = (Shape("circle", 0.8), Shape("circle", 0.8, "lost"))
    tint = np.zeros((FRAMES, 2), int)
    series = {"way": np.full((FRAMES, 1), np.nan)}
    seen = stage(crossing(position=position, shapes=shapes, tint=tint, series=series), 0)
    alone = stage(crossing(position=position[:, :1], shapes=shapes[:1], tint=tint[:, :1]), 0)
    np.testing.assert_array_equal(seen, alone)
    lost = bodies((0, 0, 0.005), (np.nan, 0, 0))
    np.testing.assert_array_equal(stage(lost, 0), stage(bodies((0, 0, 0.005)), 0))


@pytest.mark.parametrize(
    "scene",
    [
        crossing(bounds=(0.0, 0.0, 0.0, 0.0)),
        crossing(shapes=(Shape("square", 1e12),)),
        crossing(scale=np.full((FRAMES, 1), np.nan)),
        crossing(words=("hello",), said=np.full((FRAMES, 1), 7)),
        crossing(series={"far": np.linspace(-1e300, 1e300, FRAMES)[:, None]}),
        bodies((0, 0, 0), orientation=np.full((1, 1, 4), np.nan)),
        bodies((0, 0, -5), scale=None),
        bodies((1e9, 0, 0), (0, 0, 0)),
    ],
)
def test_odd_scenes_are_drawn_at_once_and_without_an_error(scene: Scene) -> None:
    assert render_frame(scene, 0, width=WIDE).width == WIDE


def test_all_frames_of_a_scene_have_the_same_even_size() -> None:
    for scene in (crossing(), crossing(series={}, palette=tints("", ""), bounds=(0, 0, 1, 7))):
        sizes = {render_frame(scene, frame, width=317).size for frame in (0, 20, 40)}
        assert len(sizes) == 1
        (width, height) = sizes.pop()
        assert (width, height % 2) == (316, 0)


def test_the_mark_in_the_chart_moves_with_the_frames() -> None:
    top = MARGIN + LINE + len(stage(crossing(), 0)) + LINE + 4

    def mark(frame: int) -> int:
        chart = np.asarray(render_frame(crossing(), frame, width=WIDE))[top : top + CHART]
        return int(chart.astype(int).sum((0, 2)).argmin())  # the darkest column

    first, half, last = map(mark, (0, 20, 40))
    assert last == pytest.approx(WIDE - MARGIN - 6, abs=1)
    assert half == pytest.approx((first + last) / 2, abs=1)
    assert first < WIDE / 4


def test_a_cube_that_moves_in_x_moves_in_the_frame() -> None:
    scales = {"scale": np.array([[0.8, 1.2]])}
    apart = [bodies((0, 0, 0.005), (x, 0, 0.005), **scales) for x in (0.02, 0.04)]
    whole = Scene(
        **{
            **vars(apart[0]),
            "position": np.concatenate([scene.position for scene in apart]),
            "tint": np.ones((2, 2), int),
            "scale": np.repeat(scales["scale"], 2, 0),
            "captions": ("near", "far"),
        }
    )

    def gap(frame: int) -> float:
        pixels = stage(whole, frame)
        blue, red = (pixels[..., channel] - pixels[..., 2 - channel] > 60 for channel in (2, 0))
        return np.argwhere(red)[:, 1].mean() - np.argwhere(blue)[:, 1].mean()

    # the eye goes along with the centre, and sees twice the distance about twice as wide
    assert 1.7 < gap(1) / gap(0) < 2.3


def test_the_eye_goes_along_with_a_robot_over_a_floor_that_moves() -> None:
    alone = bodies((0, 0, 0.005))
    whole = Scene(
        **{
            **vars(alone),
            "position": np.array([[[0, 0, 0.005]], [[0.033, 0, 0.005]]]),
            "tint": np.ones((2, 1), int),
            "scale": np.ones((2, 1)),
            "captions": ("now", "now"),
        }
    )
    first, second = stage(whole, 0), stage(whole, 1)
    high, wide = (size // 2 for size in first.shape[:2])
    body = slice(high - 10, high + 5), slice(wide - 10, wide + 10)
    np.testing.assert_array_equal(first[body], second[body])
    assert (first != second).any()


def test_contracted_voxels_are_bluer_and_expanded_ones_redder_until_a_tenth() -> None:
    scales = (0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.3)
    seen = [middle(bodies((0, 0, 0.005), scale=np.array([[scale]]))) for scale in scales]
    red_less_blue = [int(red) - int(blue) for red, _, blue in seen]
    assert red_less_blue == sorted(red_less_blue)
    assert red_less_blue[0] == red_less_blue[1] < red_less_blue[2] < red_less_blue[3] - 30
    assert red_less_blue[3] + 30 < red_less_blue[4] < red_less_blue[5] == red_less_blue[6]


def test_faces_are_lighter_the_more_they_look_up() -> None:
    pixels = stage(bodies((0, 0, 0.005)), 0)
    column = pixels[:, pixels.shape[1] // 2, 0]
    top, front = (column == GREY[0]).nonzero()[0], (np.abs(column - 150) < 15).nonzero()[0]
    assert front.size > top.size > 5
    assert np.median(top) < np.median(front)


def test_the_nearer_cube_hides_the_other_whatever_their_order() -> None:
    near, far = (0.0, -0.008, 0.005), (0.0, 0.004, 0.005)
    scales = np.array([[0.9, 1.1]])
    one = stage(bodies(near, far, scale=scales), 0)
    other = stage(bodies(far, near, scale=scales[:, ::-1]), 0)
    np.testing.assert_array_equal(one, other)
    high, wide = one.shape[0] // 2, one.shape[1] // 2
    assert one[high + 15, wide, 2] > one[high + 15, wide, 0] + 60


def test_a_cube_turned_by_a_right_angle_looks_as_before_and_by_half_of_it_does_not() -> None:
    def turned(angle: float) -> np.ndarray:
        quaternion = (np.cos(angle / 2), 0, np.sin(angle / 2), 0)  # about y
        changes = {"orientation": np.array([[quaternion]]), "scale": np.full((1, 1), 1.1)}
        return stage(bodies((0, 0, 0.007), **changes), 0)

    still, half, right = (turned(angle) for angle in (0.0, np.pi / 4, np.pi / 2))
    assert (np.abs(still - right).max(2) > 40).mean() < 0.001
    assert (np.abs(still - half).max(2) > 40).mean() > 0.01

    def tall(pixels: np.ndarray) -> int:
        return int(np.ptp(np.argwhere(pixels[..., 0] - pixels[..., 2] > 60)[:, 0]))

    assert tall(half) > 1.1 * tall(still)


def test_hidden_cubes_are_not_drawn() -> None:
    hidden = stage(bodies((0, 0, 0.005), tint=np.full((1, 1), -1)), 0)
    assert middle(bodies((0, 0, 0.005)))[0] < 200
    assert hidden.mean() > 240
    nobody = bodies(position=np.zeros((1, 0, 3)))
    assert stage(nobody, 0).mean() > 240


@pytest.mark.parametrize("text", TEXTS, ids=ascii)
def test_any_text_is_drawn_and_stays_on_the_paper(text: str) -> None:
    scene = crossing(
        title=text,
        palette=tints(text, text),
        captions=(text,) * FRAMES,
        shapes=(Shape("circle", 0.8, text),),
        words=(text,),
        said=np.zeros((FRAMES, 1), int),
        series={text: np.zeros((FRAMES, 1)), text + "2": np.zeros((FRAMES, 2))},
    )
    sizes = {render_frame(each, 0, width=WIDE).size for each in (scene, crossing(title=text))}
    assert {width for width, _ in sizes} == {WIDE}
    cubes = bodies(
        (0, 0, 0), shapes=(Shape("cube", 0.005, text),), words=(text,), said=np.zeros((1, 1), int)
    )
    assert render_frame(cubes, 0, width=WIDE).width == WIDE


@given(text=st.text(st.characters(), max_size=60), room=st.floats(20, 300))
def test_a_text_is_cut_to_its_room_and_only_then(text: str, room: float) -> None:
    shown = truncate(text, 12.0, room)
    assert text_width(shown, 12.0) <= room
    assert shown.endswith("…") or text_width(text, 12.0) <= room
    Canvas(20, 20).text((10, 10), text, 12.0, "#000000", halo=True)


def test_there_is_a_clear_error_where_nothing_can_be_drawn() -> None:
    for frame in (-1, FRAMES):
        with pytest.raises(EthogramError, match=f"'crossing' has no frame {frame}"):
            render_frame(crossing(), frame)
    with pytest.raises(EthogramError, match="20 pixels wide is too narrow: 100 or more"):
        render_frame(crossing(), 0, width=20)


def test_a_series_that_would_be_flat_has_a_scale_of_its_own(monkeypatch):
    written = []
    monkeypatch.setattr(Canvas, "text", lambda canvas, at, words, *_, **__: written.append(words))
    ramp = np.linspace(0, 1, FRAMES)[:, None]
    series = {"way": 28_000 * ramp, "hits": 490 * np.hstack([ramp, ramp]), "level": 0 * ramp}
    render_frame(crossing(series=series), 0)
    assert {"way", "hits 1 (right)", "hits 2 (right)", "level", "2.8e+04", "490"} <= set(written)
    written.clear()
    render_frame(crossing(series={"way": 28 * ramp, "hits": 2 * ramp}), 0)
    assert {"way", "hits", "28"} <= set(written)
    assert "2" not in written
