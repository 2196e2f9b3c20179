import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.core.actions import InvalidAction
from ethogram.core.errors import EthogramError
from ethogram.core.rollout import rollout
from ethogram.core.spaces import Discrete
from ethogram.core.world import Outcome, Role, World
from ethogram.core.wrappers import Checked


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
    np.testing.assert_array_equal(played.episode_end, [0, 0, 1, 0, 0, 1, 0])
    np.testing.assert_array_equal(played.outcome.reward["agent"][:, 0], [0, 1, 0, 0, 1, 0, 0])


def test_a_rollout_goes_on_from_where_another_stopped():
    position, _ = rollout(Counter(), obey, jax.random.key(0), 2)
    _, played = rollout(Counter(), obey, jax.random.key(1), 2, position)
    np.testing.assert_array_equal(played.observation["agent"][:, 0], [2, 0])


def test_a_policy_for_another_number_of_agents_is_refused():
    with pytest.raises(
        InvalidAction, match=r"Counter: the action of the role 'agent' is int32\[1\]"
    ):
        rollout(Counter(), lambda key, seen: {"agent": jnp.zeros(2, int)}, jax.random.key(0), 2)


def test_a_checked_world_steps_like_the_other_and_stops_at_an_action_out_of_its_space():
    @eqx.filter_jit
    def play(world, beyond):
        def policy(key, observation):
            return jax.tree.map(lambda action: action + beyond, obey(key, observation))

        return rollout(world, policy, jax.random.key(0), 7)

    world = Counter()
    (_, found), (_, expected) = (play(each, jnp.int32(0)) for each in (Checked(world), world))
    jax.tree.map(np.testing.assert_array_equal, found.outcome, expected.outcome)
    play(world, jnp.int32(1))  # takes 2 for 1
    with pytest.raises(RuntimeError, match=r"'agent' is out of Discrete\(n=2\)"):
        play(Checked(world), jnp.int32(1))


def test_fewer_steps_than_none_are_refused():
    key = jax.random.key(0)
    assert rollout(Counter(), obey, key, 0)[1].episode_end.shape == (0,)
    with pytest.raises(EthogramError, match=r"rollout: steps = -1; allowed: .*, 0 or more"):
        rollout(Counter(), obey, key, -1)


def test_of_a_transition_is_stored_what_is_asked_for_and_what_a_policy_says_beside_its_action():
    def talking(key, observation):
        return obey(key, observation), {"value": observation["agent"] * 10.0}

    def keep(transition):
        return transition.extras["value"], transition.outcome.acting

    _, (value, acting) = rollout(Counter(), talking, jax.random.key(0), 4, keep=keep)
    np.testing.assert_array_equal(value[:, 0], [0.0, 10.0, 20.0, 0.0])
    assert acting["agent"].all()  # unless the world says otherwise
    _, whole = rollout(Counter(), obey, jax.random.key(0), 1)
    assert whole.extras is None
