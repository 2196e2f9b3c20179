import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.learners.toys import Choir
from tests.oracles import sharing as oracle

from ethogram.core.errors import EthogramError, TooLarge
from ethogram.core.keys import counter_bits, fold_in, trial_keys
from ethogram.core.rollout import rollout
from ethogram.learners.base import Trials
from ethogram.learners.distributions import epsilon_greedy
from ethogram.learners.dynamic_programming import DecisionProcess, value_iteration
from ethogram.learners.qlearning import QLearning, QLearningState
from ethogram.learners.schedules import Constant
from ethogram.learners.train import train
from ethogram.worlds.sharing import Sharing

SMALL = {"agents": 3, "resources": 2, "steps": 20}


def chain():
    """Four states in a row; action 1 moves on with chance 0.8; reaching the last one earns 1."""
    transition = np.zeros((4, 2, 4))
    for state in range(4):
        transition[state, 0, max(state - 1, 0)] = 1.0
        transition[state, 1, state] += 0.2
        transition[state, 1, min(state + 1, 3)] += 0.8
    reward = np.zeros((4, 2, 4))
    reward[2, 1, 3] = 1.0
    return DecisionProcess(
        transition=jnp.asarray(transition, jnp.float32),
        reward=jnp.asarray(reward, jnp.float32),
        terminal=jnp.arange(4) == 3,
        start=jnp.array([1.0, 1.0, 1.0, 0.0]) / 3,
        steps=30,
    )


def test_it_reaches_the_optimum_that_value_iteration_finds():
    world = chain()
    learner = QLearning(world, Constant(0.3), learning_rate=0.02, discount=0.9)
    state, _ = train(learner, trial_keys(0, "chain", 50), 2000)
    table = state.table["agent"].reshape(50, 4, 2)[:, :3].mean(0)
    optimum = value_iteration(world, 0.9).action_value[:3]
    np.testing.assert_allclose(table, optimum, atol=0.02)


@pytest.mark.parametrize("terminal", [False, True])
def test_tables_are_those_of_agents_that_keep_dictionaries(terminal):
    """Two trials of three episodes, replayed with sparse tables and the printed update."""
    world = Sharing(scenario="mixed", **SMALL, terminal=terminal)
    trials, episodes, explore = 2, 3, 0.5
    learner = QLearning(world, Constant(explore), learning_rate=0.1, discount=0.9)
    keys = trial_keys(1, "oracle", trials)
    state, _ = train(learner, keys, episodes)
    table = np.asarray(state.table["agent"])
    assert table.shape == (trials, world.agents, world.rows, 4)
    for trial in range(trials):
        agents, rows = _replay(world, keys[trial], episodes, explore)
        assert sum(len(agent.table) for agent in agents) > 100
        for number, agent in enumerate(agents):
            for observation, values in agent.table.items():
                found = table[trial, number, rows[observation]]
                np.testing.assert_allclose(found, values, rtol=1e-5, atol=1e-7)
        visited = set(rows.values())
        untouched = [row for row in range(world.rows) if row not in visited]
        assert not table[trial][:, untouched].any()


def _replay(world, key, episodes, explore):
    """Agents with dictionaries, and the table row of each observation met."""
    agents = [oracle.Learner(4, 0.1, 0.9) for _ in range(world.agents)]
    rows = {}
    step = eqx.filter_jit(world.step)
    for episode in range(episodes):
        episode_key = fold_in(key, episode)
        group = oracle.Group(world.agents, world.resources, "mixed", "optional", True)
        for_start, for_choices = fold_in(episode_key, 0), fold_in(episode_key, 1)
        state, seen = world.reset(for_start)
        for time in range(world.steps):
            before = group.observations()
            values = np.stack([a.values(o) for a, o in zip(agents, before, strict=True)])
            rows |= dict(zip(before, np.asarray(seen["agent"]).tolist(), strict=True))
            bits = counter_bits(for_choices, time * world.agents + jnp.arange(world.agents))
            actions = np.asarray(epsilon_greedy(jnp.asarray(values.T, jnp.float32), bits, explore))
            group.step(actions)
            state, outcome = step(episode_key, state, {"agent": jnp.asarray(actions)})
            seen = outcome.observation
            after = group.observations()
            rows |= dict(zip(after, np.asarray(seen["agent"]).tolist(), strict=True))
            over = world.terminal and time == world.steps - 1
            # all read the table before anyone writes: tables are private, so order is free
            for agent, *what in zip(agents, before, actions, group.rewards(), after, strict=True):
                agent.learn(*what, over)
    return agents, rows


def test_an_interrupted_training_goes_on_to_the_same_tables():
    learner, keys = QLearning(Sharing(**SMALL)), trial_keys(0, "resume", 2)
    whole, _ = train(learner, keys, 6)
    half, _ = train(learner, keys, 4)
    rest, _ = train(learner, keys, 6, state=half, start=4)
    jax.tree.map(np.testing.assert_array_equal, whole, rest)


@pytest.mark.parametrize("shared", [False, True])
def test_trials_side_by_side_are_as_many_trials_alone(shared):
    learner, keys = QLearning(Sharing(**SMALL), shared=shared), trial_keys(0, "alone", 2)
    fast = train(learner, keys, 3)
    mapped = train(Trials(learner), keys, 3)
    alone = [train(learner, key, 3) for key in keys]
    jax.tree.map(np.testing.assert_array_equal, fast, mapped)
    for trial, one in enumerate(alone):
        ours = jax.tree.map(lambda part, trial=trial: part[trial], fast.state)
        jax.tree.map(np.testing.assert_array_equal, ours, one.state)
        for role, earned in one.metrics["episode_return"].items():
            np.testing.assert_array_equal(fast.metrics["episode_return"][role][:, trial], earned)


def test_metrics_are_the_returns_of_each_trial_and_agent():
    learner = QLearning(Sharing(**SMALL), Constant(1.0))
    state, metrics = train(learner, trial_keys(0, "metrics", 2), 3)
    assert state.episode.tolist() == [3, 3]
    returns = metrics["episode_return"]["agent"]
    assert returns.shape == (3, 2, 1, 3)  # updates, trials, episodes, agents
    assert (returns > 0).all()
    assert (returns <= 19).all()


def test_a_policy_acts_by_the_tables_of_its_trial():
    world = Sharing(**SMALL, communication="none")
    learner, keys = QLearning(world), jax.random.split(jax.random.key(0))
    state = learner.init(keys)
    table = state.table["agent"]
    table = table.at[0, :, :, 0].set(1.0).at[1, :, :, 1].set(1.0)  # trial 0 wants resource 1
    state = eqx.tree_at(lambda state: state.table["agent"], state, table)

    @jax.vmap
    def play(state, key):
        return rollout(world, learner.policy(state), key, 20)[1]

    preference = play(state, keys).next_state.preference
    for trial in (0, 1):
        assert (preference[trial] == trial + 1).all()


def test_tables_that_do_not_fit_are_refused_with_the_size_they_need():
    world = Sharing(agents=20, resources=3)
    size = 20 * world.rows * 6 * 4
    with pytest.raises(TooLarge, match=rf"20 agent tables of {world.rows:,} x 6 needs"):
        QLearning(world).init(jax.random.key(0))
    assert QLearning(world).table_bytes() == size
    with pytest.raises(TooLarge, match=r"more rows than 32 bits can number|needs .* of memory"):
        QLearning(Sharing()).init(trial_keys(0, "many", 2000))


def test_spaces_that_are_not_discrete_are_refused_by_name():
    with pytest.raises(EthogramError, match=r"discrete spaces; 'agent' of Sharing has MultiD"):
        QLearning(Sharing(encoding="vector")).init(jax.random.key(0))


def test_a_shared_table_moves_as_by_one_update_after_the_other():
    """Singers on one step that sing one note: towards the mean of what they earn, n times."""
    world, rate = Choir(), 0.1
    learner = QLearning(world, Constant(1.0), learning_rate=rate, shared=True)
    state, _ = train(learner, trial_keys(0, "choir", 40), 1)
    table = np.asarray(state.table["singer"]).reshape(40, 2, 2)
    pay = np.asarray(world.pay)
    seen = set()
    for trial in table:
        assert sorted(trial[1].tolist()) == pytest.approx([0.0, rate * pay[3]])
        subsets = [
            [singer for singer in range(3) if note >> singer & 1] for note in range(8)
        ]  # of the three on the first step, who may have sung note 0
        made = [
            [
                (1 - (1 - rate) ** len(who)) * (pay[who].mean() if who else 0.0)
                for who in (low, [singer for singer in range(3) if singer not in low])
            ]
            for low in subsets
        ]
        (which,) = [n for n, row in enumerate(made) if np.allclose(row, trial[0], atol=1e-6)]
        seen.add(which)
    assert len(seen) > 4


def test_agents_that_share_a_table_act_by_the_same_row():
    world = Choir()
    learner = QLearning(world, shared=True)
    _, seen = world.reset(jax.random.key(0))
    for table, expected in (([[0, 1], [1, 0]], [1, 1, 1, 0]), ([[1, 0], [0, 1]], [0, 0, 0, 1])):
        state = QLearningState({"singer": jnp.array([table], float)}, jnp.int32(0))
        action = learner.policy(state)(jax.random.key(1), seen)
        assert action["singer"].tolist() == expected
    assert learner.size(2) == "2 trials x 1 singer tables of 2 x 2"


class Injured(Choir):
    """A choir whose first singer is out: neither in play nor at the end of her episode."""

    def step(self, key, state, action):
        after, outcome = super().step(key, state, action)
        acting = {"singer": jnp.arange(len(self.stand)) > 0}
        return after, dataclasses.replace(outcome, acting=acting)


@pytest.mark.parametrize("shared", [False, True])
def test_who_is_not_in_play_learns_nothing(shared):
    world = Injured(stand=(0, 1, 1, 1))
    learner = QLearning(world, Constant(1.0), learning_rate=0.5, shared=shared)
    state, metrics = train(learner, jax.random.key(0), 1)
    table = state.table["singer"]
    assert not table[0, 0].any()  # only the first stands there
    assert table[0 if shared else 1, 1].any()
    np.testing.assert_array_equal(metrics["episode_return"]["singer"][0, 0], world.pay)
