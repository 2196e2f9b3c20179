import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.learners.toys import Choir, Market, Recital

from ethogram.core.errors import InvalidSettings, TooLarge
from ethogram.core.spaces import Box, Discrete
from ethogram.core.world import Outcome, Role, World
from ethogram.learners.base import Trials
from ethogram.learners.ppo import METRICS, PPO, PRESETS
from ethogram.learners.ppo_update import shuffled, standardized
from ethogram.learners.schedules import Linear
from ethogram.learners.train import Diverged, train
from ethogram.worlds.sharing import Sharing

KEY = jax.random.key(0)
FAST = {"learning_rate": 0.02, "hidden_size": 8, "minibatch_size": 32, "epochs": 4}


class Darts(World):
    """Two players whose darts should hit the numbers they are told.  One step, and it is over."""

    @property
    def horizon(self):
        return 1

    @property
    def roles(self):
        return {"player": Role(2, Box(-1.0, 1.0, (1,)), Box(-2.0, 4.0, (1,)))}

    def reset(self, key):
        told = jax.random.uniform(key, (2, 1), minval=-1.0)
        return told, {"player": told}

    def observe(self, state):
        return {"player": state}

    def step(self, key, state, action):
        del key  # it flies straight
        missed = jnp.square(action["player"] - (1 + 2 * state))[:, 0]
        return state, Outcome(
            observation={"player": state},
            reward={"player": -missed},
            terminated={"player": jnp.ones(2, bool)},
            truncated={"player": jnp.zeros(2, bool)},
        )


@eqx.filter_jit
def reset(world):
    return world.reset(KEY)[1]


@eqx.filter_jit
def act(learner, state, observation, explore=False):
    return learner.policy(state, explore=explore)(KEY, observation)


def test_choices_and_chords_that_pay_are_found():
    learner = PPO(Recital(final=True), episodes_per_update=32, **FAST)
    state, metrics = train(learner, KEY, 20)
    assert metrics["episode_return"]["pianist"][0].mean() < 0.5
    assert metrics["episode_return"]["pianist"][-1].mean() > 0.9
    chord = act(learner, state, reset(learner.world))["pianist"]
    np.testing.assert_array_equal(chord, [[2, 1]])


@pytest.mark.parametrize("squash", [False, True])
def test_numbers_in_a_box_are_found(squash):
    learner = PPO(Darts(), episodes_per_update=64, squash=squash, **FAST)
    state, metrics = train(learner, KEY, 15)  # at so high a rate later updates may spoil it
    assert metrics["episode_return"]["player"][0].mean() < -2
    told = jnp.linspace(-0.9, 0.9, 8).reshape(4, 2, 1)
    hit = jax.vmap(lambda seen: act(learner, state, {"player": seen})["player"])(told)
    assert jnp.square(hit - (1 + 2 * told)).mean() < 0.5  # a dart into the middle misses by 1.4


@pytest.mark.parametrize("preset", PRESETS)
def test_presets_make_learners(preset):
    learner = PPO(Choir(), **PRESETS[preset])
    assert set(PRESETS[preset]) <= {*dir(learner)}


def test_defaults_are_the_preset_modern():
    learner = PPO(Choir())
    assert (learner.gae_lambda, learner.clip, learner.epochs) == pytest.approx((0.95, 0.2, 10))
    assert (learner.learning_rate(jnp.int32(0)), learner.max_gradient_norm) == pytest.approx(
        (3e-4, 0.5)
    )
    assert (learner.initialization, learner.advantages) == ("orthogonal", "minibatch")


@pytest.fixture(scope="module")
def darts():
    """Two players, each with a policy of its own, and a learning rate that falls to 0."""
    return PPO(
        Darts(),
        learning_rate=Linear(0.01, 0.0, 2),
        shared=False,
        hidden_size=4,
        epochs=1,
        episodes_per_update=2,
    )


@pytest.fixture(scope="module")
def start(darts):
    return jax.jit(darts.init)(KEY)


def run(darts, state, updates, **named):
    return train(darts, KEY, updates, state=jax.tree.map(jnp.copy, state), **named)


@pytest.fixture(scope="module")
def trained(darts, start):
    return run(darts, start, 4)


def test_metrics_are_of_each_agent(trained):
    for name in METRICS:
        assert trained.metrics[name]["player"].shape == (4, 2)
    assert trained.metrics["episode_return"]["player"].shape == (4, 2, 2)
    assert trained.state.updates == 4


def test_a_schedule_of_the_learning_rate_is_followed(darts, start, trained):
    after = run(darts, start, 2).state.roles["player"].network
    assert eqx.tree_equal(after, trained.state.roles["player"].network)  # by then the rate is 0
    assert not eqx.tree_equal(after, start.roles["player"].network)


def test_a_run_that_is_taken_up_again_ends_alike(darts, start, trained):
    half = run(darts, start, 1).state
    assert eqx.tree_equal(run(darts, half, 4, start=1).state, trained.state)


def test_a_loss_that_diverges_names_metric_agent_and_update(darts, start):
    def weight(state):
        return state.roles["player"].network.critic.biases[-1]

    broken = eqx.tree_at(weight, start, weight(start).at[1].set(jnp.nan))  # of the second player
    said = r"^policy_loss\.player\[1\] is not finite at update 7; after 7 updates all was\.$"
    with pytest.raises(Diverged, match=said):
        run(darts, broken, 9, start=7)


def test_a_trial_depends_on_its_own_key_alone(darts, start):
    pair = jax.tree.map(lambda part: jnp.stack([part, part]), start)
    both, _ = jax.jit(Trials(darts).update)(jax.random.split(KEY, 2), pair)
    alone, _ = jax.jit(darts.update)(jax.random.split(KEY, 2)[1], start)
    assert jnp.not_equal(*both.roles["player"].network.actor.weights[0]).any()
    for two, one in zip(jax.tree.leaves(both), jax.tree.leaves(alone), strict=True):
        np.testing.assert_allclose(two[1], one, rtol=1e-5, atol=1e-6)


@pytest.fixture(scope="module")
def market():
    """Two roles with spaces of different kinds, and what has learned nothing in it."""
    learner = PPO(Market(), shared=False, hidden_size=4)
    return learner, jax.jit(learner.init)(KEY)


def test_policies_of_agents_are_different_and_act_in_their_spaces(market):
    learner, state = market
    assert not jnp.allclose(*state.roles["seller"].network.actor.weights[0])
    observation = reset(learner.world)
    for explore in (False, True):
        learner.world.check(act(learner, state, observation, explore))


@pytest.mark.parametrize("explore", [False, True])
def test_networks_that_are_no_numbers_still_choose_actions(market, explore):
    learner, state = market
    observation = reset(learner.world)
    for odd in (np.nan, np.inf, -np.inf, 1e38):
        broken = jax.tree.map(
            lambda part, odd=odd: jnp.full_like(part, odd) if part.dtype == float else part, state
        )
        learner.world.check(act(learner, broken, observation, explore))


def test_what_is_counted_is_what_is_allocated(market):
    for learner in (market[0], PPO(Choir(), shared_trunk=True), PPO(Choir(), central_critic=True)):
        state = jax.eval_shape(learner.init, KEY)
        roles = [(each.network, each.moments.mu, each.moments.nu) for each in state.roles.values()]
        assert learner.network_bytes == sum(4 * part.size for part in jax.tree.leaves(roles))


def test_what_does_not_fit_is_refused_with_its_size(monkeypatch):
    monkeypatch.setattr("ethogram.core.memory.available_memory", lambda: 1_000_000)
    with pytest.raises(TooLarge, match=r"PPO with 194 MB of networks and batches of"):
        PPO(Sharing()).init(KEY)


def test_a_trunk_cannot_be_shared_with_a_central_critic():
    with pytest.raises(InvalidSettings, match=r"shared_trunk = True with central_critic = True"):
        PPO(Choir(), shared_trunk=True, central_critic=True)


def test_minibatches_hold_every_sample_once():
    order, is_any = shuffled(KEY, 10, 4)
    assert order.shape == (3, 4)
    np.testing.assert_array_equal(np.sort(order[is_any]), np.arange(10))
    assert shuffled(KEY, 3, 4)[1].shape == (1, 3)


def test_advantages_are_standardised_over_those_that_count():
    advantage, counted = jnp.array([1.0, 3.0, 99.0]), jnp.array([True, True, False])
    np.testing.assert_allclose(standardized(advantage, counted)[:2], [-1, 1], rtol=1e-6)
    np.testing.assert_array_equal(standardized(jnp.ones(3), counted), 0)


class Lottery(World):
    """A guard earns 10 if the scout sees a 1, whatever is done.  One step, and it is over."""

    @property
    def horizon(self):
        return 1

    @property
    def roles(self):
        return {
            "guard": Role(1, Discrete(1), Discrete(2)),
            "scout": Role(1, Discrete(2), Discrete(2)),
        }

    def reset(self, key):
        state = jax.random.randint(key, (), 0, 2)
        return state, self.observe(state)

    def observe(self, state):
        return {"guard": jnp.zeros(1, int), "scout": state[None]}

    def step(self, key, state, action):
        del key, action  # nothing is left to do
        return state, Outcome(
            observation=self.observe(state),
            reward=dict.fromkeys(self.roles, 10.0 * state[None]),
            terminated=dict.fromkeys(self.roles, jnp.ones(1, bool)),
            truncated=dict.fromkeys(self.roles, jnp.zeros(1, bool)),
        )


def test_a_central_critic_knows_what_others_observe():
    learner = PPO(Lottery(), central_critic=True, episodes_per_update=32, **FAST)
    lost = train(learner, KEY, 40).metrics["value_loss"]
    assert lost["guard"][-1] < 5  # who reads its own observation only is wrong by 5: 25
    assert lost["scout"][-1] < 5
