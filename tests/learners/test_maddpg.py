import ast
import dataclasses
from itertools import pairwise
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import Array
from tests.learners.toys import Choir, Duet, Recital

from ethogram.core.errors import EthogramError, InvalidSettings, TooLarge
from ethogram.core.memory import readable_bytes
from ethogram.core.rollout import rollout
from ethogram.core.settings import settings_of
from ethogram.core.spaces import Box, Discrete
from ethogram.core.world import Role
from ethogram.core.wrappers import GivenPolicies
from ethogram.learners.maddpg import MADDPG, PRESETS
from ethogram.learners.train import train
from ethogram.worlds.language import Language
from ethogram.worlds.sharing import Sharing

SMALL = {
    "batch_size": 8,
    "learning_starts": 0,
    "episodes_per_update": 4,
    "buffer_size": 64,
    "hidden_size": 8,
}


@eqx.filter_jit
def init(learner, key):
    return learner.init(key)


@eqx.filter_jit
def update(learner, key, state):
    return learner.update(key, state)


class Chord(eqx.Module):
    """The pianist plays the same two tones, whatever it sees."""

    tones: Array = eqx.field(converter=jnp.asarray)

    def __call__(self, key, observation):
        del key  # the choice is made
        return jnp.tile(self.tones, (len(observation), 1))


def accompanied(*tones, **world):
    """A singer that learns, beside a pianist that does not."""
    recital = GivenPolicies(Recital(**world), {"pianist": Chord(tones)})
    return MADDPG(recital, discount=0.5, **SMALL)


def first_loss(learner, *entries):
    """The singer's critic loss when its networks give 0, but for entries of its target critic.

    The critic says 0, so that the loss is the square of the target.
    """
    state = init(learner, jax.random.key(0))
    agent = jax.tree.map(jnp.zeros_like, state.agents["singer"][0])
    for kind, layer, place, value in entries:
        agent = entered(agent, kind, layer, place, value)
    state = eqx.tree_at(lambda state: state.agents["singer"], state, (agent,))
    _, metrics = update(learner, jax.random.key(1), state)
    return metrics["critic_loss"]["singer"]


def entered(agent, kind, layer, place, value):
    def where(agent):
        return getattr(agent.target_critic, kind)[layer]

    return eqx.tree_at(where, agent, where(agent).at[place].set(value))


@pytest.mark.parametrize(("final", "loss"), [(False, (3 + 0.5 * 10) ** 2), (True, 3**2)])
def test_the_future_counts_after_a_time_limit_and_not_after_a_termination(final, loss):
    learner = accompanied(2, 1, pay=3.0, final=final)
    worth_10_everywhere = ("biases", 2, 0, 10.0)
    np.testing.assert_allclose(first_loss(learner, worth_10_everywhere), [loss])


def test_of_who_is_not_in_play_nothing_is_learned():
    """Two singers of whom one is out; both are worth the same."""

    class Pair(Choir):
        def step(self, key, state, action):
            after, outcome = super().step(key, state, action)
            acting = {"singer": jnp.array([True, False])}
            return after, dataclasses.replace(outcome, acting=acting)

    learner = MADDPG(Pair((0, 1), (3.0, 3.0)), **SMALL)
    before = init(learner, jax.random.key(0))
    after, metrics = update(learner, jax.random.key(1), before)
    assert (metrics["critic_loss"]["singer"] > 0).tolist() == [True, False]
    moved = [
        (one.actor.weights[0] != other.actor.weights[0]).any()
        for one, other in zip(before.agents["singer"], after.agents["singer"], strict=True)
    ]
    assert moved == [True, False]


@pytest.mark.parametrize("explore", [True, False])
def test_a_talker_with_a_small_alphabet_never_says_a_word_that_there_is_not(explore):
    world = Language(vocabulary_size=3, max_vocabulary_size=8, steps=5)
    learner = MADDPG(world, buffer_size=100, batch_size=1, hidden_size=4, straight_through=explore)
    state = init(learner, jax.random.key(0))
    keys = jax.random.split(jax.random.key(1), 100)

    @eqx.filter_jit
    @eqx.filter_vmap
    def play(key):
        return rollout(world, learner.policy(state, explore=explore), key, world.steps)[1]

    said = play(keys).action["talker"]
    np.testing.assert_array_equal((said > 0).any((0, 1, 2)), [0, 1, 1, 1, 0, 0, 0, 0, 0])
    assert world.roles["talker"].action.contains(said).all()


@pytest.mark.slow
def test_it_learns_in_the_sharing_world():
    world = Sharing(agents=2, resources=2, steps=4, encoding="vector")
    learner = MADDPG(world, updates_per_iteration=2, **SMALL)
    state = init(learner, jax.random.key(0))
    for number in range(2):
        state, metrics = update(learner, jax.random.key(number), state)
    assert metrics["episode_return"]["agent"].shape == (4, 2)
    assert metrics["critic_loss"]["agent"].shape == metrics["actor_loss"]["agent"].shape == (2,)
    assert state.updates == 4
    assert all(jnp.isfinite(leaf).all() for leaf in jax.tree.leaves((state.agents, metrics)))
    act = learner.policy(state, explore=True)
    _, played = rollout(world, act, jax.random.key(5), 20)
    assert world.roles["agent"].action.contains(played.action["agent"]).all()


def test_without_exploration_a_policy_does_the_same_whatever_the_key():
    world = Language(max_vocabulary_size=4)
    learner = MADDPG(world, buffer_size=100, batch_size=1, hidden_size=4)
    state = init(learner, jax.random.key(0))
    _, observation = world.reset(jax.random.key(1))
    for explore, changes in ((False, False), (True, True)):
        act = learner.policy(state, explore=explore)
        one, other = (act(jax.random.key(number), observation) for number in (2, 3))
        for role in world.roles:
            assert (one[role] != other[role]).any() == changes
    logits = learner.actor_outputs(state, observation)
    calm = learner.policy(state)(jax.random.key(2), observation)
    np.testing.assert_allclose(calm["mover"], jax.nn.softmax(logits["mover"]), rtol=1e-6)


def test_target_networks_have_first_weights_of_their_own_unless_they_are_copies():
    for copy_targets in (False, True):
        learner = MADDPG(Duet(), copy_targets=copy_targets, **SMALL)
        for (agent,) in init(learner, jax.random.key(0)).agents.values():
            pairs = ((agent.actor, agent.target_actor), (agent.critic, agent.target_critic))
            for network, target in pairs:
                same = [
                    (w == t).all() for w, t in zip(network.weights, target.weights, strict=True)
                ]
                assert all(same) if copy_targets else not any(same)


def test_it_only_plays_until_the_replay_buffer_holds_enough_transitions():
    learner = MADDPG(Duet(), **SMALL | {"learning_starts": 9})
    start = init(learner, jax.random.key(0))
    agents = [jax.tree.map(np.asarray, start.agents)]
    losses = []

    def keep(done, state, metrics):
        del done
        agents.append(jax.tree.map(np.asarray, state.agents))
        losses.append(metrics["critic_loss"]["singer"][0, 0])

    state, _ = train(learner, jax.random.key(1), 5, state=start, after_chunk=keep, seconds=0)
    same = [eqx.tree_equal(one, other) for one, other in pairwise(agents)]
    assert same == [True, True, True, False, False]  # three plays of four steps make twelve
    assert np.isfinite(losses).tolist() == [False, False, False, True, True]
    assert state.updates == 2


def test_a_replay_buffer_too_small_for_what_learning_needs_is_enough_when_full():
    learner = MADDPG(Duet(), **SMALL | {"learning_starts": 10**6, "buffer_size": 8})
    state, metrics = train(learner, jax.random.key(0), 4)
    assert np.isfinite(metrics["actor_loss"]["pianist"][:, 0]).tolist() == [
        False,
        False,
        True,
        True,
    ]
    assert state.updates == 2


def steered(high):
    class Steered(Duet):
        """A duet whose pianist turns a knob."""

        @property
        def roles(self):
            return super().roles | {"pianist": Role(1, Discrete(3), high)}

    return Steered()


def test_actions_that_are_no_choices_and_no_bounded_box_are_refused_by_name():
    with pytest.raises(EthogramError, match=r"Discrete, Simplex or Box; those of 'pianist' are M"):
        MADDPG(Recital())
    with pytest.raises(EthogramError, match=r"finite bounds; that of 'pianist' is Box\(low=-inf"):
        MADDPG(steered(Box(-jnp.inf, 1.0, (1,))))
    MADDPG(steered(Box(-1.0, 1.0, (1,))))


def test_settings_out_of_range_are_refused_and_all_of_them_named():
    with pytest.raises(InvalidSettings, match=r"discount = 1\.5: .*; batch_size = 0: "):
        MADDPG(Duet(), discount=1.5, batch_size=0)
    with pytest.raises(InvalidSettings, match="learning_rate = 0"):
        MADDPG(Duet(), learning_rate=0.0)


def test_a_replay_buffer_that_cannot_hold_one_play_is_refused():
    with pytest.raises(InvalidSettings, match="buffer_size = 99 has no room for the 100 trans"):
        MADDPG(Language(), buffer_size=99, episodes_per_update=4)
    MADDPG(Language(), buffer_size=100, episodes_per_update=4)


def test_a_replay_buffer_that_does_not_fit_is_refused_with_its_size(monkeypatch):
    learner = MADDPG(Duet(), buffer_size=1_000_000)
    # a tune, two actions and the key of chance, in words of 4 bytes
    assert learner.replay_bytes == (1 + 2 + 2) * 4 * 1_000_000
    monkeypatch.setattr("ethogram.core.memory.available_memory", lambda: 10_000_000)
    networks = readable_bytes(learner.network_bytes)
    refusal = (
        rf"MADDPG with {networks} of networks and a replay buffer of 1,000,000 transitions "
        r"\(20 MB\) needs 20.* MB of memory; 10 MB are free\."
    )
    with pytest.raises(TooLarge, match=refusal):
        learner.init(jax.random.key(0))


def test_the_page_lists_every_setting_as_it_is_in_both_presets():
    page = (Path(__file__).parents[2] / "docs/learners/maddpg.md").read_text(encoding="utf-8")
    names = [field.name for field in dataclasses.fields(settings_of(MADDPG))]
    rows = [row.split(" | ") for row in page.splitlines() if row.startswith("| `")]
    listed = {row[0].strip("| `"): row[1:3] for row in rows if row[0].strip("| `") in names}
    assert list(listed) == names
    for name, cells in listed.items():
        for preset, cell in zip(("thesis", "tuned"), cells, strict=True):
            value = getattr(MADDPG(Language(), **PRESETS[preset]), name)
            assert float(value) == pytest.approx(float(ast.literal_eval(cell))), (name, preset)
