import ast
import dataclasses
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import Array
from tests.learners.toys import Duet, Recital

from ethogram.core.errors import EthogramError, InvalidSettings, TooLarge, UnknownName
from ethogram.core.memory import readable_bytes
from ethogram.core.rollout import rollout
from ethogram.core.settings import settings_of
from ethogram.core.spaces import Box, Discrete
from ethogram.core.world import Role
from ethogram.learners.maddpg import MADDPG, PRESETS
from ethogram.worlds.language import Language
from ethogram.worlds.sharing import Sharing

SMALL = {"batch": 8, "episodes": 4, "memory": 64, "hidden": 8}


@eqx.filter_jit
def update(learner, key, learned):
    return learner.update(key, learned)


class Chord(eqx.Module):
    """A script: the pianist plays the same two tones, whatever it sees."""

    tones: Array = eqx.field(converter=jnp.asarray)

    def __call__(self, key, observation):
        del key  # the choice is made
        return jnp.tile(self.tones, (len(observation), 1))


def accompanied(*tones, **world):
    """A singer that learns, beside a pianist that plays by a script."""
    return MADDPG(Recital(**world), {"pianist": Chord(tones)}, discount=0.5, **SMALL)


def first_loss(learner, *entries):
    """The singer's critic loss when its networks give 0, but for entries of its target critic.

    The critic says 0, so that the loss is the square of the target.
    """
    learned = learner.init(jax.random.key(0))
    agent = jax.tree.map(jnp.zeros_like, learned.agents["singer"][0])
    for kind, layer, place, value in entries:
        agent = entered(agent, kind, layer, place, value)
    learned = eqx.tree_at(lambda state: state.agents["singer"], learned, (agent,))
    _, metrics = update(learner, jax.random.key(1), learned)
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


@pytest.mark.parametrize(("tone", "loss"), [(2, (0.5 * 10) ** 2), (1, 0.0)])
def test_targets_foresee_what_a_script_will_do(tone, loss):
    # the pianist sees 2 numbers, the singer 2; then comes what the pianist does, 3 + 3 numbers
    worth_10_after_tone_2 = (
        ("weights", 0, (4 + 2, 0), 1.0),
        ("weights", 1, (0, 0), 1.0),
        ("weights", 2, (0, 0), 10.0),
    )
    learner = accompanied(tone, 1, pay=0.0)
    np.testing.assert_allclose(first_loss(learner, *worth_10_after_tone_2), [loss])


def test_a_script_is_followed_and_does_not_learn():
    learner = accompanied(2, 1)
    learned = learner.init(jax.random.key(0))
    assert learner.learning == tuple(learned.agents) == ("singer",)
    after, metrics = update(learner, jax.random.key(1), learned)
    assert tuple(after.agents) == tuple(metrics["actor_loss"]) == ("singer",)
    np.testing.assert_array_equal(metrics["reward"]["singer"], np.ones((4, 1)))
    for noise in (True, False):
        act = learner.policy(learned, noise=noise)
        nothing = {"singer": jnp.zeros(1, jnp.int32), "pianist": jnp.zeros(1, jnp.int32)}
        np.testing.assert_array_equal(act(jax.random.key(2), nothing)["pianist"], [[2, 1]])


@pytest.mark.parametrize("noise", [True, False])
def test_a_talker_with_a_small_alphabet_never_says_a_word_that_there_is_not(noise):
    world = Language(vocabulary_size=3, max_vocabulary_size=8, steps=5)
    learner = MADDPG(world, memory=100, batch=1, hidden=4, straight_through=noise)
    learned = learner.init(jax.random.key(0))
    keys = jax.random.split(jax.random.key(1), 100)

    @eqx.filter_jit
    @eqx.filter_vmap
    def play(key):
        return rollout(world, learner.policy(learned, noise=noise), key, world.steps)[1]

    said = play(keys).action["talker"]
    np.testing.assert_array_equal((said > 0).any((0, 1, 2)), [0, 1, 1, 1, 0, 0, 0, 0, 0])
    assert world.roles["talker"].action.contains(said).all()


def test_it_learns_in_the_sharing_world():
    world = Sharing(agents=2, resources=2, steps=4, encoding="vector")
    learner = MADDPG(world, rounds=2, **SMALL)
    learned = learner.init(jax.random.key(0))
    for number in range(2):
        learned, metrics = update(learner, jax.random.key(number), learned)
    assert metrics["reward"]["agent"].shape == (4, 2)
    assert metrics["critic_loss"]["agent"].shape == metrics["actor_loss"]["agent"].shape == (2,)
    assert learned.rounds == 4
    assert all(jnp.isfinite(leaf).all() for leaf in jax.tree.leaves((learned.agents, metrics)))
    act = learner.policy(learned)
    _, played = rollout(world, act, jax.random.key(5), 20)
    assert world.roles["agent"].action.contains(played.action["agent"]).all()


def test_without_noise_a_policy_does_the_same_whatever_the_key():
    world = Language(max_vocabulary_size=4)
    learner = MADDPG(world, memory=100, batch=1, hidden=4)
    learned = learner.init(jax.random.key(0))
    _, observation = world.reset(jax.random.key(1))
    for noise, changes in ((False, False), (True, True)):
        act = learner.policy(learned, noise=noise)
        one, other = (act(jax.random.key(number), observation) for number in (2, 3))
        for role in world.roles:
            assert (one[role] != other[role]).any() == changes
    logits = learner.logits(learned, observation)
    calm = learner.policy(learned, noise=False)(jax.random.key(2), observation)
    np.testing.assert_allclose(calm["mover"], jax.nn.softmax(logits["mover"]), rtol=1e-6)


def test_target_networks_have_first_weights_of_their_own_unless_they_are_copies():
    for copy_targets in (False, True):
        learner = MADDPG(Duet(), copy_targets=copy_targets, **SMALL)
        for (agent,) in learner.init(jax.random.key(0)).agents.values():
            pairs = ((agent.actor, agent.target_actor), (agent.critic, agent.target_critic))
            for network, target in pairs:
                same = [
                    (w == t).all() for w, t in zip(network.weights, target.weights, strict=True)
                ]
                assert all(same) if copy_targets else not any(same)


def test_it_plays_until_the_memory_holds_the_batches_of_the_warm_up():
    learner = MADDPG(Language(), batch=512, warm_up=25, episodes=4)
    assert learner.first_plays == 128  # times 4 episodes of 25 steps: 12 800 = 25 x 512
    assert MADDPG(Language(), batch=512, warm_up=1, episodes=4).first_plays == 6  # 5 would hold 500
    assert MADDPG(Language(), warm_up=0).first_plays == 0


class Steered(Duet):
    """A duet whose pianist turns a knob."""

    @property
    def roles(self):
        return super().roles | {"pianist": Role(1, Discrete(3), Box(-1.0, 1.0, (1,)))}


def test_a_role_without_choices_cannot_learn():
    with pytest.raises(EthogramError, match=r"Discrete or Simplex; those of 'pianist' are Box\."):
        MADDPG(Steered())
    MADDPG(Steered(), {"pianist": Chord([0.0])})  # but it can follow a script


def test_a_script_for_a_role_that_there_is_not_is_refused():
    with pytest.raises(UnknownName, match=r"Unknown role 'pianst'\. Did you mean 'pianist'\?"):
        MADDPG(Duet(), {"pianst": Chord([0])})


def test_settings_out_of_range_are_refused_and_all_of_them_named():
    with pytest.raises(InvalidSettings, match=r"discount = 1\.5: .*; batch = 0: "):
        MADDPG(Duet(), discount=1.5, batch=0)
    with pytest.raises(InvalidSettings, match="rate = 0"):
        MADDPG(Duet(), rate=0.0)


def test_a_memory_that_cannot_hold_one_play_is_refused():
    with pytest.raises(InvalidSettings, match="memory = 99 has no room for the 100 transitions"):
        MADDPG(Language(), memory=99, episodes=4)
    MADDPG(Language(), memory=100, episodes=4)


def test_a_memory_that_does_not_fit_is_refused_with_its_size(monkeypatch):
    learner = MADDPG(Duet(), memory=1_000_000)
    # a tune, two actions and the key of chance, in words of 4 bytes
    assert learner.replay_bytes == (1 + 2 + 2) * 4 * 1_000_000
    monkeypatch.setattr("ethogram.core.memory.available_memory", lambda: 10_000_000)
    networks = readable_bytes(learner.network_bytes)
    refusal = (
        rf"MADDPG with {networks} of networks and a replay memory of 1,000,000 transitions "
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
