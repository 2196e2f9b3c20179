"""Words that shapes say: wherever these are, no two words hide each other or somebody else."""

from itertools import combinations

from hypothesis import given
from hypothesis import strategies as st

from ethogram.report.render.speech import Speaker, place_bubbles

SPEAKERS = st.builds(
    Speaker,
    x=st.floats(0, 400),
    y=st.floats(0, 300),
    radius=st.floats(1, 30),
    width=st.sampled_from([0.0, 20.0, 60.0, 500.0]),
)


@given(st.lists(SPEAKERS, max_size=12))
def test_words_hide_neither_each_other_nor_a_shape(speakers: list[Speaker]) -> None:
    found = place_bubbles(speakers, 400, 300)
    shown = [box for box in found if box is not None]
    assert not any(one.meets(other) for one, other in combinations(shown, 2))
    assert not any(box.meets(speaker.box) for box in shown for speaker in speakers)
    for box in shown:
        assert box.left >= 0
        assert box.top >= 0
        assert box.right <= 400
        assert box.bottom <= 300
    for speaker, box in zip(speakers, found, strict=True):
        assert speaker.width or box is None


def test_ten_in_a_row_on_a_phone_are_all_heard() -> None:
    row = [Speaker(70 + 22 * agent, 210, 8, 60) for agent in range(10)]
    assert None not in place_bubbles(row, 356, 240)


def test_one_alone_is_heard_right_above_itself() -> None:
    (box,) = place_bubbles([Speaker(100, 100, 10, 40)], 400, 300)
    assert box == (80, 71, 120, 87)
