from itertools import product

import equinox as eqx
import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from jaxtyping import TypeCheckError

from ethogram.core.errors import EthogramError, InvalidSettings
from ethogram.core.rollout import rollout
from ethogram.core.spaces import Box
from ethogram.core.world import Role
from ethogram.learners.dynamic_programming import (
    DecisionProcess,
    MonteCarloControl,
    discounted_returns,
    value_iteration,
)
from ethogram.learners.schedules import Constant
from ethogram.learners.train import train

LEFT, RIGHT = 0, 1
DISCOUNT = 0.9

solve = eqx.filter_jit(value_iteration)


def chain(chance: float, steps: int = 100) -> DecisionProcess:
    """Four states in a row, the last one terminal; reaching it earns 1.

    `RIGHT` moves on with this chance and else stays; `LEFT` always moves back.
    """
    transition = np.zeros((4, 2, 4))
    for state in range(4):
        transition[state, LEFT, max(state - 1, 0)] = 1.0
        transition[state, RIGHT, state] = 1.0 - chance
        transition[state, RIGHT, min(state + 1, 3)] += chance
    return DecisionProcess(
        transition=jnp.asarray(transition, jnp.float32),
        reward=jnp.zeros((4, 2, 4)).at[2, RIGHT, 3].set(1.0),
        terminal=jnp.arange(4) == 3,
        start=jnp.array([1.0, 1.0, 1.0, 0.0]) / 3,
        steps=steps,
    )


def corridor(steps: int) -> DecisionProcess:
    """One action: stay in state 0 and earn 1, for as long as the episode lasts."""
    return DecisionProcess(
        transition=jnp.ones((1, 1, 1)),
        reward=jnp.ones((1, 1, 1)),
        terminal=jnp.zeros(1, bool),
        start=jnp.ones(1),
        steps=steps,
    )


def test_a_sure_chain_is_worth_the_discount_to_the_power_of_the_distance():
    optimum = solve(chain(1.0), DISCOUNT)
    np.testing.assert_allclose(optimum.value, [0.81, 0.9, 1.0, 0.0], rtol=1e-6)
    np.testing.assert_array_equal(optimum.policy[:3], RIGHT)
    expected = [[0.729, 0.81], [0.729, 0.9], [0.81, 1.0], [0.0, 0.0]]  # left, right
    np.testing.assert_allclose(optimum.action_value, expected, rtol=1e-6)


def test_a_slippery_chain_has_the_value_worked_by_hand():
    # V(2) = 0.8 + 0.2 gamma V(2), and each state before is worth 0.8 gamma / (1 - 0.2 gamma) of it
    last, ratio = 0.8 / 0.82, 0.72 / 0.82
    optimum = solve(chain(0.8), DISCOUNT)
    np.testing.assert_allclose(optimum.value, [last * ratio**2, last * ratio, last, 0], rtol=1e-5)


def test_without_foresight_only_the_next_reward_counts():
    np.testing.assert_allclose(solve(chain(0.8), 0.0).value, [0.0, 0.0, 0.8, 0.0])


def test_values_that_grow_without_end_stop_at_the_limit_of_sweeps_and_show_it():
    optimum = solve(corridor(3), 1.0, sweeps=50)
    assert int(optimum.sweeps) == 50
    assert float(optimum.residual) == 1.0


tables = st.integers(0, 2**31).map(np.random.default_rng)


def best_of_all_policies(process: DecisionProcess, discount: float) -> np.ndarray:
    """V* by solving V = R + gamma P V for every deterministic policy (NumPy, in doubles)."""
    transition = np.asarray(process.transition, float)
    earned = (transition * np.asarray(process.reward, float)).sum(-1)
    running = ~np.asarray(process.terminal)
    states = np.arange(len(running))
    best = np.full(len(running), -np.inf)
    for actions in product(range(transition.shape[1]), repeat=len(running)):
        step = transition[states, actions] * running * running[:, None]
        value = np.linalg.solve(
            np.eye(len(running)) - discount * step, earned[states, actions] * running
        )
        best = np.maximum(best, value)
    return best


@given(rng=tables, discount=st.sampled_from([0.0, 0.5, 0.95]))
def test_the_optimum_is_that_of_the_best_of_all_policies(rng, discount):
    process = DecisionProcess(
        transition=jnp.asarray(rng.dirichlet(np.ones(3), (3, 2)), jnp.float32),
        reward=jnp.asarray(rng.normal(size=(3, 2, 3)), jnp.float32),
        terminal=jnp.asarray(rng.random(3) < 0.3),
        start=jnp.ones(3) / 3,
    )
    optimum = solve(process, jnp.float32(discount))
    np.testing.assert_allclose(
        optimum.value, best_of_all_policies(process, discount), rtol=1e-3, atol=1e-4
    )


def test_exploring_costs_value_in_every_state_but_the_last():
    optimum = solve(chain(0.8), DISCOUNT)
    exploring = solve(chain(0.8), DISCOUNT, epsilon=0.3)
    assert (exploring.value[:3] < optimum.value[:3]).all()
    assert exploring.value[3] == 0


def test_monte_carlo_control_agrees_with_value_iteration():
    process, explore = chain(0.8), 0.2
    learner = MonteCarloControl(process, epsilon=Constant(explore), discount=DISCOUNT)
    state, _ = train(learner, jax.random.key(3), 4000)
    reference = solve(process, DISCOUNT, epsilon=explore)
    value = state.value["agent"][0]
    np.testing.assert_allclose(value[:3], reference.action_value[:3], atol=0.03)
    np.testing.assert_array_equal(value[:3].argmax(-1), solve(process, DISCOUNT).policy[:3])
    assert state.visits["agent"].sum() > 4000
    assert (value[3] == 0).all()  # nobody acts in a terminal state


def test_every_visit_is_averaged():
    # Returns of the three visits at gamma 1/2: 1.75, 1.5 and 1.
    learner = MonteCarloControl(corridor(3), discount=0.5)
    state, metrics = learner.update(jax.random.key(0), learner.init(jax.random.key(0)))
    assert float(state.visits["agent"].sum()) == 3
    np.testing.assert_allclose(state.value["agent"], 4.25 / 3, rtol=1e-6)
    np.testing.assert_allclose(metrics["episode_return"]["agent"], [[3.0]])
    again, _ = learner.update(jax.random.key(1), state)
    np.testing.assert_allclose(again.value["agent"], 4.25 / 3, rtol=1e-6)
    assert int(again.episode) == 2


def test_what_follows_the_end_of_an_episode_counts_for_nothing():
    learner = MonteCarloControl(chain(1.0, steps=50), epsilon=Constant(0.0))
    state = learner.init(jax.random.key(0))
    right = {"agent": state.value["agent"].at[..., RIGHT].set(1.0)}
    state = eqx.tree_at(lambda at: at.value, state, right)
    state, metrics = learner.update(jax.random.key(0), state)
    assert float(state.visits["agent"].sum()) <= 3
    np.testing.assert_allclose(metrics["episode_return"]["agent"], [[1.0]])


def test_returns_are_discounted_backwards():
    reward = jnp.array([[1.0], [2.0], [4.0]])
    np.testing.assert_allclose(discounted_returns(reward, 0.5), [[3.0], [4.0], [4.0]])


def test_a_decision_process_ends_in_a_terminal_state_or_at_its_time_limit():
    def always_right(key, observation):
        del key  # no chance in it
        return {"agent": jnp.full_like(observation["agent"], RIGHT)}

    _, steps = rollout(chain(0.5, steps=2), always_right, jax.random.key(1), 200)
    reached = steps.outcome.observation["agent"][:, 0]
    terminated, truncated = steps.outcome.terminated["agent"], steps.outcome.truncated["agent"]
    np.testing.assert_array_equal(terminated[:, 0], reached == 3)
    assert not (terminated & truncated).any()
    assert truncated.any()
    assert terminated.any()
    starts = steps.observation["agent"][1:, 0][steps.episode_end[:-1]]
    assert set(np.asarray(starts).tolist()) == {0, 1, 2}
    np.testing.assert_array_equal(steps.outcome.reward["agent"], terminated.astype(float))


@pytest.mark.parametrize("row", [[0.5, 0.4], [1.5, -0.5], [jnp.nan, 1.0]])
def test_tables_that_hold_no_probabilities_are_refused(row):
    with pytest.raises(InvalidSettings, match="transition needs chances"):
        DecisionProcess(
            transition=jnp.array([[row], [[0.0, 1.0]]]),
            reward=jnp.zeros((2, 1, 2)),
            terminal=jnp.zeros(2, bool),
            start=jnp.array([1.0, 0.0]),
        )


class Unbounded(DecisionProcess):
    """A process whose agent sees real numbers."""

    @property
    def roles(self) -> dict[str, Role]:
        (role,) = super().roles.values()
        return {"agent": Role(1, Box(0.0, 1.0, ()), role.action)}


def test_monte_carlo_control_refuses_a_world_without_discrete_spaces():
    plain = corridor(3)
    world = Unbounded(plain.transition, plain.reward, plain.terminal, plain.start)
    with pytest.raises(EthogramError, match="'agent' of Unbounded observes Box"):
        MonteCarloControl(world).init(jax.random.key(0))


def test_the_tests_check_the_shapes_of_arrays():
    with pytest.raises(TypeCheckError, match="terminal"):
        DecisionProcess(jnp.ones((1, 1, 1)), jnp.ones((1, 1, 1)), jnp.zeros(2, bool), jnp.ones(1))
