"""Plans: what `--set` changes, and what it says when it cannot."""

import json
from dataclasses import replace

import hypothesis.strategies as st
import pytest
from hypothesis import example, given, settings
from tests.campaign import toy
from tests.campaign.toy import Settings, Walk

from ethogram.campaign.case import Case
from ethogram.campaign.plan import Plan
from ethogram.campaign.settings_json import flatten, from_json, to_json
from ethogram.core.errors import EthogramError, InvalidSettings

SMOKE = toy.PLANS["smoke"]
KEYS = [key for key, _ in flatten(to_json(Settings()))]


def complaint(*assignments):
    with pytest.raises(InvalidSettings) as caught:
        SMOKE.override(assignments)
    return str(caught.value)


def test_points_are_every_combination_with_the_last_axis_fastest():
    plan = Plan("p", "", Settings(), {"letter": ("a", "b"), "walk.steps": (1, 2)})
    assert [(point.letter, point.walk.steps) for point in plan.points()] == [
        ("a", 1),
        ("a", 2),
        ("b", 1),
        ("b", 2),
    ]


def test_a_plan_without_axes_has_one_point():
    assert toy.PLANS["single"].points() == [Settings()]


def test_a_dotted_key_changes_a_nested_setting_at_every_point():
    points = SMOKE.override(["walk.steps=7", "walk.style=straight"]).points()
    assert len(points) == 3
    assert {point.walk for point in points} == {Walk(steps=7, style="straight")}


@pytest.mark.parametrize("text", ["c,a", '["c", "a"]'])
def test_an_axis_takes_a_list(text):
    assert [point.letter for point in SMOKE.override([f"letter={text}"]).points()] == ["c", "a"]


def test_an_axis_takes_a_value_that_was_not_along_it():
    assert [point.letter for point in SMOKE.override(["letter=d"]).points()] == ["d"]


def test_a_value_given_twice_makes_one_point():
    assert len(SMOKE.override(["letter=a,a"]).points()) == 1


@pytest.mark.parametrize("text", ["3,4,5", "[3, 4, 5]"])
def test_a_setting_that_is_a_sequence_takes_a_list(text):
    assert SMOKE.override([f"pauses={text}"]).points()[0].pauses == (3, 4, 5)


def test_a_word_with_a_comma_is_a_word_where_words_are_meant():
    assert SMOKE.override(["label=one, two"]).points()[0].label == "one, two"


def test_an_optional_part_is_begun_by_one_of_its_settings():
    assert SMOKE.override(["detour.steps=3"]).points()[0].detour == Walk(steps=3)


def test_of_two_values_for_a_key_the_last_wins():
    assert SMOKE.override(["chunks=2", "chunks=4"]).points()[0].chunks == 4


def test_an_overridden_plan_remembers_how():
    plan = SMOKE.override(["chunks=2"]).override(["seed=1"])
    assert plan.overrides == ("chunks=2", "seed=1")
    assert plan.points()[0].chunks == 2


def test_an_unknown_key_is_answered_with_the_nearest_and_all_that_there_are():
    message = complaint("steps=3")
    assert "Did you mean 'walk.steps'?" in message
    assert all(key in message for key in KEYS)


def test_a_misspelt_key_is_answered_with_the_nearest():
    assert "Did you mean 'walk.stride'?" in complaint("walk.strid=3")


def test_the_name_of_a_group_is_answered_with_its_members():
    assert complaint("walk=3").endswith("walk.steps, walk.stride, walk.style.")


def test_a_wrong_value_is_named_with_what_is_allowed():
    assert complaint("walk.steps=0").endswith(
        "walk.steps = 0: Input should be greater than or equal to 1."
    )


def test_a_wrong_word_is_answered_with_the_nearest():
    message = complaint("walk.style=strait")
    assert "'straight' or 'winding'" in message
    assert "Did you mean 'straight'?" in message


def test_a_list_where_none_is_taken_is_answered_with_the_axes():
    assert "Only an axis of the plan takes a list (letter)." in complaint("chunks=1,2")


def test_everything_that_is_wrong_is_said_at_once():
    message = complaint("steps=3", "walk.steps=0", "letter=z", "nonsense", "chunks=many")
    for part in ("walk.steps'?", "walk.steps = 0", "letter = 'z'", "'nonsense'", "chunks = 'many'"):
        assert part in message
    assert len(message.splitlines()) == 6


def test_an_axis_cannot_be_empty():
    assert complaint("letter=[]").endswith("letter: An axis needs at least one value.")


@pytest.mark.parametrize("text", ["NaN", "Infinity", "1e999", '"nan"'])
def test_a_number_must_be_finite(text):
    assert "walk.stride" in complaint(f"walk.stride={text}")


values = st.one_of(
    st.text(max_size=10),
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
        max_leaves=5,
    ).map(json.dumps),
    st.sampled_from(["[" * 5000, "9" * 5000, "a,b", "1,2", "\ud800", '"\\ud800"', "{}", "[]"]),
)
assignments = st.one_of(
    st.builds("{}={}".format, st.sampled_from(KEYS), values),
    st.builds("{}={}".format, st.text(max_size=8) | st.sampled_from(["walk", "detour.x"]), values),
    st.text(max_size=20),
)


def test_a_plan_of_several_grids_has_the_points_of_each_once():
    plan = replace(SMOKE, grid={"seed": (1, 2)}, further=({"seed": (2,), "walk.steps": (5, 20)},))
    found = [(point.seed, point.walk.steps) for point in plan.points()]
    steps = SMOKE.settings.walk.steps
    assert found == [(1, steps), (2, steps), *((2, n) for n in (5, 20) if n != steps)]
    assert plan.axes == {"seed": (1, 2), "walk.steps": (5, 20)}


def test_an_axis_of_any_grid_can_be_set_in_all_of_them():
    plan = replace(SMOKE, grid={"seed": (1, 2)}, further=({"seed": (2,), "walk.steps": (5, 20)},))
    points = plan.override(["walk.steps=7,8", "seed=3"]).points()
    assert [(point.seed, point.walk.steps) for point in points] == [(3, 7), (3, 8)]


def test_an_axis_of_one_grid_leaves_the_others_as_they_were():
    plan = replace(SMOKE, grid={"seed": (7,)}, further=({"walk.steps": (5,)},))
    seed = SMOKE.settings.seed
    assert [point.seed for point in plan.override([]).points()] == [7, seed]


@settings(max_examples=300)
@given(st.lists(assignments, max_size=4))
@example(["detour={}"])
@example(["label=" + "[" * 99])
def test_whatever_is_typed_gives_points_or_one_clear_error(typed):
    try:
        points = SMOKE.override(typed).points()
    except EthogramError:
        return
    assert all(isinstance(point, Settings) for point in points)


@given(st.builds(Settings, seed=st.integers(0, 2**32 - 1), label=st.text(), walk=st.builds(Walk)))
def test_settings_come_back_from_their_tree(point):
    assert from_json(Settings, to_json(point)) == point


def test_the_identity_of_a_case_covers_all_that_its_numbers_depend_on():
    case = Case.of(study="toy", version="1", name="a", settings=Settings())
    others = [
        Case.of(study="yot", version="1", name="a", settings=Settings()),
        Case.of(study="toy", version="2", name="a", settings=Settings()),
        Case.of(study="toy", version="1", name="b", settings=Settings()),
        Case.of(study="toy", version="1", name="a", settings=Settings(walk=Walk(steps=21))),
    ]
    assert len({case.id, *(other.id for other in others)}) == 5
    assert Case.of(study="toy", version="1", name="a", settings=Settings()).id == case.id
    assert case.parsed(Settings) == Settings()


def test_settings_of_a_case_that_do_not_fit_are_named():
    case = Case("toy", "1", "a", {"walk": {"steps": 3, "sidesteps": 1}})
    with pytest.raises(InvalidSettings, match=r"walk\.sidesteps"):
        case.parsed(Settings)
