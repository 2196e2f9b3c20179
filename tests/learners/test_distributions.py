import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.learners.distributions import epsilon_greedy, gumbel_softmax

LOGITS = jnp.array([1.0, 0.0, -1.0, 2.0])
CHANCES = np.exp(LOGITS) / np.exp(LOGITS).sum()


def test_ties_are_broken_evenly_and_exploration_happens_as_often_as_asked():
    count = 60_000
    bits = jax.random.bits(jax.random.key(0), (count,))
    values = jnp.broadcast_to(jnp.array([1.0, 3.0, 3.0, 3.0])[:, None], (4, count))

    def shares(epsilon):
        chosen = epsilon_greedy(values, bits, epsilon)
        return np.bincount(chosen, minlength=4) / count

    np.testing.assert_allclose(shares(0.0), [0, 1 / 3, 1 / 3, 1 / 3], atol=0.01)
    np.testing.assert_allclose(shares(1.0), [1 / 4] * 4, atol=0.01)
    np.testing.assert_allclose(shares(0.4), [0.1, 0.3, 0.3, 0.3], atol=0.01)


@pytest.mark.parametrize("temperature", [0.3, 1.0, 4.0])
def test_each_choice_is_the_heaviest_as_often_as_softmax_says_at_any_temperature(temperature):
    count = 40_000
    weights = gumbel_softmax(jax.random.key(1), jnp.broadcast_to(LOGITS, (count, 4)), temperature)
    np.testing.assert_allclose(weights.sum(-1), 1.0, rtol=1e-5)
    shares = np.bincount(weights.argmax(-1), minlength=4) / count
    np.testing.assert_allclose(shares, CHANCES, atol=4 * 0.5 / count**0.5)


def test_without_a_key_the_weights_are_the_softmax_of_the_logits_over_the_temperature():
    np.testing.assert_allclose(gumbel_softmax(None, LOGITS, 1.0), CHANCES, rtol=1e-6)
    np.testing.assert_allclose(
        gumbel_softmax(None, LOGITS, 2.0), CHANCES**0.5 / (CHANCES**0.5).sum(), rtol=1e-6
    )


def test_the_colder_the_nearer_to_one_hot():
    weights = [gumbel_softmax(jax.random.key(2), LOGITS, heat).max() for heat in (8, 2, 0.5, 0.01)]
    assert weights == sorted(weights)
    np.testing.assert_allclose(weights[-1], 1.0, atol=1e-6)


def test_straight_through_gives_one_choice_all_the_weight_and_the_gradients_of_the_mixture():
    key, slope = jax.random.key(3), jnp.array([1.0, -2.0, 0.5, 3.0])

    def value(logits, straight_through):
        weights = gumbel_softmax(key, logits, 0.7, straight_through=straight_through)
        return weights @ slope, weights

    (_, mixed), expected = jax.value_and_grad(value, has_aux=True)(LOGITS, False)
    (_, whole), gradient = jax.value_and_grad(value, has_aux=True)(LOGITS, True)
    np.testing.assert_allclose(whole, np.eye(4)[mixed.argmax()], atol=1e-6)
    np.testing.assert_allclose(gradient, expected, rtol=1e-5)
    # the mixture's own: w_k (s_k - sum_j w_j s_j) / temperature
    np.testing.assert_allclose(expected, mixed * (slope - mixed @ slope) / 0.7, rtol=1e-4)


@pytest.mark.parametrize("straight_through", [False, True])
def test_a_choice_out_of_reach_weighs_exactly_nothing_and_leaves_the_others_as_they_were(
    straight_through,
):
    alone = gumbel_softmax(None, LOGITS[:3], 0.5, straight_through=straight_through)
    with_padding = gumbel_softmax(
        None, LOGITS.at[3].set(-1e9), 0.5, straight_through=straight_through
    )
    np.testing.assert_allclose(with_padding[:3], alone, rtol=1e-6)
    many = gumbel_softmax(jax.random.key(4), jnp.tile(LOGITS.at[3].set(-1e9), (1000, 1)), 100.0)
    assert (many[:, 3] == 0).all()
    assert with_padding[3] == 0
