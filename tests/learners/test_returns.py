import jax.numpy as jnp
import numpy as np

from ethogram.learners.dynamic_programming import discounted_returns
from ethogram.learners.returns import (
    discounted_return,
    generalized_advantage,
    running_return,
    td_target,
)


def test_nothing_follows_a_termination_while_a_truncation_goes_on():
    reward, future = jnp.array([1.0, 1.0, -2.0]), jnp.array([10.0, 10.0, 4.0])
    terminated = jnp.array([False, True, False])  # the others run on, or are merely cut
    np.testing.assert_allclose(td_target(reward, terminated, future, 0.5), [6.0, 1.0, 0.0])


def test_a_future_that_is_not_finite_is_no_matter_after_a_termination():
    target = td_target(jnp.ones(1), jnp.ones(1, bool), jnp.array([jnp.inf]), 0.5)
    np.testing.assert_array_equal(target, [1.0])


def test_a_return_discounts_from_the_first_reward_on():
    reward = jnp.array([[1.0, 2.0], [2.0, 0.0], [4.0, 8.0]])  # two episodes of three steps
    np.testing.assert_allclose(discounted_return(reward, 0.5), [3.0, 4.0])
    np.testing.assert_allclose(discounted_return(reward, 1.0), reward.sum(0))
    np.testing.assert_allclose(discounted_return(reward, 0.0), reward[0])
    np.testing.assert_allclose(discounted_return(reward, 0.9), discounted_returns(reward, 0.9)[0])


def test_returns_so_far_begin_anew_with_an_episode():
    reward = jnp.array([[1.0, 1.0], [2.0, 2.0], [4.0, 4.0]])
    ended = jnp.array([[False, False], [True, False], [False, False]])
    found = running_return(reward, ended, 0.5)
    np.testing.assert_allclose(found, [[1, 1], [2.5, 2.5], [4, 5.25]])


def test_an_advantage_goes_on_beyond_a_time_out_of_play_and_ends_where_the_episode_does():
    acting = jnp.array([True, False, True, True])
    value, reached = jnp.array([1.0, 99.0, 2.0, 4.0]), jnp.array([99.0, 99.0, 8.0, 16.0])
    never = jnp.zeros(4, bool)
    steps = jnp.ones(4), value, reached

    def advantages(terminated, cut):
        return generalized_advantage(*steps, terminated, cut, acting, 0.5, 0.8)

    # the last one earns 1 and then expects 16; the one before it is cut, and expects 8
    cut = never.at[2].set(True)
    first = 1 + 0.5 * (1 + 0.5 * 2) - 1 + 0.8 * 0.25 * (1 + 0.5 * 8 - 2)
    np.testing.assert_allclose(advantages(never, cut), [first, 0, 3, 1 + 8 - 4], rtol=1e-6)
    first = 1 + 0.5 * (1 + 0.5 * 2) - 1 + 0.8 * 0.25 * (1 - 2)
    np.testing.assert_allclose(advantages(cut, never), [first, 0, -1, 1 + 8 - 4], rtol=1e-6)
