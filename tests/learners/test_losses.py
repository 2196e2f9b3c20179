"""Losses, worked by hand."""

import jax
import jax.numpy as jnp
import numpy as np

from ethogram.learners.actor_critic import Minibatch, td_targets
from ethogram.learners.critic_input import value_with_action
from ethogram.learners.losses import (
    adapted_kl_coefficient,
    clipped_surrogate,
    clipped_value_error,
    critic_loss,
    deterministic_policy_loss,
    masked_mean,
)
from ethogram.learners.networks import MLP

COUNTED = jnp.array([True, False, True])


def network(inputs: int) -> MLP:
    return MLP.init(jax.random.key(3), jnp.ones(inputs, bool), (4,), jnp.ones(1, bool))


def test_a_mean_is_of_what_counts_and_0_of_nothing():
    values = jnp.array([1.0, jnp.nan, 4.0])
    assert masked_mean(values, COUNTED) == 2.5
    assert masked_mean(values, jnp.zeros(3, bool)) == 0


def test_a_critic_is_charged_the_mean_squared_error_of_the_steps_that_count():
    value, target = jnp.array([1.0, 7.0, 3.0]), jnp.array([0.0, -7.0, 5.0])
    assert critic_loss(value, target, COUNTED) == (1 + 4) / 2
    slope = jax.grad(critic_loss)(value, target, COUNTED)
    np.testing.assert_array_equal(slope, [1.0, 0.0, -2.0])


def test_an_actor_is_charged_minus_its_value_and_large_outputs_that_are_no_padding():
    value = jnp.array([1.0, 100.0, 2.0])
    outputs = jnp.array([[1.0, 9.0, 2.0], [50.0, 50.0, 50.0], [3.0, 9.0, 4.0]])
    used = jnp.array([True, False, True])
    loss = deterministic_policy_loss(value, outputs, COUNTED, used, 0.1)
    np.testing.assert_allclose(loss, -1.5 + 0.1 * (1 + 4 + 9 + 16) / 4, rtol=1e-6)


def test_an_action_that_is_another_is_valued_as_if_it_had_been_done():
    critic = network(5)
    row = jax.random.normal(jax.random.key(0), (3, 5))
    own, action = slice(2, 4), jax.random.normal(jax.random.key(1), (3, 2))

    def value(action):
        return value_with_action(critic, row, own, action)

    def whole(action):
        return critic(row.at[:, own].set(action))[:, 0]

    np.testing.assert_allclose(value(action), whole(action), rtol=1e-5, atol=1e-6)
    slope, wanted = (jax.grad(lambda a, of=of: of(a).sum())(action) for of in (value, whole))
    np.testing.assert_allclose(slope, wanted, rtol=1e-5, atol=1e-6)


def test_the_target_of_a_critic_is_what_was_earned_and_what_the_target_network_expects_next():
    critic, reached = network(2), jnp.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    batch = Minibatch(
        observation=jnp.zeros((3, 1)),
        critic_input=jnp.full((3, 2), 99.0),
        reward=jnp.array([1.0, 2.0, 3.0]),
        terminated=~COUNTED,
        acting=jnp.ones(3, bool),
        next_critic_input=reached,
    )
    expected = np.array([1.0, 2.0, 3.0]) + 0.5 * np.array([1, 0, 1]) * critic(reached)[:, 0]
    np.testing.assert_allclose(td_targets(critic, batch, 0.5), expected, rtol=1e-6)


def test_a_ratio_beyond_the_clip_has_nothing_more_to_gain():
    ratio = jnp.array([0.5, 0.5, 1.0, 2.0, 2.0])
    advantage = jnp.array([1.0, -1.0, 3.0, 1.0, -1.0])
    found = clipped_surrogate(ratio, advantage, 0.2)
    np.testing.assert_allclose(found, [0.5, -0.8, 3.0, 1.2, -2.0], rtol=1e-6)
    slope = jax.grad(lambda ratio: clipped_surrogate(ratio, advantage, 0.2).sum())(ratio)
    np.testing.assert_array_equal(slope[jnp.array([0, 1, 3, 4])], [1, 0, 0, -1])


def test_a_value_that_moves_beyond_its_clip_is_charged_as_if_it_had_not():
    value, old, target = jnp.array([3.0, 3.0, 1.5]), jnp.array([1.0] * 3), jnp.array([5.0, 3.0, 0])
    found = clipped_value_error(value, old, target, 1.0)
    np.testing.assert_allclose(found, [(2 - 5) ** 2, (2 - 3) ** 2, 1.5**2])
    np.testing.assert_allclose(clipped_value_error(value, old, target, 0.0), [4, 0, 2.25])


def test_the_coefficient_of_the_divergence_follows_its_target():
    coefficient, kl = jnp.full(5, 0.2), jnp.array([0.0, 0.0051, 0.01, 0.0199, 0.021])
    found = adapted_kl_coefficient(coefficient, kl, 0.01)
    np.testing.assert_allclose(found, [0.1, 0.2, 0.2, 0.2, 0.3], rtol=1e-6)
