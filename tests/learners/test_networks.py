import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.core.spaces import Box, Discrete, MultiDiscrete, Simplex
from ethogram.core.world import Role
from ethogram.learners.critic_input import (
    critic_input,
    encode_actions,
    encode_observations,
    own_action,
    used_inputs,
)
from ethogram.learners.networks import MLP, features, orthogonal, used_features

ALL = jnp.ones


def test_layers_are_rectified_but_for_the_last():
    network = MLP(
        weights=(jnp.array([[1.0, -1.0], [2.0, 0.0]]), jnp.array([[3.0], [-1.0]])),
        biases=(jnp.array([0.5, 0.0]), jnp.array([-2.0])),
    )
    x = jnp.array([[1.0, 1.0], [-2.0, 0.0]])
    # hidden: (3.5, -1) and (-1.5, 2), rectified (3.5, 0) and (0, 2)
    np.testing.assert_allclose(network(x), [[8.5], [-4.0]])
    np.testing.assert_allclose(network.from_first(x @ network.weights[0]), network(x))


def test_weights_are_drawn_uniformly_within_glorots_bound_and_biases_start_at_0():
    network = MLP.init(jax.random.key(0), ALL(100, bool), (200,), ALL(50, bool))
    for weight, bound in zip(network.weights, [(6 / 300) ** 0.5, (6 / 250) ** 0.5], strict=True):
        assert jnp.abs(weight).max() <= bound
        shares = np.histogram(weight, 10, (-bound, bound))[0] / weight.size
        np.testing.assert_allclose(shares, 0.1, atol=0.01)
    assert all((bias == 0).all() for bias in network.biases)
    square = MLP.init(jax.random.key(0), ALL(50, bool), (50,), ALL(50, bool))
    assert (square.weights[0] != square.weights[1]).mean() > 0.99  # each layer has its own key


def test_padding_does_not_count_in_the_width_that_weights_are_drawn_for():
    inputs, outputs = jnp.arange(400) < 10, jnp.arange(300) < 5
    network = MLP.init(jax.random.key(1), inputs, (200,), outputs)
    first, last = network.weights
    # the variance of a uniform distribution is a third of its bound squared
    np.testing.assert_allclose(first[:10].var(), 2 / (10 + 200), rtol=0.1)
    np.testing.assert_allclose(last[:, :5].var(), 2 / (200 + 5), rtol=0.1)


def test_integers_are_read_as_one_hot_vectors_and_arrays_flat():
    np.testing.assert_array_equal(features(Discrete(3), jnp.array([2, 0])), [[0, 0, 1], [1, 0, 0]])
    np.testing.assert_array_equal(
        features(MultiDiscrete((2, 3)), jnp.array([[1, 0], [0, 2]])),
        [[0, 1, 1, 0, 0], [1, 0, 0, 0, 1]],
    )
    pixels = jnp.arange(12.0).reshape(2, 3, 2)
    np.testing.assert_array_equal(features(Box(0, 12, (3, 2)), pixels), pixels.reshape(2, 6))
    np.testing.assert_array_equal(features(Box(0, 12, ()), pixels[0, 0]), [[0.0], [1.0]])


@pytest.mark.parametrize(
    ("space", "used"),
    [
        (Discrete(2), [1, 1]),
        (MultiDiscrete((2, 1)), [1, 1, 1]),
        (Simplex(3), [1, 1, 1]),
        (Simplex(3, jnp.array([True, False, True])), [1, 0, 1]),
        (Box(0, 1, (2, 2), jnp.array([[True, True], [False, True]])), [1, 1, 0, 1]),
    ],
)
def test_padding_is_what_can_only_be_zero(space, used):
    np.testing.assert_array_equal(used_features(space), used)


ROLES = {  # not in alphabetical order, on purpose
    "walker": Role(2, Box(-1, 1, (2,), jnp.array([True, False])), Discrete(2)),
    "caller": Role(1, Discrete(2), Simplex(3, jnp.array([True, True, False]))),
}


def test_critics_read_all_observations_then_all_actions_roles_in_alphabetical_order():
    observation = {"walker": jnp.array([[[0.1, 0.0], [0.2, 0.0]]]), "caller": jnp.array([[1]])}
    action = {"walker": jnp.array([[1, 0]]), "caller": jnp.array([[[0.3, 0.7, 0.0]]])}
    row = critic_input(encode_observations(ROLES, observation), encode_actions(ROLES, action))
    expected = [0, 1, 0.1, 0.0, 0.2, 0.0, 0.3, 0.7, 0.0, 0, 1, 1, 0]
    np.testing.assert_allclose(row, [expected])
    np.testing.assert_array_equal(used_inputs(ROLES), [1, 1, 1, 0, 1, 0, 1, 1, 0, 1, 1, 1, 1])
    np.testing.assert_allclose(row[0, own_action(ROLES, "caller", 0)], [0.3, 0.7, 0.0])
    np.testing.assert_allclose(row[0, own_action(ROLES, "walker", 0)], [0, 1])
    np.testing.assert_allclose(row[0, own_action(ROLES, "walker", 1)], [1, 0])


def test_layers_may_have_another_activation():
    layers = (jnp.array([[2.0]]), jnp.array([[3.0]])), (jnp.zeros(1), jnp.zeros(1))
    found = MLP(*layers, jnp.tanh)(jnp.array([0.4]))
    np.testing.assert_allclose(found, [3 * np.tanh(0.8)], rtol=1e-5)


def test_orthogonal_weights_turn_and_do_not_stretch():
    inputs, outputs = jnp.arange(7) < 4, jnp.arange(6) < 5
    weights = orthogonal(jax.random.key(0), inputs, outputs, 2.0)
    assert (weights[4:] == 0).all()
    np.testing.assert_allclose(weights[:, 5], 0, atol=1e-6)
    np.testing.assert_allclose(weights[:4, :5] @ weights[:4, :5].T, 4 * np.eye(4), atol=1e-5)
