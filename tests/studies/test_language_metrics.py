import hypothesis.strategies as st
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given

from ethogram.studies.language import metrics

SIGNALLING = (
    metrics.target_information,
    metrics.association_information,
    metrics.effective_vocabulary,
    metrics.synonymy,
    metrics.homonymy,
)


def meaning(robots, targets, words, say):
    """Speech in which `say(talker, guided, target)` is a word or the probability of each."""
    speech = np.full((robots, robots, targets, words), np.nan)
    for talker, guided, target in np.ndindex(robots, robots, targets):
        if guided != talker:
            said = np.asarray(say(talker, guided, target))
            speech[talker, guided, target] = said if said.ndim else np.eye(words)[said]
    return speech


def values(speech):
    """Every metric of signalling, for the first talker."""
    return [float(metric(speech)[0]) for metric in SIGNALLING]


def test_a_word_for_every_association_tells_all():
    perfect = meaning(3, 2, 7, lambda _, guided, target: 1 + 2 * guided + target)
    assert values(perfect) == pytest.approx([1, 1, 4, 1, 1])
    assert metrics.agreement(perfect) == 1


def test_a_word_for_every_target_tells_not_whose_it_is():
    half = meaning(3, 2, 4, lambda _, _guided, target: 1 + target)
    assert values(half) == pytest.approx([1, 0.5, 2, 1, 2])  # log 2 of log 4; two words for four


def test_a_word_for_every_robot_tells_nothing_of_the_target():
    whose = meaning(3, 2, 4, lambda _, guided, _target: 1 + guided)
    assert values(whose) == pytest.approx([0, 0.5, 2, 1, 2])


def test_one_word_for_everything_tells_nothing():
    same = meaning(4, 3, 5, lambda *_: 2)
    assert values(same) == pytest.approx([0, 0, 1, 1, 9])


def test_without_an_alphabet_there_is_one_word():
    silent = meaning(3, 3, 1, lambda *_: 0)
    assert values(silent) == pytest.approx([0, 0, 1, 1, 6])


def test_who_says_two_words_at_random_for_a_thing_has_synonyms_and_no_homonyms():
    chances = np.array([[0, 0.6, 0.4, 0, 0], [0, 0, 0, 0.4, 0.6]])
    speech = meaning(2, 2, 5, lambda _, _guided, target: chances[target])
    doubt = np.exp(-0.6 * np.log(0.6) - 0.4 * np.log(0.4))
    assert values(speech) == pytest.approx([1, 1, 2, doubt, 1])


def test_a_word_that_may_be_said_of_another_thing_is_a_homonym_now_and_then():
    chances = np.array([[0, 1, 0], [0, 0.4, 0.6]])  # word 1 is said in 0.7 of cases
    speech = meaning(2, 2, 3, lambda _, _guided, target: chances[target])
    doubt = -0.5 * np.log(5 / 7) - 0.2 * np.log(2 / 7)  # 0.7 H(5/7, 2/7)
    assert metrics.homonymy(speech)[0] == pytest.approx(np.exp(doubt))


def test_rare_words_count_for_less_in_the_vocabulary():
    # Three of four associations are called 1, one is called 2.
    speech = meaning(3, 2, 3, lambda _, guided, target: 2 if (guided, target) == (2, 1) else 1)
    entropy = -(0.75 * np.log(0.75) + 0.25 * np.log(0.25))
    assert metrics.effective_vocabulary(speech)[0] == pytest.approx(np.exp(entropy))
    assert metrics.association_information(speech)[0] == pytest.approx(entropy / np.log(4))
    # Target 1 is called 1 or 2, target 0 always 1: I = H(3/4, 1/4) - log(2) / 2.
    told = (entropy - np.log(2) / 2) / np.log(2)
    assert metrics.target_information(speech)[0] == pytest.approx(told)
    assert metrics.homonymy(speech)[0] == pytest.approx(3**0.75)  # H(3 things) in 3/4 of cases


def test_talkers_agree_on_what_both_can_know():
    # Robots 0 and 1 both know of 2, 0 and 2 of 1, 1 and 2 of 0; only 0 and 1 always agree.
    def say(talker, _guided, target):
        return 1 if talker == 2 else 2 + target

    assert metrics.agreement(meaning(3, 2, 4, say)) == pytest.approx(1 / 3)


def test_what_there_is_no_doubt_about_cannot_be_told():
    one_target = meaning(3, 1, 3, lambda *_: 1)
    assert np.isnan(metrics.target_information(one_target)).all()
    one_thing = meaning(2, 1, 3, lambda *_: 1)
    assert np.isnan(metrics.association_information(one_thing)).all()
    assert np.isnan(metrics.agreement(one_thing))


@given(st.integers(0, 2**32 - 1), st.integers(2, 4), st.integers(2, 4), st.integers(1, 9))
def test_a_metric_knows_no_word_by_name_and_stays_in_its_bounds(seed, robots, targets, words):
    rng = np.random.default_rng(seed)
    speech = meaning(robots, targets, words, lambda *_: rng.dirichlet(np.full(words, 0.3)))
    renamed = speech[..., rng.permutation(words)]
    things = (robots - 1) * targets
    tops = (1, 1, min(words, things), words, things)
    for metric, bottom, top in zip(SIGNALLING, (0, 0, 1, 1, 1), tops, strict=True):
        value = metric(speech)
        np.testing.assert_allclose(metric(renamed), value, rtol=1e-6, atol=1e-9)
        assert (value >= bottom - 1e-9).all()
        assert (value <= top + 1e-9).all()
    assert metrics.agreement(renamed) == pytest.approx(metrics.agreement(speech), nan_ok=True)


# Listening


def influence(weights, prior):
    return float(metrics.causal_influence(jnp.asarray(weights), jnp.asarray(prior)))


def test_who_does_as_told_is_influenced_by_all_bits_of_the_word():
    obeys = np.eye(4)[None]
    assert influence(obeys, np.full(4, 0.25)) == pytest.approx(2)


def test_who_does_not_listen_is_not_influenced():
    deaf = np.tile([0.7, 0.2, 0.1], (5, 4, 1))
    assert influence(deaf, np.full(4, 0.25)) == pytest.approx(0, abs=1e-6)


def test_influence_is_averaged_over_states():
    obeys, deaf = np.eye(2), np.full((2, 2), 0.5)
    assert influence(np.stack([obeys, deaf, deaf, deaf]), [0.5, 0.5]) == pytest.approx(0.25)


def test_words_that_cannot_be_said_have_no_influence():
    weights = np.array([[[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]]])
    assert influence(weights, [0.5, 0.5, 0.0]) == pytest.approx(1)
    assert influence(weights, [1.0, 0.0, 0.0]) == pytest.approx(0)


def test_influence_is_a_binary_channels_capacity_where_words_are_misheard():
    heard = np.array([[[0.9, 0.1], [0.1, 0.9]]])
    lost = -0.9 * np.log2(0.9) - 0.1 * np.log2(0.1)
    assert influence(heard, [0.5, 0.5]) == pytest.approx(1 - lost)
