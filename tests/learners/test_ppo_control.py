"""PPO in CartPole and Pendulum, whose numbers Gymnasium has said."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.learners.control import CartPole, Motion, Pendulum

from ethogram.api import evaluate
from ethogram.learners.ppo import PPO
from ethogram.learners.train import train

KEY = jax.random.key(99)


def stepped(world, state, role, action):
    return world.step(KEY, Motion(jnp.array(state), jnp.int32(0)), {role: jnp.array(action)})[1]


def test_a_step_is_that_of_gymnasium():
    outcome = stepped(CartPole(), [0.01, -0.2, 0.03, 0.4], "cart", [1])
    reached = [[0.006, -0.00531617, 0.038, 0.11692433]]
    np.testing.assert_allclose(outcome.observation["cart"], reached, rtol=1e-5, atol=1e-7)
    assert outcome.reward["cart"] == 1
    outcome = stepped(Pendulum(), [2.0, -1.5], "joint", [[1.2]])
    reached = [[-0.3869322, 0.9221082, -0.63802695]]
    np.testing.assert_allclose(outcome.observation["joint"], reached, rtol=1e-5)
    np.testing.assert_allclose(outcome.reward["joint"], -4.22644, rtol=1e-5)


def mean_returns(learner, updates):
    """Of 100 episodes without exploring, after training with each of five seeds."""
    (role,) = learner.world.roles
    for seed in range(5):
        state, _ = train(learner, jax.random.key(seed), updates)
        yield float(evaluate(learner.world, learner.policy(state), KEY)[role].mean())


@pytest.mark.slow
def test_a_pole_is_kept_upright_after_100_000_steps():
    learner = PPO(CartPole(), episodes_per_update=4, minibatch_size=64)
    assert min(mean_returns(learner, 50)) > 490  # the most there is is 500


@pytest.mark.slow
def test_a_pendulum_stands_after_96_000_steps():
    learner = PPO(
        Pendulum(), episodes_per_update=20, minibatch_size=64, discount=0.9, learning_rate=1e-3
    )
    found = list(mean_returns(learner, 24))
    assert np.mean(found) > -200
    assert min(found) > -250
