"""Losses, advantages and whole updates of PPO against a transcription in NumPy."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.learners.toys import Rota
from tests.oracles import ppo as oracle

from ethogram.core.spaces import Box, MultiDiscrete
from ethogram.learners.action_distributions import deviation_count
from ethogram.learners.episodes import play_episodes
from ethogram.learners.networks import feature_count
from ethogram.learners.policy_network import INITIALIZATIONS, Architecture, PolicyNetwork
from ethogram.learners.ppo import PPO
from ethogram.learners.ppo_update import Minibatch, Objective, ppo_loss
from ethogram.learners.returns import generalized_advantage

SMALL = {"epochs": 1, "minibatch_size": 1000, "episodes_per_update": 3, "hidden_size": 4}
OBJECTIVE = Objective(0.2, 0.5, 0.7, 0.03, 0.4)
initial_network = eqx.filter_jit(PolicyNetwork.init)
loss_and_gradient = eqx.filter_jit(jax.value_and_grad(ppo_loss, has_aux=True))


@pytest.mark.parametrize("value_clip", [0.0, 0.5])
@pytest.mark.parametrize("shared_trunk", [False, True])
@pytest.mark.parametrize("space", [MultiDiscrete((2, 3)), Box(-1.0, 1.0, (2,))])
def test_the_gradient_of_a_minibatch_is_that_of_the_oracle(space, shared_trunk, value_clip):
    draw = np.random.default_rng(3).normal
    initial = INITIALIZATIONS["glorot_uniform"]
    form = Architecture((4, 4), jnp.tanh, initial, shared_trunk)
    inputs = jnp.ones(3, bool)
    network = initial_network(jax.random.key(2), inputs, inputs, space, form)
    size, discrete = 12, isinstance(space, MultiDiscrete)
    observation = draw(size=(size, 3))
    drawn = draw(size=(size, 2))
    outputs, value = oracle.Networks.of(network)(observation, observation)
    batch = oracle.Steps(
        observation=observation,
        judged=observation,
        drawn=(drawn > 0).astype(int) if discrete else drawn,
        outputs=outputs + 0.3 * draw(size=(size, feature_count(space))),  # some ratios are clipped
        value=value + draw(size=size),  # some values, too
        advantage=draw(size=size),
        target=draw(size=size),
        counted=np.arange(size) % 4 > 0,
    )
    objective = OBJECTIVE._replace(value_clip=value_clip)
    old_log_std = 0.1 * draw(size=deviation_count(space))
    given = Minibatch(*map(jnp.asarray, batch)), jnp.asarray(old_log_std), space, objective
    (lost, found), slope = loss_and_gradient(network, *given)
    assert 0 < found["clip_fraction"] < 1
    sizes = space.sizes if discrete else None
    plain, rest = oracle.Networks.of(network), (batch, old_log_std, sizes, objective)
    np.testing.assert_allclose(lost, oracle.loss(plain, *rest), rtol=1e-5)
    for mine, wanted in zip(
        oracle.Networks.of(slope).arrays(), oracle.gradient(plain, *rest), strict=True
    ):
        np.testing.assert_allclose(mine, wanted, rtol=1e-4, atol=1e-5)


def test_advantages_are_sums_over_the_steps_that_follow_in_which_an_agent_acts():
    draw = np.random.default_rng(0)
    shape = 12, 200  # steps of as many agents
    reward, value, next_value = draw.normal(size=(3, *shape))
    terminated, cut, idle = draw.random((3, *shape)) < np.array([0.1, 0.15, 0.4])[:, None, None]
    assert (idle[:-1] & ~(terminated | cut)[:-1]).any()  # one acts again after a time
    steps = reward, value, next_value, terminated, cut, ~idle
    found = generalized_advantage(*map(jnp.asarray, steps), 0.9, 0.8)
    for agent in range(shape[1]):
        wanted = oracle.advantages(*(part[:, agent] for part in steps), 0.9, 0.8)
        np.testing.assert_allclose(found[:, agent], wanted, rtol=1e-4, atol=1e-5)


@pytest.fixture(
    scope="module",
    params=[
        {"shared_trunk": True, "advantages": "batch", "fragment_steps": 5},
        {
            "shared": False,
            "central_critic": True,
            "normalize_observations": True,
            "normalize_returns": True,
        },
    ],
    ids=["shared", "each"],
)
def round_(request):
    """A learner, a key, and the states before and after an update that is not the first."""
    learner = PPO(
        Rota(),
        discount=0.9,
        gae_lambda=0.8,
        entropy_coefficient=0.02,
        kl_coefficient=0.3,
        max_gradient_norm=0.0,
        initialization="glorot_uniform",
        **request.param,
        **SMALL,
    )
    update = eqx.filter_jit(learner.update)
    first, _ = update(jax.random.key(0), jax.jit(learner.init)(jax.random.key(1)))
    key = jax.random.key(2)
    return learner, key, first, *update(key, first)


def test_the_gradient_of_an_update_is_that_of_the_oracle(round_):
    learner, key, before, after, metrics = round_
    played, learned = replay(learner, key, before), before.roles["worker"]
    for number in range(1 if learner.shared else 3):
        network, moment, earlier = of_policy(
            (learned.network, after.roles["worker"].moments.mu, learned.moments.mu), number
        )
        networks = oracle.Networks.of(network)
        steps = steps_of(learner, played, networks, before, after, number)
        if not steps.counted.any():  # of nothing, nothing is learned
            assert eqx.tree_equal(moment, earlier)
            continue
        objective = Objective(0.2, 0.0, 0.5, 0.02, float(learned.kl_coefficient[number]))
        wanted = oracle.gradient(networks, steps, networks.log_std, (2, 3), objective)
        mine = jax.tree.map(lambda now, then: (now - 0.9 * then) / 0.1, moment, earlier)
        for found, slope in zip(oracle.Networks.of(mine).arrays(), wanted, strict=True):
            np.testing.assert_allclose(found, slope, rtol=1e-4, atol=1e-5)
        lost = metrics["value_loss"]["worker"]
        error = ((steps.value - steps.target)[steps.counted] ** 2).mean()
        np.testing.assert_allclose(lost if learner.shared else lost[number], error, rtol=1e-4)


def test_an_agent_that_never_acts_keeps_its_policy_and_moves_no_statistics(round_):
    learner, _, before, after, metrics = round_
    if learner.shared:
        return
    kept = [
        of_policy((each.network, each.moments, each.observation), 2)
        for each in (before.roles["worker"], after.roles["worker"])
    ]
    assert eqx.tree_equal(*kept)
    assert after.roles["worker"].running_return.count[2] == 0
    assert metrics["policy_loss"]["worker"][2] == 0


def test_statistics_are_those_of_all_steps_in_which_an_agent_acted(round_):
    learner, key, before, after, _ = round_
    if not learner.normalize_observations:
        assert after.roles["worker"].observation is None
        return
    first = jax.jit(learner.init)(jax.random.key(1))
    rounds = [replay(learner, jax.random.key(0), first), replay(learner, key, before)]
    seen = [
        flattened(np.asarray(played.observation["worker"], float)[:, :, :1])[
            flattened(steps_that_count(played, 0)[0][:, :, :1])
        ]
        for played in rounds
    ]
    seen, statistics = np.concatenate(seen), after.roles["worker"].observation
    assert (statistics.count[0] == len(seen)).all()
    np.testing.assert_allclose(statistics.mean[0], seen.mean(0), rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(statistics.deviation[0], seen.std(0), rtol=1e-3)


def of_policy(learned, number):
    return jax.tree.map(lambda part: part[number], learned)


def steps_of(learner, played, networks, before, after, number):
    """What a policy learns from, worked out from what was played."""
    outcome, learned = played.outcome, before.roles["worker"]
    read, judged = [], []
    for seen in (played.observation, outcome.observation):
        own = normalized(learned.observation, np.asarray(seen["worker"], float))
        joint = np.repeat(own.reshape(*own.shape[:2], 1, 6), 3, 2)
        read.append(own)
        judged.append(np.concatenate([own, joint], -1) if learner.central_critic else own)
    (outputs, value), (_, next_value) = map(networks, read, judged)
    acting, cut = steps_that_count(played, learner.fragment_steps)
    reward = np.asarray(outcome.reward["worker"], float)
    if learner.normalize_returns:
        reward = reward / after.roles["worker"].running_return.deviation
    steps = reward, value, next_value, outcome.terminated["worker"], cut, acting
    advantage = np.zeros(value.shape)
    for e, i in np.ndindex(len(value), 3):
        advantage[e, :, i] = oracle.advantages(*(part[e, :, i] for part in steps), 0.9, 0.8)
    agents = slice(None) if learner.shared else slice(number, number + 1)
    did = np.asarray(played.action["worker"])
    parts = read[0], judged[0], did, outputs, value, advantage, advantage + value, acting
    steps = oracle.Steps(*(flattened(part[:, :, agents]) for part in parts))
    chosen = steps.advantage[steps.counted]
    if not chosen.size:
        return steps
    return steps._replace(advantage=(steps.advantage - chosen.mean()) / chosen.std())


@eqx.filter_jit
def play(learner, key, state):
    def act(key, observation):
        return learner._act(state, key, observation)

    return play_episodes(learner.world, act, key, learner.episodes_per_update)


def replay(learner, key, state):
    """What an update plays with this key."""
    return play(learner, jax.random.split(key)[0], state)


def steps_that_count(played, fragment_steps):
    """In which steps an agent acts, until its own end; and where what follows is something else."""
    ends = np.asarray(played.episode_end)
    own_end = np.asarray(played.outcome.terminated["worker"] | played.outcome.truncated["worker"])
    acting = np.array(played.outcome.acting["worker"])
    for e, agent in np.ndindex(len(ends), 3):
        is_out = False
        for t in range(ends.shape[1]):
            acting[e, t, agent] &= not is_out
            is_out = (is_out or own_end[e, t, agent]) and not ends[e, t]
    assert acting[:, :, 0].any()
    assert not acting[:, :, 2].any()
    cut = np.asarray(played.outcome.truncated["worker"]) | ends[..., None]
    if fragment_steps:
        cut[:, fragment_steps - 1 :: fragment_steps] = True
    return acting, cut


def normalized(statistics, seen):
    if statistics is None:
        return seen
    mean, deviation = (np.asarray(part, float) for part in (statistics.mean, statistics.deviation))
    return np.clip((seen - mean) / deviation, -10, 10)


def flattened(part):
    return part.reshape(-1, *part.shape[3:])
