import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ethogram.core.rollout import rollout
from ethogram.core.spaces import Discrete
from ethogram.core.world import Outcome, Role, World


class Counter(World):
    """Counts its steps; an episode lasts three."""

    horizon = 3
    roles = {"agent": Role(1, Discrete(4), Discrete(2))}  # noqa: RUF012 - a property elsewhere

    def reset(self, key):
        del key
        return jnp.int32(0), self.observe(jnp.int32(0))

    def observe(self, state):
        return {"agent": state[None]}

    def step(self, key, state, action):
        del key
        count = state + 1
        never = jnp.zeros(1, bool)
        outcome = Outcome(
            observation=self.observe(count),
            reward={"agent": action["agent"].astype(float)},
            terminated={"agent": never},
            truncated={"agent": (count >= 3)[None]},
        )
        return count, outcome


def obey(key, observation):
    del key
    return {"agent": observation["agent"] % 2}


def test_an_ended_episode_is_followed_by_a_fresh_one_and_keeps_its_final_observation():
    _, played = eqx.filter_jit(rollout)(Counter(), obey, jax.random.key(0), 7)
    np.testing.assert_array_equal(played.observation["agent"][:, 0], [0, 1, 2, 0, 1, 2, 0])
    reached = played.outcome.observation["agent"][:, 0]
    np.testing.assert_array_equal(reached, [1, 2, 3, 1, 2, 3, 1])
    np.testing.assert_array_equal(played.last, [0, 0, 1, 0, 0, 1, 0])
    np.testing.assert_array_equal(played.outcome.reward["agent"][:, 0], [0, 1, 0, 0, 1, 0, 0])


def test_a_rollout_goes_on_from_where_another_stopped():
    position, _ = rollout(Counter(), obey, jax.random.key(0), 2)
    _, played = rollout(Counter(), obey, jax.random.key(1), 2, position)
    np.testing.assert_array_equal(played.observation["agent"][:, 0], [2, 0])
