"""What every registered world promises, whatever it is about."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.learners.toys import Market, Reach

from ethogram.core.actions import InvalidAction, nearest
from ethogram.core.rollout import episode_ended
from ethogram.core.spaces import Box, Discrete, Simplex
from ethogram.core.world import World
from ethogram.core.wrappers import (
    DiscretizeAction,
    DiscretizeObservation,
    GivenPolicies,
    RepeatAction,
    RescaleAction,
    RescaleObservation,
    TimeLimit,
)
from ethogram.worlds import WORLDS
from ethogram.worlds.language import Language

STEPS = 12
EAGER = 1  # of them: each compiles its loops anew


def silent(key, observation):
    """Talkers that choose word 0."""
    del key
    return jnp.tile(jnp.eye(5)[0], (len(observation), 1))


# each around a small world whose spaces it is for
WRAPPED = {
    "DiscretizeAction": lambda: DiscretizeAction(Market()),
    "DiscretizeAction of a box": lambda: DiscretizeAction(Reach(), bins=3),
    "DiscretizeObservation": lambda: DiscretizeObservation(Market(), bins=3),
    "GivenPolicies": lambda: GivenPolicies(Language(), {"talker": silent}),
    "RepeatAction": lambda: RepeatAction(Language(), times=4),
    "RescaleAction": lambda: RescaleAction(Reach()),
    "RescaleObservation": lambda: RescaleObservation(Reach()),
    "TimeLimit": lambda: TimeLimit(Language(), steps=7),
}


# the publishing system with learnable policies takes as long to compile as the system, again
SLOW = "learnable_publishing"
EVERY = [
    pytest.param(name, marks=[pytest.mark.slow] if name == SLOW else [])
    for name in (*WORLDS, *WRAPPED)
]


@eqx.filter_jit
def reset(world, key):
    return world.reset(key)


@eqx.filter_jit
def observe(world, state):
    return world.observe(state)


@pytest.fixture(scope="module", params=EVERY)
def played(request):
    """A world with its default settings, and a few random steps in it, eager and jitted."""
    world = (WRAPPED.get(request.param) or WORLDS[request.param])()
    traces = []

    @eqx.filter_jit
    def step(world, key, state, action):
        traces.append(None)
        return world.step(key, state, action)

    def run(step, count=STEPS):
        start = reset(world, jax.random.key(1))  # jitted in all: its rounding may decide a step
        state, steps = start[0], []
        for number in range(count):
            key = jax.random.key(number)
            action = {name: _sample(key, role) for name, role in world.roles.items()}
            state, outcome = step(world, key, state, action)
            steps.append((action, state, outcome))
        return start, steps

    return world, run(step), run(type(world).step, EAGER), run(step), traces, step


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
    _, first, _, again, *_ = played
    jax.tree.map(np.testing.assert_array_equal, first, again)


def test_a_step_is_traced_once(played):
    assert len(played[4]) == 1


def test_actions_drawn_at_random_are_in_their_spaces(played):
    world, (_, steps), *_ = played
    for action, _, _ in steps:
        for name, role in world.roles.items():
            assert role.action.contains(action[name]).all()


def test_observations_are_in_their_spaces_and_all_numbers_are_finite(played):
    world, ((_, start), steps), *_ = played
    for observation in [start, *(outcome.observation for _, _, outcome in steps)]:
        for name, role in world.roles.items():
            assert observation[name].shape == (role.agents, *role.observation.shape)
            assert role.observation.contains(observation[name]).all()
    for _, _, outcome in steps:
        for name, role in world.roles.items():
            for part in (outcome.reward, outcome.terminated, outcome.truncated, outcome.acting):
                assert part[name].shape == (role.agents,)
            assert outcome.acting[name].dtype == bool
            assert jnp.isfinite(outcome.reward[name]).all()


def test_a_state_can_be_observed_again(played):
    world, (start, steps), *_ = played
    seen = [start, *((state, outcome.observation) for _, state, outcome in steps)]
    for state, observation in seen:
        jax.tree.map(np.testing.assert_array_equal, observe(world, state), observation)


def test_an_episode_ends_by_its_horizon(played):
    world, ((start, _), _), *_ = played

    def play(state, key):
        action = {name: _sample(key, role) for name, role in world.roles.items()}
        state, outcome = world.step(key, state, action)
        return state, episode_ended(outcome)

    keys = jax.random.split(jax.random.key(2), world.horizon)
    assert jax.lax.scan(play, start, keys)[1].any()


def test_step_and_reset_can_be_given_to_jit_itself(played):
    world, (_, steps), *_ = played
    key, (action, state, outcome) = jax.random.key(0), steps[0]
    fresh, _ = jax.eval_shape(jax.jit(world.reset), key)
    _, found = jax.eval_shape(jax.jit(world.step), key, state, action)
    same = (fresh, state), (found, outcome)
    assert all(jax.tree.structure(a) == jax.tree.structure(b) for a, b in same)


def test_an_action_of_another_form_is_refused_by_role_and_shape(played):
    world, (_, steps), *_ = played
    action, state, _ = steps[0]
    for role, value in action.items():
        wrong = [
            value[:-1],
            jnp.concatenate([value, value[:1]]),
            value[0],
            value[..., None],
            value.astype(bool),
            value.astype(complex),
            "none",
            None,
        ]
        if jnp.issubdtype(value.dtype, jnp.integer):
            wrong.append(value.astype(float))
        for other in wrong:
            with pytest.raises(InvalidAction, match=f"role '{role}' is .*; given: "):
                world.step(jax.random.key(0), state, action | {role: other})
        fewer = {name: part for name, part in action.items() if name != role}
        for other in (fewer, action | {"stranger": value}, value, None):
            with pytest.raises(InvalidAction, match=rf"for each of the roles .*'{role}'.*; given"):
                world.step(jax.random.key(0), state, other)


def test_whole_numbers_and_lists_pass_for_what_they_are(played):
    world, (_, steps), *_ = played
    action, state, _ = steps[0]
    plain = {role: np.asarray(value).tolist() for role, value in action.items()}
    found = jax.eval_shape(lambda: world.step(jax.random.key(0), state, plain))
    assert jax.tree.map(lambda part: (part.shape, part.dtype), found[0]) == jax.tree.map(
        lambda part: (part.shape, part.dtype), state
    )


WRONG = (-1, 99_999, -(2**31), 2**31 - 1)
BEYOND = (jnp.nan, jnp.inf, -jnp.inf, -1e30, 100.0)


def test_what_is_out_of_a_space_is_taken_for_what_is_in_it_and_spoils_no_state(played):
    world, (_, steps), *_, step = played
    before, state, _ = steps[0]
    for wrong in zip(WRONG, BEYOND[:4], strict=True):
        action = {role: _filled(value, *wrong) for role, value in before.items()}
        taken = nearest(world.roles, action)
        key = jax.random.key(0)
        found, expected = step(world, key, state, action), step(world, key, state, taken)
        jax.tree.map(np.testing.assert_array_equal, found, expected)
        after, outcome = found
        for name, role in world.roles.items():
            assert role.action.contains(taken[name]).all()
            assert role.observation.contains(outcome.observation[name]).all()
            assert jnp.isfinite(outcome.reward[name]).all()
        once_more, _ = step(world, key, after, before)
        assert _finite(once_more) == _finite(state)


def _filled(value, whole, real):
    is_whole = jnp.issubdtype(value.dtype, jnp.integer)
    return value.at[0].set(whole if is_whole else real)


def _finite(state):
    return [
        bool(jnp.isfinite(part).all()) for part in jax.tree.leaves(state) if part.dtype == float
    ]


def test_check_names_role_agent_and_value(played):
    world, (_, steps), *_ = played
    action = steps[0][0]
    jax.tree.map(np.testing.assert_array_equal, world.check(action), action)
    for role, value in action.items():
        for wrong in zip(WRONG, BEYOND[:4], strict=True):
            other = action | {role: _filled(value, *wrong)}
            with pytest.raises(InvalidAction, match=rf"role '{role}' is out of .* agent 0 is "):
                world.check(other)


def numeric_settings(module):
    """The settings of a world, and of what it is made of, that are no sizes."""
    found = [field for field in dataclasses.fields(module) if not field.metadata.get("static")]
    for field in found:
        value = getattr(module, field.name)
        if isinstance(value, eqx.Module):
            yield from ((field.name, *path) for path in numeric_settings(value))
        elif "setting" in field.metadata:
            yield (field.name,)


def at(path):
    def value(module):
        for name in path:
            module = getattr(module, name)
        return module

    return value


def swept(world, path):
    """The world with two values of a setting, which goes through all that checks it."""
    value = at(path)(world)
    two = jnp.array([0.0, 1.0]) if value is None else jnp.stack([value, value * 9 // 10])
    if len(path) == 1:
        return dataclasses.replace(world, **{path[0]: two})
    return dataclasses.replace(world, **{path[0]: swept(getattr(world, path[0]), path[1:])})


@pytest.mark.parametrize("name", [name for name in WORLDS if name != SLOW])
def test_every_numeric_setting_can_be_swept(name):
    world = WORLDS[name]()
    paths = list(numeric_settings(world))
    assert paths
    whole = world
    for path in paths:
        two = at(path)(swept(world, path))
        assert two.shape == (2,)
        whole = eqx.tree_at(at(path), whole, two, is_leaf=lambda part: part is None)

    def play(world):
        key = jax.random.key(0)
        action = {role: _sample(key, played) for role, played in world.roles.items()}
        return world.step(key, world.reset(key)[0], action)

    axes = jax.tree.map(lambda part: 0 if part.shape == (2,) else None, whole)
    state, outcome = eqx.filter_eval_shape(eqx.filter_vmap(play, in_axes=(axes,)), whole)
    assert all(part.shape[0] == 2 for part in jax.tree.leaves((state, outcome)))
