import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.core.errors import EthogramError
from ethogram.core.spaces import Box, Discrete, MultiDiscrete, Simplex

PADDED = jnp.array([True, True, False])


@pytest.mark.parametrize(
    ("space", "inside", "outside"),
    [
        (Discrete(3), [0, 2], [-1, 3]),
        (MultiDiscrete((2, 3)), [[0, 0], [1, 2]], [[2, 0], [0, 3], [-1, 1]]),
        (Simplex(2), [[0, 1], [0.25, 0.75]], [[0.5, 0.6], [0.5, 0.4], [1.5, -0.5]]),
        (Simplex(3, PADDED), [[0, 1, 0], [0.5, 0.5, 0]], [[0, 0, 1], [0.5, 0.25, 0.25]]),
        (Box(-1, 2, (2,)), [[-1, 2], [0, 0]], [[-1.5, 0], [0, 2.5], [np.nan, 0]]),
        (Box(-1, 2, (3,), PADDED), [[-1, 2, 0]], [[-1, 2, 1], [-2, 0, 0]]),
        (Box(0, 1, (2, 1)), [[[0.5], [1]]], [[[0.5], [1.5]]]),
    ],
)
def test_a_space_tells_what_is_in_it_along_the_last_axes(space, inside, outside):
    values = jnp.array([inside[0], *inside, *outside])
    found = space.contains(values)
    np.testing.assert_array_equal(found, [True] * (1 + len(inside)) + [False] * len(outside))
    stacked = space.contains(jnp.stack([values, values]))
    np.testing.assert_array_equal(stacked, [found, found])


def test_a_sum_of_weights_may_be_rounded():
    weights = jnp.full(1000, 1 / 1000)
    assert weights.sum() != 1
    assert Simplex(1000).contains(weights)
    assert not Simplex(1000).contains(weights * 1.001)


@pytest.mark.parametrize(
    ("space", "wrong"),
    [
        (Discrete(4), [1.5, 1.0, True, np.nan]),
        (MultiDiscrete((2, 3)), [[0.5, 1.0], [True, True], [0], [0, 1, 1]]),
        (Simplex(2), [[True, False], [1j, 0], [1.0], [1.0, 0.0, 0.0], [np.nan, 1.0]]),
        (Box(-1, 2, (2,)), [[True, True], [0j, 0j], [0.0], [0.0, 0.0, 0.0]]),
        (Box(0, 1, ()), [True, 0j, np.nan]),
    ],
)
def test_another_kind_of_number_or_another_shape_is_in_no_space(space, wrong):
    for value in wrong:
        assert not space.contains(jnp.asarray(value)).any()
        assert not space.contains(jnp.asarray([value, value])).any()


@pytest.mark.parametrize(
    ("space", "given", "taken"),
    [
        (Discrete(3), [-5, 0, 2, 3], [0, 0, 2, 2]),
        (MultiDiscrete((2, 3)), [[-1, 1], [5, 5]], [[0, 1], [1, 2]]),
        (Simplex(2), [[0.25, 0.75], [100.0, 0.0], [-3.0, 0.5]], [[0.25, 0.75], [1, 0], [0, 1]]),
        (Simplex(3, PADDED), [[np.nan] * 3, [-np.inf, 0, np.inf]], [[1, 0, 0], [0, 1, 0]]),
        (
            Box(-1, 2, (3,), PADDED),
            [[-9.0, np.nan, 4.0], [np.inf, 1.0, 0]],
            [[-1, 0, 0], [2, 1, 0]],
        ),
    ],
)
def test_what_is_out_of_a_space_is_taken_for_a_value_in_it(space, given, taken):
    found = space.nearest(jnp.asarray(given))
    np.testing.assert_array_equal(found, taken)
    assert space.contains(found).all()


def test_padding_may_be_chosen_as_by_whoever_is_silenced():
    silence = jnp.array([0.0, 0.0, 1.0])
    np.testing.assert_array_equal(Simplex(3, PADDED).nearest(silence), silence)


SAMPLED = {
    "discrete": Discrete(3),
    "multi-discrete": MultiDiscrete((2, 3)),
    "simplex": Simplex(3, PADDED),
    "box": Box(-1, 2, (3,), PADDED),
    "unbounded box": Box(-np.inf, np.inf, (2,)),
    "bounded below": Box(1.5, np.inf, ()),
    "bounded above": Box(-np.inf, -1.5, ()),
}


@pytest.mark.parametrize("space", SAMPLED.values(), ids=SAMPLED)
def test_what_is_drawn_from_a_space_is_in_it_and_differs(space):
    drawn = space.sample(jax.random.key(0), 5, 20)
    assert drawn.shape == (5, 20, *space.shape)
    assert space.contains(drawn).all()
    assert len(np.unique(drawn.reshape(100, -1), axis=0)) > 1
    assert space.sample(jax.random.key(1)).shape == space.shape


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((1,), 0, 10), r"low = \(1,\); allowed: a number\. The order is Box\(low, high, shape\)"),
        ((0, (1,), 10), r"high = \(1,\); allowed: a number\. The order is"),
        ((0, 10, 1), r"shape = 1; allowed: whole numbers in a tuple\. The order is"),
        ((0, 10, (1.5,)), r"shape = \(1\.5,\); allowed: whole numbers"),
        ((2, 1, (1,)), "low = 2, high = 1; allowed: low up to high"),
        ((np.nan, 1, (1,)), "low = nan, high = 1; allowed: low up to high"),
        ((np.array([0, 2]), 1, (2,)), r"low = \[0 2\], high = 1; allowed: low up to high"),
    ],
)
def test_a_box_says_what_is_wrong_with_its_bounds_and_its_shape(arguments, message):
    with pytest.raises(EthogramError, match=f"Box: {message}"):
        Box(*arguments)


def test_a_bounded_box_is_filled_from_end_to_end():
    drawn = np.asarray(Box(-1, 2, ()).sample(jax.random.key(0), 1000))
    assert drawn.min() < -0.95
    assert drawn.max() > 1.95
    assert abs(drawn.mean() - 0.5) < 0.1
