import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from ethogram.core.errors import EthogramError
from ethogram.core.keys import (
    branch,
    counter_bits,
    fold_in,
    gaussian,
    require_key,
    scaled,
    trial_keys,
    unit,
)
from ethogram.core.keys import random_words as words_of


def data(keys):
    return np.asarray(jax.random.key_data(keys))


def test_a_trial_has_the_same_key_however_many_trials_there_are():
    np.testing.assert_array_equal(data(trial_keys(3, "a", 5))[:2], data(trial_keys(3, "a", 2)))


def test_seed_case_and_trial_each_change_the_key():
    keys = np.concatenate(
        [data(trial_keys(seed, case, 3)) for seed in (0, 1) for case in ("a", "b")]
    )
    assert len(np.unique(keys, axis=0)) == 12


def test_a_case_keeps_its_keys_from_release_to_release():
    expected = [[1585427432, 2428714145], [1959314046, 3746476230]]
    np.testing.assert_array_equal(data(trial_keys(7, "cooperative-always-hidden", 2)), expected)


def test_keys_of_any_shape_are_folded_one_by_one():
    keys = jax.random.split(jax.random.key(0), (2, 3))
    folded = fold_in(keys, 5)
    np.testing.assert_array_equal(data(folded[1, 2]), data(jax.random.fold_in(keys[1, 2], 5)))


@pytest.fixture(scope="module")
def words():
    """Words of 400 episodes' keys, a thousand each."""
    keys = jax.random.split(jax.random.key(11), 400)
    return np.asarray(jax.vmap(counter_bits, (0, None))(keys, jnp.arange(1000)))


@pytest.mark.parametrize("shift", [0, 8, 16, 24])
def test_every_byte_of_the_words_is_uniform(words, shift):
    counts = np.bincount((words.reshape(-1) >> shift) & 255, minlength=256)
    assert chisquare(counts).pvalue > 1e-4


def test_halves_of_a_word_and_neighbouring_words_are_independent(words):
    def joint(a, b):
        return np.bincount((a.astype(int) * 64 + b).reshape(-1), minlength=64 * 64)

    high, low = words >> 26, words & 63
    for counts in (joint(high, low), joint(high[:, :-1], high[:, 1:]), joint(low[:-1], low[1:])):
        assert chisquare(counts).pvalue > 1e-4


def test_scaled_words_are_those_of_long_arithmetic():
    bits = np.random.default_rng(0).integers(0, 2**32, 1000, dtype=np.uint32)
    bits[:3] = 0, 2**32 - 1, 2**31
    for bound in (1, 7, 20_000, 2**31 - 1):
        exactly = (bits.astype(np.uint64) * np.uint64(bound)) >> np.uint64(32)
        np.testing.assert_array_equal(scaled(jnp.asarray(bits), bound), exactly)


def test_words_make_uniform_and_normal_numbers():
    found = words_of(jax.random.key(3), 100, 200)
    assert kstest(np.asarray(unit(found)).ravel(), "uniform").pvalue > 0.001
    assert kstest(np.asarray(gaussian(found)).ravel(), "norm").pvalue > 0.001
    ends = jnp.array([0, 2**32 - 1], jnp.uint32)
    assert np.isfinite(gaussian(ends)).all()
    assert 0 < unit(ends)[0] < 2e-10


def test_branches_share_no_word_with_each_other_or_with_their_key():
    key = jax.random.key(4)
    first, second = branch(key, 0), branch(key, 1)
    seen = [np.asarray(words_of(each, 500)) for each in (key, first, second, branch(first, 0))]
    assert len(np.unique(seen)) >= 2000 - 2  # of 2^32 words, two are alike by chance now and then
    many = jax.vmap(lambda number: branch(key, number))(jnp.arange(3))
    np.testing.assert_array_equal(jax.random.key_data(many)[1], jax.random.key_data(second))


def test_what_is_no_random_key_is_refused_with_what_is_one():
    require_key("train", jax.random.split(jax.random.key(0)))
    for wrong in (0, jax.random.PRNGKey(0)):
        with pytest.raises(EthogramError, match=r"train: key = .*; allowed: jax"):
            require_key("train", wrong)
