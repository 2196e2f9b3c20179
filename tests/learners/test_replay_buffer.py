from collections import deque
from functools import partial

import equinox as eqx
import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from tests.learners.toys import Market

from ethogram.core.rollout import rollout
from ethogram.core.wrappers import Wrapper
from ethogram.learners.replay_buffer import (
    Experience,
    Layout,
    ReplayBuffer,
    TransitionLayout,
)


def leaves_of_all_kinds(seed, batch):
    """Any bits at all as reals, also infinities and NaN with their payloads."""
    rng = np.random.default_rng(seed)
    bits = rng.integers(0, 2**32, (*batch, 3), np.uint32)
    return {
        "real": jnp.asarray(bits.view(np.float32)),
        "whole": jnp.asarray(rng.integers(-(2**31), 2**31, (*batch, 2, 2), np.int32)),
        "count": jnp.asarray(rng.integers(0, 2**32, batch, np.uint32)),
        "flag": jnp.asarray(rng.random((*batch, 4)) < 0.5),
        "keys": jax.random.split(jax.random.key(seed), (*batch, 2)),
    }


LAYOUT = Layout(leaves_of_all_kinds(0, ()))


@given(seed=st.integers(0, 2**31), batch=st.sampled_from([(), (3,), (2, 3)]))
def test_what_is_packed_is_unpacked_bit_for_bit(seed, batch):
    tree = leaves_of_all_kinds(seed, batch)
    rows = LAYOUT.pack(tree)
    assert rows.shape == (*batch, LAYOUT.row_width)
    found = LAYOUT.unpack(rows)
    for name, leaf in tree.items():
        assert (found[name].shape, found[name].dtype) == (leaf.shape, leaf.dtype)
        assert bits_of(found[name]) == bits_of(leaf)


def bits_of(leaf):
    plain = jax.random.key_data(leaf) if leaf.dtype == jax.random.key(0).dtype else leaf
    return np.asarray(plain).tobytes()


def test_a_row_has_a_word_per_number_and_two_per_key():
    assert LAYOUT.row_width == 3 + 4 + 1 + 4 + 2 * 2


def test_numbers_of_another_type_are_kept_as_numbers():
    layout = Layout({"weights": jnp.zeros(3), "choice": jnp.int32(0)})
    rows = layout.pack({"weights": jnp.array([0, 1, 0]), "choice": jnp.float32(2.0)})
    found = layout.unpack(rows)
    np.testing.assert_array_equal(found["weights"], [0.0, 1.0, 0.0])
    assert found["choice"] == 2


@pytest.mark.parametrize("new", [1, 3, 5])
def test_when_full_the_newest_transitions_stay(new):
    room, layout = 5, Layout(jnp.int32(0))
    buffer, newest = ReplayBuffer.empty(layout.row_width, room), deque(maxlen=room)
    add, draw = jax.jit(ReplayBuffer.add), jax.jit(ReplayBuffer.draw, static_argnames="count")
    for start in range(0, 12 * new, new):
        numbers = jnp.arange(start, start + new, dtype=jnp.int32) + 1  # 0 stands in empty places
        newest.extend(numbers.tolist())
        buffer = add(buffer, layout.pack(numbers))
        assert sorted(layout.unpack(buffer.rows[: len(newest)]).tolist()) == sorted(newest)
        drawn = layout.unpack(draw(buffer, jax.random.key(start), count=200)).tolist()
        assert set(drawn) == set(newest)


def test_the_largest_memory_still_counts_in_32_bits():
    room, layout = 2**30, Layout(jnp.int32(0))
    one = layout.pack(jnp.zeros(1, jnp.int32))
    after = eqx.filter_eval_shape(
        lambda: ReplayBuffer.empty(layout.row_width, room).add(one)
    )  # takes no memory
    assert after.rows.shape == (room, 1)


@pytest.mark.parametrize(("added", "filled"), [(4, 4), (10, 10), (17, 10)])
def test_draws_are_uniform_over_what_is_there(added, filled):
    layout, count = Layout(jnp.int32(0)), 40_000
    buffer = ReplayBuffer.empty(layout.row_width, 10)
    for number in range(added):
        buffer = buffer.add(layout.pack(jnp.full(1, number, jnp.int32)))
    drawn = layout.unpack(buffer.draw(jax.random.key(1), count))
    shares = np.bincount(drawn, minlength=added) / count
    np.testing.assert_allclose(shares[: added - filled], 0)
    # four standard errors of the most frequent share
    np.testing.assert_allclose(shares[added - filled :], 1 / filled, atol=4 * 0.5 / count**0.5)


def at_random(key, observation):
    del observation
    buyer, seller = jax.random.split(key)
    weights = jax.random.dirichlet(seller, jnp.ones(2), (2,))
    return {
        "buyer": jax.random.randint(buyer, (1,), 0, 4),
        "seller": jnp.insert(weights, 1, 0.0, axis=1),
    }


def test_a_transition_rebuilt_from_its_state_is_the_one_that_was_played():
    """Also in a world of chance, since its key is kept."""
    world, steps = Market(), 40
    # two programs round alike only as users get them: by the newer emitters
    compiled = partial(jax.jit, compiler_options={"xla_cpu_use_fusion_emitters": True})

    played = compiled(lambda key: rollout(world, at_random, key, steps)[1])(jax.random.key(3))
    layout = TransitionLayout(world)
    assert layout.keeps_states
    rows = layout.pack(played)
    found = compiled(lambda rows: TransitionLayout(world).unpack(rows))(rows)
    expected = Experience.of(played)
    jax.tree.map(
        lambda one, other: np.testing.assert_allclose(one, other, rtol=1e-6), found, expected
    )
    assert played.outcome.terminated["buyer"].any()  # as well as what ends an episode
    assert played.outcome.truncated["buyer"].any()


class Beside(Wrapper):
    """A world beside a library that nobody looks into: its state is larger than what is seen."""

    def reset(self, key):
        state, observation = self.world.reset(key)
        return (state, jnp.zeros(1000)), observation

    def observe(self, state):
        return self.world.observe(state[0])

    def step(self, key, state, action):
        after, outcome = self.world.step(key, state[0], action)
        return (after, state[1]), outcome


def test_of_a_world_with_large_states_what_was_seen_and_done_is_kept_instead():
    small, large = TransitionLayout(Market()), TransitionLayout(Beside(Market()))
    assert small.keeps_states
    assert not large.keeps_states
    # of three agents observed and reached 2 x 8, done 7, reward, end and part 3 each
    assert large.row_width == 16 + 7 + 3 * 3
    _, played = rollout(Beside(Market()), at_random, jax.random.key(3), 4)
    found, expected = large.unpack(large.pack(played)), Experience.of(played)
    jax.tree.map(np.testing.assert_array_equal, found, expected)
