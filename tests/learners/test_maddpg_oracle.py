from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import Array
from jaxtyping import Key
from tests.learners.toys import Market
from tests.oracles import maddpg as oracle

from ethogram.core.spaces import Discrete
from ethogram.learners.episodes import play_episodes
from ethogram.learners.maddpg import MADDPG, MADDPGState
from ethogram.learners.networks import features, used_features

BATCH = 8


@eqx.filter_jit
def update(learner, key, state):
    return learner.update(key, state)


@eqx.filter_jit
def transitions(learner, key, state):
    """What an update plays with this key: episodes, then steps."""
    policy = learner.policy(state, explore=True)
    return play_episodes(learner.world, policy, key, learner.episodes_per_update)


@pytest.fixture(scope="module")
def learner():
    """Settings at which every part of an update shows: targets move fast, some arrays clip."""
    return MADDPG(
        Market(),
        discount=0.9,
        learning_rate=0.02,
        final_learning_rate=0.005,
        temperature=0.8,
        final_temperature=1.4,
        annealing_updates=2.0,
        tau=0.4,
        max_gradient_norm=0.7,
        logit_penalty=0.1,
        batch_size=BATCH,
        learning_starts=0,
        episodes_per_update=5,
        buffer_size=45,  # from the second round on the oldest of 30 a round are gone
        hidden_size=6,
    )


class Round(NamedTuple):
    key: Key[Array, ""]
    before: MADDPGState
    after: MADDPGState
    metrics: Any


@pytest.fixture(scope="module")
def rounds(learner):
    """Three rounds, the first beginning with agents that have learned nothing."""
    state, found = jax.jit(learner.init)(jax.random.key(1)), []
    for number in range(3):
        key = jax.random.key(10 + number)
        after, metrics = update(learner, key, state)
        found.append(Round(key, state, after, metrics))
        state = after
    return found


def test_after_each_round_all_parameters_and_losses_are_those_of_the_oracle(learner, rounds):
    agents, history = plain(learner, rounds[0].before), History(learner.buffer_size)
    for number, (key, before, after, metrics) in enumerate(rounds):
        for_play, for_rounds = jax.random.split(key)
        played = transitions(learner, for_play, before)
        history.add(jax.tree.map(lambda array: array.reshape(-1, *array.shape[2:]), played))
        (for_round,) = jax.random.split(for_rounds, 1)
        turns = list(draw(learner, for_round, history))
        oracle.update(agents, turns, settings_at(learner, number))
        for mine, (role, i, theirs) in zip(agents, everyone(after), strict=True):
            assert_alike(mine, theirs)
            for name, loss in mine.losses.items():
                found = metrics[f"{name}_loss"][role][i]
                np.testing.assert_allclose(found, loss, rtol=1e-4, atol=1e-5)


def test_what_an_agent_earned_in_an_episode_is_reported(learner, rounds):
    key, before, _, metrics = rounds[1]
    for_play, _ = jax.random.split(key)
    played = transitions(learner, for_play, before)
    ends = np.asarray(played.episode_end)
    assert (ends.argmax(1) < learner.world.steps - 1).any()  # some end before time is up
    for role, reward in played.outcome.reward.items():
        earned = [
            one[: end.argmax() + 1].sum(0)
            for one, end in zip(np.asarray(reward), ends, strict=True)
        ]
        found = metrics["episode_return"][role]
        np.testing.assert_allclose(found, earned, rtol=1e-4, atol=1e-5)


# A seller's feature and choice 1 of 3 are padding.  Critics read: of the buyer 5, of the sellers
# 3 and 3 that they see; of the buyer 4, of the sellers 3 and 3 that they do.
@pytest.mark.parametrize(("name", "padded"), [("actor", [1]), ("critic", [6, 9, 16, 19])])
def test_weights_of_padded_inputs_have_no_gradient_and_never_move(rounds, name, padded):
    for before, after in sellers(rounds):
        start, end = getattr(before, name).weights[0], getattr(after, name).weights[0]
        squares = getattr(after, f"{name}_moments").nu.weights[0]
        for moved in (np.asarray(squares > 0).any(1), np.asarray(start != end).any(1)):
            assert not moved[padded].any()
            assert np.delete(moved, padded).mean() > 0.9  # some choice may be in no minibatch


def test_weights_of_padded_choices_have_no_gradient_and_never_move(rounds):
    used = np.array([True, False, True])
    for before, after in sellers(rounds):
        start, end = before.actor, after.actor
        np.testing.assert_array_equal((after.actor_moments.nu.weights[-1] > 0).any(0), used)
        np.testing.assert_array_equal((start.weights[-1] != end.weights[-1]).any(0), used)
        np.testing.assert_array_equal(start.biases[-1] != end.biases[-1], used)


def sellers(rounds):
    """Each seller before the first round and after the last."""
    first, last = rounds[0].before, rounds[-1].after
    return zip(first.agents["seller"], last.agents["seller"], strict=True)


class History:
    """All transitions ever played, and which of them stand in the memory."""

    def __init__(self, room):
        self.place, self.added, self.played = np.zeros(room, int), 0, None

    def add(self, played):
        outcome = played.outcome
        parts = (played.observation, played.action, outcome.reward, outcome.terminated)
        parts = jax.tree.map(np.asarray, (*parts, outcome.observation))
        before = self.played or jax.tree.map(lambda array: array[:0], parts)
        self.played = jax.tree.map(lambda old, new: np.concatenate([old, new]), before, parts)
        for number in range(self.added, self.added + len(played.episode_end)):
            self.place[number % len(self.place)] = number
        self.added += len(played.episode_end)

    def draw(self, key, count):
        """The parts of some transitions, drawn with the random numbers that the memory uses."""
        filled = min(self.added, len(self.place))
        rows = self.place[np.asarray(jax.random.randint(key, (count,), 0, filled))]
        return jax.tree.map(lambda array: array[rows], self.played)


def everyone(state):
    """Role, number and networks of every agent, in the order in which critics read them."""
    return [(role, i, a) for role in sorted(state.agents) for i, a in enumerate(state.agents[role])]


def plain(learner, state):
    """The oracle's agents, in the same order."""
    agents = []
    for role, _, agent in everyone(state):
        networks = (agent.actor, agent.critic, agent.target_actor, agent.target_critic)
        space = learner.world.roles[role].action
        agents.append(
            oracle.Agent(
                *(oracle.Network(each.weights, each.biases) for each in networks),
                used=np.asarray(used_features(space)),
                hard=isinstance(space, Discrete),
            )
        )
    return agents


def settings_at(learner, number):
    def at(first, last):
        return float(first + min(1, number / learner.annealing_updates) * (last - first))

    return oracle.Settings(
        discount=float(learner.discount),
        rate=at(learner.learning_rate, learner.final_learning_rate),
        temperature=at(learner.temperature, learner.final_temperature),
        tau=float(learner.tau),
        clip=float(learner.max_gradient_norm),
        penalty=float(learner.logit_penalty),
    )


def draw(learner, key, history):
    """Each agent's turn in a round, with the random numbers that the learner uses."""
    roles = learner.world.roles
    names = [(role, i) for role in sorted(roles) for i in range(roles[role].agents)]
    for number, (role, each) in enumerate(roles.items()):
        for i in range(each.agents):
            for_agent = jax.random.fold_in(jax.random.fold_in(key, number), i)
            for_batch, for_actor = jax.random.split(for_agent)
            for_rows, for_targets = jax.random.split(for_batch)
            observation, action, reward, terminated, reached = history.draw(for_rows, BATCH)
            noise = {
                name: gumbel(
                    jax.random.fold_in(for_targets, at), BATCH, other.agents, choices(other)
                )
                for at, (name, other) in enumerate(roles.items())
            }
            yield (
                names.index((role, i)),
                oracle.Step(
                    observation=flat(roles, observation, "observation"),
                    action=flat(roles, action, "action"),
                    reward=reward[role][:, i],
                    terminated=terminated[role][:, i],
                    reached=flat(roles, reached, "observation"),
                    target_noise=[noise[name][:, j] for name, j in names],
                    noise=gumbel(for_actor, BATCH, choices(each)),
                ),
            )


def gumbel(key, *shape):
    return np.asarray(jax.random.gumbel(key, shape), float)


def choices(role):
    return role.action.n


def flat(roles, values, kind):
    """What each agent saw or did, as numbers, in the order in which critics read them."""
    parts = []
    for name in sorted(roles):
        read = features(getattr(roles[name], kind), jnp.asarray(values[name]))
        parts += [np.asarray(read[:, i], float) for i in range(roles[name].agents)]
    return parts


def assert_alike(mine, theirs):
    """Parameters, and the moments that hold all gradients so far, clipped."""
    for name in ("actor", "critic", "target_actor", "target_critic"):
        found = paired(getattr(theirs, name))
        for one, other in zip(found, getattr(mine, name).arrays, strict=True):
            np.testing.assert_allclose(one, other, atol=3e-6)
    for name in ("actor", "critic"):
        moments, network = getattr(theirs, f"{name}_moments"), getattr(mine, name)
        for found, expected in ((moments.mu, network.means), (moments.nu, network.squares)):
            for one, other in zip(paired(found), expected, strict=True):
                scale = np.abs(other).max()
                np.testing.assert_allclose(one, other, rtol=1e-3, atol=1e-4 * scale)


def paired(network):
    """Weights and biases layer by layer."""
    return [a for pair in zip(network.weights, network.biases, strict=True) for a in pair]
