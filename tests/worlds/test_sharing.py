from itertools import product

import equinox as eqx
import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import arrays
from tests.oracles import sharing as oracle

from ethogram.core.errors import InvalidSettings, TooLarge, UnknownName
from ethogram.core.rollout import rollout
from ethogram.worlds.sharing import Sharing
from ethogram.worlds.sharing.reward import REWARDS, reward_of_filling
from ethogram.worlds.sharing.rows import Group, joint_rows, ranking
from ethogram.worlds.sharing.scene import record
from ethogram.worlds.sharing.world import tally

KEY = jax.random.key(0)


@eqx.filter_jit
def reset(world):
    return world.reset(KEY)


@eqx.filter_jit
def step(world, state, action):
    return world.step(KEY, state, {"agent": action})


def play(world, actions):
    """The outcomes of a list of joint actions from the start."""
    state, observation = reset(world)
    outcomes = []
    for action in actions:
        state, outcome = step(world, state, jnp.asarray(action))
        outcomes.append((state, outcome))
    return observation, outcomes


def test_three_agents_by_hand():
    world = Sharing(scenario="cooperative", agents=3, encoding="vector")
    start, played = play(world, [[0, 1, 3], [1, 1, 2], [1, 3, 3]])
    np.testing.assert_array_equal(start["agent"], [[0, 0, 0, 0, 0, 0]] * 3)

    # all only prefer; 1 wants resource 1 silently, 2 says (none, 1), 3 says (none, 2)
    state, outcome = played[0]
    np.testing.assert_array_equal(state.resource, [0, 0, 0])
    np.testing.assert_array_equal(outcome.reward["agent"], [0, 0, 0])
    #       rho    U     V        per agent
    rows = [[0, 0, 0, 1, 1, 1], [0, 0, 0, 1, 1, 1], [0, 0, 0, 2, 1, 1]]
    np.testing.assert_array_equal(outcome.observation["agent"], rows)

    # 1 and 2 confirm resource 1 and say so, 3 confirms resource 2 silently: v = (2 x 4, 0)
    _, outcome = played[1]
    np.testing.assert_allclose(outcome.reward["agent"], [2 / 3, 2 / 3, 1 / 3])
    rows = [[2, 1, 1, 1, 8, 0], [2, 1, 1, 1, 8, 0], [2, 1, 2, 2, 8, 0]]
    np.testing.assert_array_equal(outcome.observation["agent"], rows)

    # 2 stays on 1 but now wants 2 and says so: v = (4, 4 + 1)
    _, outcome = played[2]
    np.testing.assert_allclose(outcome.reward["agent"], [2 / 3, 2 / 3, 1 / 3])
    rows = [[2, 1, 1, 1, 4, 5], [2, 1, 1, 2, 4, 5], [2, 1, 2, 2, 4, 5]]
    np.testing.assert_array_equal(outcome.observation["agent"], rows)


@st.composite
def games(draw):
    """A group, and some joint actions for it."""
    agents, resources = draw(st.sampled_from([(1, 1), (2, 3), (4, 2), (5, 3)]))
    communication = draw(st.sampled_from(["always", "optional", "none"]))
    choices = resources * (2 if communication == "optional" else 1)
    actions = draw(arrays(np.int32, (6, agents), elements=st.integers(0, choices - 1)))
    return {
        "scenario": draw(st.sampled_from(list(REWARDS))),
        "agents": agents,
        "resources": resources,
        "communication": communication,
        "observe_filling": draw(st.booleans()),
    }, actions


@settings(max_examples=25)
@given(game=games(), literal=st.booleans())
def test_the_world_is_the_one_that_the_thesis_writes(game, literal):
    group, actions = game
    world = Sharing(**group, reward="literal" if literal else "scaled", encoding="vector")
    slow = oracle.Group(**group, literal=literal)
    observations, rewards = replay(world, jnp.asarray(actions))
    for action, observed, earned in zip(actions, observations, rewards, strict=True):
        slow.step(action)
        np.testing.assert_array_equal(observed, slow.observations())
        np.testing.assert_allclose(earned, slow.rewards(), rtol=1e-6)


@eqx.filter_jit
def replay(world, actions):
    """What the agents observe and earn after each joint action."""

    def step(state, action):
        state, outcome = world.step(KEY, state, {"agent": action})
        return state, (outcome.observation["agent"], outcome.reward["agent"])

    return jax.lax.scan(step, world.reset(KEY)[0], actions)[1]


@pytest.mark.parametrize(("agents", "resources"), [(1, 1), (4, 2), (2, 3)])
@pytest.mark.parametrize("communication", ["always", "optional", "none"])
@pytest.mark.parametrize("observed", [True, False])
def test_ranks_number_what_can_be_observed_without_gaps(agents, resources, communication, observed):
    group = Group(agents, resources, communication, observed)
    found = {tuple(counts) for counts in _possible_counts(group)}
    assert len(found) == joint_rows(group)
    ranks = jax.vmap(ranking(group))(jnp.asarray(sorted(found)))
    np.testing.assert_array_equal(np.sort(ranks), np.arange(len(found)))


def _possible_counts(group):
    """(c, x, d) of every joint state of the agents in which each has a preference."""
    resources = range(group.resources)
    speaks = {"always": [True], "none": [False], "optional": [False, True]}[group.communication]
    for agents in product(product([-1, *resources], resources, speaks), repeat=group.agents):
        c = [sum(s and p == w == j for p, w, s in agents) for j in resources]
        d = [sum(s and p != w == j for p, w, s in agents) for j in resources]
        x = [sum(p == j for p, _, _ in agents) - c[j] for j in resources]
        yield [*c, *(x if group.observe_filling else [0] * len(x)), *d]


@pytest.mark.parametrize(
    ("communication", "observed", "rows"),
    [("optional", True, 126_127), ("optional", False, 6_007), ("none", False, 7)],
)
def test_ten_agents_and_two_resources_need_few_rows(communication, observed, rows):
    # 21 021 joint counts x 6 own states + the start; by hand C(14, 4) and 1 joint counts
    assert Sharing(communication=communication, observe_filling=observed).rows == rows


def test_different_observations_have_different_rows():
    def watch(encoding, key):
        world = Sharing(agents=4, resources=3, encoding=encoding)

        def policy(key, _):
            return {"agent": jax.random.randint(key, (4,), 0, 6)}

        played = eqx.filter_jit(rollout)(world, policy, key, 400)[1]
        return np.asarray(played.outcome.observation["agent"])

    vectors = watch("vector", KEY).reshape(-1, 3 + 2 + 3)
    rows = watch("index", KEY).reshape(-1)
    pairs = {(tuple(vector), row) for vector, row in zip(vectors, rows, strict=True)}
    assert len(pairs) == len({vector for vector, _ in pairs}) == len({row for _, row in pairs})


def test_too_many_observations_for_an_index_are_refused_with_their_number():
    with pytest.raises(TooLarge, match=r'observe 10\^\d+ different things.*encoding="vector"'):
        Sharing(agents=60, resources=4).reset(KEY)


def test_all_together_earn_99_in_the_cooperative_scenario():
    _, rewards = replay(Sharing(scenario="cooperative"), jnp.zeros((100, 10), jnp.int32))
    np.testing.assert_allclose(rewards.sum(0), 99.0)


@pytest.mark.parametrize("scenario", ["competitive", "mixed"])
def test_with_all_active_an_even_split_is_the_collective_optimum(scenario):
    code = list(REWARDS).index(scenario)

    def total(first):
        filling = jnp.array([first, 10 - first])
        return float((filling * reward_of_filling(filling, code, 10, 2)).sum())

    assert max(range(11), key=total) == 5


def test_the_literal_rewards_divide_by_agents_and_resources():
    filling = jnp.array([5, 5])
    np.testing.assert_allclose(reward_of_filling(filling, 0, 10, 2, literal=True), 0.25)
    np.testing.assert_allclose(
        reward_of_filling(filling, 1, 10, 2, literal=True), 0.2
    )  # as printed
    np.testing.assert_allclose(reward_of_filling(filling, 2, 10, 2, literal=True), 0.25)


def test_a_reward_of_ones_own_takes_the_place_of_a_scenario():
    def first_come(filling, agents, resources):
        return jnp.array([2.0, 1.0]) * (filling <= agents / resources)

    world = Sharing(scenario=first_come, agents=3)
    _, played = play(world, [[0, 0, 2], [0, 0, 2]])
    np.testing.assert_array_equal(played[1][1].reward["agent"], [0, 0, 1])  # two are too many
    with pytest.raises(InvalidSettings, match=r"scenario gives .* \(\); allowed: .* \(2,\)"):
        play(Sharing(scenario=lambda filling, agents, resources: 1.0), [[0] * 10])


@pytest.mark.parametrize("terminal", [False, True])
def test_the_end_is_a_time_limit_unless_it_is_said_to_be_terminal(terminal):
    _, played = play(Sharing(agents=2, steps=2, terminal=terminal), [[0, 0], [0, 0]])
    (_, before), (_, last) = played
    assert not before.terminated["agent"].any()
    assert not before.truncated["agent"].any()
    assert (last.terminated["agent"] == terminal).all()
    assert (last.truncated["agent"] != terminal).all()


jitted_tally = jax.jit(tally, static_argnums=1)


@given(data=st.data())
def test_the_packed_tally_counts_like_bincount(data):
    agents, size = data.draw(st.sampled_from([(1, 1), (10, 6), (100, 9), (40_000, 3)]))
    entries = data.draw(arrays(np.int32, (2, agents), elements=st.integers(0, size)))
    entries[1, entries[1] == entries[0]] = 0  # at most once per agent
    expected = np.bincount(entries.reshape(-1), minlength=size + 1)[1:]
    np.testing.assert_array_equal(jitted_tally(jnp.asarray(entries), size), expected)


def test_wrong_settings_are_named():
    with pytest.raises(InvalidSettings, match=r"agents = 0: .*greater than or equal to 1"):
        Sharing(agents=0)
    with pytest.raises(UnknownName, match=r"'competitve'\. Did you mean 'competitive'"):
        Sharing(scenario="competitve")


def test_a_scene_shows_who_is_where_wants_what_and_speaks():
    world = Sharing(agents=3, steps=3)
    _, played = play(world, [[0, 1, 3], [1, 1, 2], [1, 3, 3]])
    states = jax.tree.map(lambda *parts: np.stack(parts), *(state for state, _ in played))
    reward = np.stack([outcome.reward["agent"] for _, outcome in played])
    scene = record(states, reward, 2)
    agents = slice(2, None)  # after the two resources
    np.testing.assert_array_equal(scene.tint[:, agents], [[1, 1, 2], [1, 1, 2], [1, 2, 2]])
    said = [[-1 if s < 0 else scene.words[s] for s in row] for row in scene.said[:, agents]]
    assert said == [
        [-1, "coming to 1", "coming to 2"],
        ["staying on 1", "staying on 1", -1],
        ["staying on 1", "coming to 2", "staying on 2"],
    ]
    sites = scene.position[0, :2]
    distance = np.abs(scene.position[1, agents] - sites[[0, 0, 1]]).max(1)
    assert (distance <= 1).all()
    assert len({tuple(at) for at in scene.position[1]}) == 5  # nobody hides another
    np.testing.assert_allclose(scene.series["return"][-1], reward.sum(0))
