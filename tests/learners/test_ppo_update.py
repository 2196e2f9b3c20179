"""What an update of PPO learns from, how it adapts, and what it reports."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.oracles import ppo as oracle

from ethogram.core.settings import Number
from ethogram.core.spaces import Box, Discrete
from ethogram.core.world import Outcome, Role, Transition, World
from ethogram.learners.experience import Choice, Estimation, experience
from ethogram.learners.ppo import PPO
from ethogram.learners.schedules import Linear

KEY = jax.random.key(3)
ENDS = np.array([3, 1, 2])  # steps until a worker's own end


class Overtime(World):
    """Three workers at work for three steps, who earn by what they choose.

    The second ends for good after one step, the time of the third is up after two.  Both stay at
    work, and earn what `overtime` says.
    """

    pay: Number = eqx.field(default=1.0, converter=jnp.asarray)
    overtime: Number = eqx.field(default=0.0, converter=jnp.asarray)

    @property
    def horizon(self):
        return 3

    @property
    def roles(self):
        return {"worker": Role(3, Box(0.0, 3.0, (2,)), Discrete(2))}

    def reset(self, key):
        del key  # they always begin alike
        return jnp.int32(0), self.observe(jnp.int32(0))

    def observe(self, state):
        return {"worker": jnp.stack([jnp.arange(3.0), jnp.full(3, state, float)], -1)}

    def step(self, key, state, action):
        del key  # nothing is left to chance
        ended, timed = state + 1 >= ENDS, jnp.array([True, False, True])
        earned = self.pay * action["worker"] * (1 + state)
        return state + 1, Outcome(
            observation=self.observe(state + 1),
            reward={"worker": earned + self.overtime * (state >= ENDS)},
            terminated={"worker": ended & ~timed},
            truncated={"worker": ended & timed},
        )


def learner(epochs=2, entropy=0.5, target=0.01, **named):
    """Whose entropy coefficient falls to 0 in one update, and whose epochs are one minibatch."""
    return PPO(
        Overtime(**named),
        learning_rate=0.1,
        entropy_coefficient=Linear(entropy, 0.0, 1),
        kl_coefficient=0.3,
        kl_target=target,
        epochs=epochs,
        episodes_per_update=2,
        hidden_size=4,
    )


@eqx.filter_jit
def update(learner, state):
    return learner.update(KEY, state)


@pytest.fixture(scope="module")
def start():
    return eqx.filter_jit(lambda learner: learner.init(jax.random.key(4)))(learner())


def networks(state):
    network = state.roles["worker"].network
    return oracle.Networks.of(jax.tree.map(lambda part: part[0], network))


def test_the_divergence_that_is_reported_is_that_of_the_last_epoch(start):
    once, _ = update(learner(epochs=1), start)
    acted = np.array([[w, t] for w in range(3) for t in range(ENDS[w])], float)
    old, new = (networks(state)(acted, acted)[0] for state in (start, once))
    wanted = oracle.kl((2,), old, None, new, None).mean()
    _, metrics = update(learner(), start)  # its second epoch begins where that one ended
    assert wanted > 1e-4
    np.testing.assert_allclose(metrics["kl"]["worker"], wanted, rtol=1e-3)


def test_the_penalty_on_divergence_is_adapted_by_that_divergence(start):
    kl = float(update(learner(), start)[1]["kl"]["worker"])
    for times_kl, factor in ((1.0, 1.0), (0.45, 1.5), (2.2, 0.5)):
        after, metrics = update(learner(target=times_kl * kl), start)
        np.testing.assert_allclose(metrics["kl"]["worker"], kl, rtol=1e-6)
        for found in (after.roles["worker"].kl_coefficient[0], metrics["kl_coefficient"]["worker"]):
            np.testing.assert_allclose(found, 0.3 * factor, rtol=1e-6)


def test_a_schedule_of_the_entropy_coefficient_is_followed(start):
    later = dataclasses.replace(start, updates=start.updates + 1)
    falling, fallen = (update(learner(), each)[0].roles["worker"] for each in (start, later))
    never = update(learner(entropy=0.0), later)[0].roles["worker"]
    assert eqx.tree_equal(fallen.network, never.network)
    assert not eqx.tree_equal(falling.network, fallen.network)


def test_what_an_agent_earns_after_its_own_end_changes_nothing(start):
    found = update(learner(), start)
    assert eqx.tree_equal(update(learner(overtime=100.0), start), found)
    assert not eqx.tree_equal(update(learner(pay=2.0), start), found)


def test_advantages_are_cut_where_the_time_of_an_agent_is_up():
    def steps(*values):
        return {"worker": jnp.array(values)[None, :, None]}

    outcome = Outcome(
        observation={},
        reward=steps(1.0, 2.0, 4.0),
        terminated=steps(False, False, False),
        truncated=steps(False, True, False),
    )
    value, next_value = steps(10.0, 20.0, 40.0), steps(20.0, 30.0, 50.0)
    choice = Choice(value, steps(0.0, 0.0, 0.0), value, next_value)
    ends = jnp.array([[False, False, True]])
    played = Transition(KEY, None, {}, {}, outcome, None, ends, choice)
    acting = steps(True, True, False)["worker"]
    found = experience("worker", None, played, acting, Estimation(0.5, 1.0, 0))
    # 2 + 30 / 2 - 20 = -3, and 1 + 20 / 2 - 10 - 3 / 2; the third step is of another life
    np.testing.assert_allclose(found.advantage[:, 0], [-0.5, -3.0, 0.0], rtol=1e-6)
    np.testing.assert_allclose(found.target[:2, 0], [9.5, 17.0], rtol=1e-6)
