import jax.numpy as jnp
import numpy as np

from ethogram.learners.dynamic_programming import discounted_returns
from ethogram.learners.returns import discounted_return, td_target


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
