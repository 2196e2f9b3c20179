"""What every registered learner promises, in small worlds that suit it."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.learners.toys import Choir, Duet

from ethogram.core.errors import TooLarge
from ethogram.core.keys import trial_keys
from ethogram.core.search_space import SearchSpace
from ethogram.core.spaces import Discrete
from ethogram.learners import LEARNERS
from ethogram.learners.action_heads import encoded_action
from ethogram.learners.base import Learner, undefined_metrics
from ethogram.learners.distributions import epsilon_greedy, gumbel_softmax
from ethogram.learners.dynamic_programming import MonteCarloControl
from ethogram.learners.evolution import CMAES, AgeFitness, Evaluation, Genetic, MAPElites
from ethogram.learners.maddpg import MADDPG
from ethogram.learners.ppo import PPO
from ethogram.learners.qlearning import QLearning
from ethogram.learners.train import Diverged, train
from ethogram.worlds.sharing import Sharing

KEY = jax.random.key(0)
PAY = (1.0, 2.0, 6.0, 8.0)
ODD = (jnp.nan, jnp.inf, -jnp.inf, 1e38, -1e38, 0.0)


class Sphere(eqx.Module):
    deterministic: bool = eqx.field(static=True, default=True)

    def __call__(self, key, genomes):
        del key
        fitness = -(genomes**2).sum(-1)
        return Evaluation(fitness, jnp.zeros(fitness.shape, bool), descriptor=genomes)


LINE = SearchSpace(*np.array([[-1.0], [1.0], [-1.0], [1.0]]))


def age_fitness(size=4):
    return AgeFitness(LINE, Sphere(), size)


def made(name, pay=PAY):
    """A small learner."""
    small = {"batch_size": 4, "learning_starts": 3, "episodes_per_update": 2}
    match name:
        case "age_fitness":
            return age_fitness()
        case "cmaes":
            return CMAES(LINE, Sphere())
        case "genetic":
            return Genetic(LINE, Sphere(), population_size=4, children=4)
        case "map_elites":
            return MAPElites(LINE, Sphere(), cells=3, initial_size=4, batch_size=4)
        case "maddpg":
            return MADDPG(Duet(pay[0]), **small, buffer_size=64, hidden_size=3)
        case "monte_carlo":
            return MonteCarloControl(Choir(pay=pay))
        case "ppo":
            small = {"episodes_per_update": 2, "minibatch_size": 4, "epochs": 2, "hidden_size": 3}
            return PPO(Choir(pay=pay), **small)
        case "qlearning":
            return QLearning(Choir(pay=pay))
    pytest.fail(f"the learner {name!r} has no small instance here: add one")


@pytest.mark.parametrize("name", LEARNERS)
def test_it_has_the_interface_of_all_learners(name):
    learner = made(name)
    assert isinstance(learner, Learner)
    state, metrics = train(learner, KEY, 3)
    assert {*undefined_metrics(learner)} <= {*metrics} - {"episode_return"}
    assert jax.tree.structure(state) == jax.tree.structure(learner.init(KEY))
    returns = metrics["episode_return"]
    if not hasattr(learner, "world"):
        assert returns.shape == (3,)
        return
    world = learner.world
    agents = {role: each.agents for role, each in world.roles.items()}
    assert {role: each.shape[-1] for role, each in returns.items()} == agents
    assert all(each.ndim == 3 for each in returns.values())  # update, episode, agent
    _, observation = world.reset(KEY)
    for explore in (False, True):
        action = learner.policy(state, explore=explore)(KEY, observation)
        world.check(action)


@pytest.mark.parametrize("name", LEARNERS)
def test_update_can_be_given_to_jit_itself_and_keeps_the_shapes_of_the_state(name):
    learner = made(name)
    state = learner.init(KEY)
    after, _ = jax.eval_shape(jax.jit(learner.update), KEY, state)
    assert jax.tree.map(lambda part: (part.shape, part.dtype), after) == jax.tree.map(
        lambda part: (part.shape, part.dtype), state
    )


@pytest.mark.parametrize("name", ["monte_carlo", "qlearning"])
def test_a_table_that_is_no_number_still_chooses_actions_and_stops_the_run(name):
    learner = made(name, pay=(1.0, jnp.nan, 6.0, 8.0))
    broken = jax.tree.map(
        lambda part: part * jnp.nan if part.dtype == float else part, learner.init(KEY)
    )
    act = learner.policy(broken)
    for each in range(5):
        action = act(jax.random.key(each), {"singer": jnp.array([0, 0, 0, 1])})
        assert learner.world.roles["singer"].action.contains(action["singer"]).all()
    with pytest.raises(Diverged, match=r"^episode_return\.singer\[.*1\] is not finite at update 0"):
        train(learner, KEY, 3)


@pytest.mark.parametrize("explore", [True, False])
def test_networks_that_are_no_numbers_still_choose_actions(explore):
    learner = made("maddpg")
    state = learner.init(KEY)
    roles = learner.world.roles
    seen = {
        name: jnp.zeros((role.agents, *role.observation.shape), int) for name, role in roles.items()
    }
    for odd in ODD:
        broken = jax.tree.map(
            lambda part, odd=odd: jnp.full_like(part, odd) if part.dtype == float else part, state
        )
        action = learner.policy(broken, explore=explore)(KEY, seen)
        assert all(role.action.contains(action[name]).all() for name, role in roles.items())
        weights = encoded_action(Discrete(3), KEY, jnp.full((1, 3), odd), 0.5)
        assert abs(weights.sum() - 1) < 1e-5


def test_an_action_is_one_that_there_is_whatever_its_values():
    values = jnp.array([[1.0, jnp.nan, 2.0], [jnp.nan] * 3, *([odd, 1.0, odd] for odd in ODD)]).T
    for seed in range(20):
        bits = jax.random.bits(jax.random.key(seed), values.shape[1:])
        for epsilon in (0.0, 0.5, 1.0):
            chosen = epsilon_greedy(values, bits, epsilon)
            assert ((chosen >= 0) & (chosen < 3)).all()
    bits = jax.random.bits(jax.random.key(0), (8,))
    assert epsilon_greedy(values, bits, 0.0)[3] in (0, 2)  # infinite ones are the highest
    assert epsilon_greedy(values, bits, 0.0)[4] == 1


@pytest.mark.parametrize("straight_through", [False, True])
def test_weights_are_weights_whatever_the_logits(straight_through):
    logits = jnp.array([[odd, other, 0.0] for odd in ODD for other in ODD])
    for key in (None, KEY):
        for temperature in (0.01, 1.0):
            weights = gumbel_softmax(key, logits, temperature, straight_through=straight_through)
            assert (weights >= 0).all()
            np.testing.assert_allclose(weights.sum(-1), 1.0, rtol=1e-5)


def test_what_is_counted_is_what_is_allocated(monkeypatch):
    learner = made("maddpg")
    allocated = sum(part.nbytes for part in jax.tree.leaves(learner.init(KEY)))
    counted = learner.network_bytes + learner.replay_bytes
    counters = 4 * (2 + 2 * 2)  # of updates and transitions, and of each network's steps
    assert allocated == counted + counters
    learner = made("monte_carlo")
    state = learner.init(KEY)
    needs = sum(part.nbytes for part in jax.tree.leaves((state.value, state.visits)))
    monkeypatch.setattr("ethogram.core.memory.available_memory", lambda: needs - 1)
    with pytest.raises(TooLarge, match=rf"Monte Carlo control needs {needs} bytes of memory"):
        learner.init(KEY)


def test_what_does_not_fit_is_refused_with_its_size_before_it_is_allocated(monkeypatch):
    monkeypatch.setattr("ethogram.core.memory.available_memory", lambda: 8_000_000_000)
    with pytest.raises(TooLarge, match=r"MADDPG with 14\.2 GB of networks and a replay buffer of"):
        MADDPG(Sharing()).init(KEY)
    with pytest.raises(TooLarge, match=r"Evolution of 100,000 individuals .* needs"):
        age_fitness(100_000).init(KEY)
    with pytest.raises(TooLarge, match=r"Q-learning with 1000 trials .* needs"):
        QLearning(Sharing()).init(trial_keys(0, "contract", 1000))
