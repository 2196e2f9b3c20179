import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chisquare

from ethogram.core.keys import counter_bits, fold_in, trial_keys


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
