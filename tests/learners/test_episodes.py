import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.core.errors import UnknownName
from ethogram.core.world import Outcome, Transition
from ethogram.learners import ppo
from ethogram.learners.episodes import episode_sums
from ethogram.worlds.traffic import Traffic


def test_metrics_are_summed_over_the_first_episode_alone():
    ends = jnp.array([[False, True, False, True], [False, False, False, True]])
    metrics = {"load": jnp.array([[1, 2, 4, 8], [1, 2, 4, 8]]), "of_each": jnp.ones((2, 4, 3, 2))}
    outcome = Outcome(observation={}, reward={}, terminated={}, truncated={}, metrics=metrics)
    played = Transition(jax.random.key(0), None, {}, {}, outcome, None, ends)
    sums = episode_sums(played)
    np.testing.assert_array_equal(sums["load"], [3, 15])
    np.testing.assert_array_equal(sums["of_each"][:, 2, 1], [2, 4])


def test_a_metric_that_a_world_has_not_is_refused():
    learner = ppo.PPO(Traffic(cars=2, max_cars=2, steps=3), track=("speed", "sped"))
    state = jax.eval_shape(learner.init, jax.random.key(0))
    with pytest.raises(UnknownName, match=r"sped.*speed"):
        jax.eval_shape(learner.update, jax.random.key(0), state)
