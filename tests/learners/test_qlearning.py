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
from ethogram.learners.dynamic_programming import DecisionProcess, value_iteration
from ethogram.learners.exploration import Constant, epsilon_greedy
from ethogram.learners.qlearning import QLearning
from ethogram.learners.train import train
from ethogram.worlds.sharing import Sharing

SMALL = {"agents": 3, "resources": 2, "steps": 20}


def ignore(done, learned, metrics):
    """Nothing to do between chunks."""


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
    learner = QLearning(world, Constant(0.3), rate=0.02, discount=0.9, trials=50)
    learned = train(
        learner,
        trial_keys(0, "chain", 50),
        learner.init(),
        2000,
        after_chunk=ignore,
    )
    table = learned.table["agent"].reshape(50, 4, 2)[:, :3].mean(0)
    optimum = value_iteration(world, 0.9).action_value[:3]
    np.testing.assert_allclose(table, optimum, atol=0.02)


@pytest.mark.parametrize("terminal", [False, True])
def test_tables_are_those_of_agents_that_keep_dictionaries(terminal):
    """Two trials of three episodes, replayed with sparse tables and the printed update."""
    world = Sharing(scenario="mixed", **SMALL, terminal=terminal)
    trials, episodes, explore = 2, 3, 0.5
    learner = QLearning(world, Constant(explore), rate=0.1, discount=0.9, trials=trials)
    keys = trial_keys(1, "oracle", trials)
    learned = train(learner, keys, learner.init(), episodes, after_chunk=ignore)
    table = np.asarray(learned.table["agent"]).reshape(trials, world.agents, world.rows, 4)
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
    learner = QLearning(Sharing(**SMALL), trials=2)
    keys = trial_keys(0, "resume", 2)
    whole = train(learner, keys, learner.init(), 6, after_chunk=ignore)
    half = train(learner, keys, learner.init(), 4, after_chunk=ignore)
    rest = train(learner, keys, half, 6, after_chunk=ignore, start=4)
    jax.tree.map(np.testing.assert_array_equal, whole, rest)


def test_metrics_are_the_returns_of_each_trial_and_agent():
    learner = QLearning(Sharing(**SMALL), Constant(1.0), trials=2)
    seen = []

    def watch(done, learned, metrics):
        assert learned.episode == done
        seen.append((done, metrics["return"]["agent"]))

    keys = trial_keys(0, "metrics", 2)
    train(learner, keys, learner.init(), 3, after_chunk=watch, seconds=0)
    assert [(done, returns.shape) for done, returns in seen] == [(n, (1, 2, 3)) for n in (1, 2, 3)]
    assert all((returns > 0).all() and (returns <= 19).all() for _, returns in seen)


def test_a_policy_acts_by_the_tables_of_its_trial():
    world = Sharing(**SMALL, communication="none")
    learner = QLearning(world, trials=2)
    learned = learner.init()
    table = learned.table["agent"].reshape(2, 3, world.rows, 2)
    table = table.at[0, :, :, 0].set(1.0).at[1, :, :, 1].set(1.0)  # trial 0 wants resource 1
    learned = eqx.tree_at(lambda state: state.table["agent"], learned, table.reshape(-1, 2))
    for trial in (0, 1):
        _, played = rollout(world, learner.policy(learned, trial), jax.random.key(0), 20)
        assert (played.next_state.preference == trial + 1).all()


def test_tables_that_do_not_fit_are_refused_with_the_size_they_need():
    world = Sharing(agents=20, resources=3)
    size = 20 * world.rows * 6 * 4
    with pytest.raises(TooLarge, match=rf"20 agent tables of {world.rows:,} x 6 needs"):
        QLearning(world).init()
    assert QLearning(world).table_bytes == size
    with pytest.raises(TooLarge, match=r"more rows than 32 bits can number|needs .* of memory"):
        QLearning(Sharing(), trials=2000).init()


def test_spaces_that_are_not_discrete_are_refused_by_name():
    with pytest.raises(EthogramError, match=r"discrete spaces; 'agent' of Sharing has MultiD"):
        QLearning(Sharing(encoding="vector")).init()


def test_a_shared_table_moves_as_by_one_update_after_the_other():
    """Singers on one step that sing one note: towards the mean of what they earn, n times."""
    world, rate = Choir(), 0.1
    learner = QLearning(world, Constant(1.0), rate=rate, trials=40, shared=True)
    keys = trial_keys(0, "choir", 40)
    learned = train(learner, keys, learner.init(), 1, after_chunk=ignore)
    table = np.asarray(learned.table["singer"]).reshape(40, 2, 2)
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
    learner = QLearning(world, trials=2, shared=True)
    learned = learner.init()
    learned = eqx.tree_at(
        lambda each: each.table["singer"], learned, jnp.array([[0, 1], [1, 0], [1, 0], [0, 1.0]])
    )
    _, seen = world.reset(jax.random.key(0))
    for trial, expected in ((0, [1, 1, 1, 0]), (1, [0, 0, 0, 1])):
        action = learner.policy(learned, trial)(jax.random.key(1), seen)
        assert action["singer"].tolist() == expected
    assert "1 singer tables of 2 x 2" in learner.size
