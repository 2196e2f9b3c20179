"""Distributions of actions: their densities, and that what is drawn follows them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from ethogram.core.spaces import Box, Discrete, MultiDiscrete, Simplex
from ethogram.learners.action_distributions import action_distribution, action_of, deviation_count
from ethogram.learners.networks import feature_count

COUNT = 40_000
KEY = jax.random.key(0)
USED = jnp.array([True, False, True])
SPACES = [
    Discrete(3),
    MultiDiscrete((2, 3)),
    Simplex(3, USED),
    Box(-1.0, 3.0, (2,)),
    Box(-jnp.inf, 3.0, (3,), USED),
    Box(0.0, 1.0, (2, 2)),
]


def distributions(space, count=1):
    draw = np.random.default_rng(1).normal
    outputs, other = jnp.asarray(draw(size=(2, feature_count(space))), jnp.float32)
    log_std = jnp.asarray(0.3 * draw(size=(2, deviation_count(space))), jnp.float32)
    return [
        action_distribution(space, jnp.tile(each, (count, 1)), deviation)
        for each, deviation in zip((outputs, other), log_std, strict=True)
    ]


@pytest.mark.parametrize("space", SPACES, ids=str)
def test_entropy_and_divergence_are_means_of_what_is_drawn(space):
    one, other = distributions(space, COUNT)
    drawn = one.sample(KEY)
    chance = one.log_prob(drawn)
    np.testing.assert_allclose(-chance.mean(), one.entropy()[0], atol=0.02)
    divergence = (chance - other.log_prob(drawn)).mean()
    np.testing.assert_allclose(divergence, one.kl(other)[0], rtol=0.05)
    np.testing.assert_allclose(one.kl(one), 0, atol=1e-6)
    assert (one.log_prob(one.mode()) >= chance - 1e-5).all()


def test_each_choice_is_drawn_as_often_as_softmax_says():
    logits = jnp.array([1.0, 0.0, 2.0, 0.5, -1.0])
    drawn = action_distribution(MultiDiscrete((2, 3)), jnp.tile(logits, (COUNT, 1)), logits[:0])
    for entry, part in enumerate((logits[:2], logits[2:])):
        shares = np.bincount(drawn.sample(KEY)[:, entry], minlength=len(part)) / COUNT
        np.testing.assert_allclose(shares, jax.nn.softmax(part), atol=0.01)


def test_the_density_of_numbers_is_that_of_scipy_and_padding_has_none():
    mean, log_std = jnp.array([[0.5, 9.0, -1.0]]), jnp.array([0.2, 9.0, -0.7])
    drawn = jnp.array([[1.0, 5.0, -2.0]])
    found = action_distribution(Box(-1.0, 1.0, (3,), USED), mean, log_std).log_prob(drawn)
    wanted = stats.norm(mean[0], np.exp(log_std)).logpdf(drawn[0])[USED].sum()
    np.testing.assert_allclose(found, [wanted], rtol=1e-6)


@pytest.mark.parametrize("squash", [False, True])
@pytest.mark.parametrize("space", SPACES, ids=str)
def test_whatever_is_drawn_is_an_action(space, squash):
    drawn = 3 * distributions(space, 100)[0].sample(KEY)
    if isinstance(space, Discrete | MultiDiscrete):
        drawn //= 3
    assert space.contains(action_of(space, drawn, squash=squash)).all()


def test_minus_1_and_1_are_the_bounds_of_a_box_and_what_is_beyond_is_clipped_or_squashed():
    drawn = jnp.array([[-2.0], [-1.0], [0.0], [0.5], [1.0], [2.0]])
    box = Box(-1.0, 3.0, (1,))
    found = action_of(box, drawn, squash=False)
    np.testing.assert_allclose(found, [[-1], [-1], [1], [2], [3], [3]])
    np.testing.assert_allclose(
        action_of(box, drawn, squash=True), 1 + 2 * np.tanh(drawn), rtol=1e-6
    )
    half_open = Box(-jnp.inf, 1.5, (1,))
    for squash in (False, True):
        found = action_of(half_open, drawn, squash=squash)
        np.testing.assert_allclose(found, np.minimum(drawn, 1.5))


def test_weights_of_choices_are_the_softmax_of_what_is_drawn_without_padding():
    found = action_of(Simplex(3, USED), jnp.array([0.0, 50.0, np.log(3.0)]), squash=False)
    np.testing.assert_allclose(found, [0.25, 0, 0.75], rtol=1e-6)
