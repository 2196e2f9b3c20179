"""What every registered world promises, whatever it is about."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.core.rollout import episode_ended
from ethogram.core.spaces import Box, Discrete, Simplex
from ethogram.core.world import World
from ethogram.worlds import WORLDS

STEPS = 12
EAGER = 3  # of them: each may compile its loops anew


@pytest.fixture(scope="module", params=WORLDS.names())
def played(request):
    """A world with its default settings, and a few random steps in it, eager and jitted."""
    world = WORLDS.get(request.param)()
    traces = []

    @eqx.filter_jit
    def step(world, key, state, action):
        traces.append(None)
        return world.step(key, state, action)

    def run(step, count=STEPS):
        state, observation = world.reset(jax.random.key(1))
        steps = []
        for number in range(count):
            key = jax.random.key(number)
            action = {name: _sample(key, role) for name, role in world.roles.items()}
            state, outcome = step(world, key, state, action)
            steps.append((action, state, outcome))
        return observation, steps

    return world, run(step), run(type(world).step, EAGER), run(step), traces


def _sample(key, role):
    space, shape = role.action, (role.agents, *role.action.shape)
    if isinstance(space, Discrete):
        return jax.random.randint(key, shape, 0, space.n)
    if isinstance(space, Simplex):
        used = jnp.ones(space.n, bool) if space.used is None else space.used
        return jax.nn.softmax(jnp.where(used, jax.random.normal(key, shape), -jnp.inf))
    if isinstance(space, Box):
        return jax.random.uniform(key, shape, minval=space.low, maxval=space.high)
    return jax.random.randint(key, shape, 0, jnp.asarray(space.sizes))


def test_it_is_a_world_with_roles_and_a_horizon(played):
    world = played[0]
    assert isinstance(world, World)
    assert world.roles
    assert world.horizon >= 1


def test_jitted_steps_equal_eager_ones(played):
    _, (start, steps), eager, *_ = played
    jitted = start, steps[:EAGER]
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-5), jitted, eager)


def test_the_same_keys_give_the_same_world(played):
    _, first, _, again, _ = played
    jax.tree.map(np.testing.assert_array_equal, first, again)


def test_a_step_is_traced_once(played):
    assert len(played[-1]) == 1


def test_actions_drawn_at_random_are_in_their_spaces(played):
    world, (_, steps), *_ = played
    for action, _, _ in steps:
        for name, role in world.roles.items():
            assert role.action.contains(action[name]).all()


def test_observations_are_in_their_spaces_and_all_numbers_are_finite(played):
    world, (start, steps), *_ = played
    for observation in [start, *(outcome.observation for _, _, outcome in steps)]:
        for name, role in world.roles.items():
            assert observation[name].shape == (role.agents, *role.observation.shape)
            assert role.observation.contains(observation[name]).all()
    for _, _, outcome in steps:
        for name, role in world.roles.items():
            for part in (outcome.reward, outcome.terminated, outcome.truncated):
                assert part[name].shape == (role.agents,)
            assert jnp.isfinite(outcome.reward[name]).all()


def test_a_state_can_be_observed_again(played):
    world, (start, steps), *_ = played
    states = [world.reset(jax.random.key(1))[0], *(state for _, state, _ in steps)]
    seen = [start, *(outcome.observation for _, _, outcome in steps)]
    for state, observation in zip(states, seen, strict=True):
        jax.tree.map(np.testing.assert_array_equal, world.observe(state), observation)


def test_an_episode_ends_by_its_horizon(played):
    world = played[0]

    def play(state, key):
        action = {name: _sample(key, role) for name, role in world.roles.items()}
        state, outcome = world.step(key, state, action)
        return state, episode_ended(outcome)

    state, _ = world.reset(jax.random.key(1))
    keys = jax.random.split(jax.random.key(2), world.horizon)
    assert jax.lax.scan(play, state, keys)[1].any()
