"""What the talkers came to mean, and whether anybody listens.

A talker's speech is `meaning[talker, guided, target, word]`: the probability of each word (word 0
is silence) for every association of a guided robot with a target, NaN where a robot would guide
itself.  The associations that a talker can know are finite and equally likely, by the symmetry of
random derangements and uniform targets, so everything here is exact by enumeration.

Where a metric speaks of the word of an association, it is the likeliest one: noise aside, what
the talker says.  Entropies are in nats.  All metrics but the last are positive signalling, in the
terms of Lowe, Foerster, Boureau, Pineau, Dauphin (2019, On the Pitfalls of Measuring Emergent
Communication, AAMAS); `causal_influence` is positive listening.
"""

from itertools import combinations

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.special import entr as jax_entr
from jaxtyping import Float
from scipy.special import entr

Meaning = Float[np.ndarray, "talker guided target word"]
PerTalker = Float[np.ndarray, "talker"]


def target_information(meaning: Meaning) -> PerTalker:
    """Normalised mutual information between a talker's word and the target it knows.

    I(word; target) / H(target), the share of the doubt about the target that the word removes
    from who does not know which robot it is for: 1 when the word alone tells the target, 0 when
    it tells nothing of it, as without an alphabet.  Undefined (NaN) where there is one target.
    """
    return _normalised_information(_said(meaning).mean(1))


def association_information(meaning: Meaning) -> PerTalker:
    """Normalised mutual information between a talker's word and all it knows.

    I(word; guided and target) / H(guided and target): 1 when every association has a word of its
    own, which is what the game rewards; 0 when all are called alike.  Undefined (NaN) where there
    is one association.  With two robots it equals `target_information`.
    """
    return _normalised_information(_flat(_said(meaning)))


def effective_vocabulary(meaning: Meaning) -> PerTalker:
    """How many words a talker uses: exp H(word), between 1 (always the same) and |W|.

    Words used equally often count fully, rare ones for less; silence counts as a word.
    """
    return np.exp(entr(_said(meaning).mean((1, 2))).sum(-1))


def synonymy(meaning: Meaning) -> PerTalker:
    """Words per association: exp H(word | association); 1 means that there are no synonyms.

    Synonyms are words of one talker with the same meaning.  With its likeliest words alone a
    talker has none, so this is about what it says as it is sampled.
    """
    return np.exp(entr(_known(meaning)).sum(-1).mean((1, 2)))


def homonymy(meaning: Meaning) -> PerTalker:
    """Associations per word: exp H(association | word); 1 means that there are no homonyms.

    Homonyms are words of one talker with several meanings.  Sampled, as in `synonymy`; a talker
    that says always the same reaches the number of associations that it can know.
    """
    speech = _flat(_known(meaning))
    associations = speech.shape[1]
    return np.exp(np.log(associations) - _information(speech))


def agreement(meaning: Meaning) -> float:
    """Share of cases in which two talkers have the same word for the same association.

    Over all pairs of talkers and all associations that both can know.  Undefined (NaN) with two
    robots, which never know of the same robot.
    """
    word, known = meaning.argmax(-1), ~np.isnan(meaning[..., 0])
    alike = [
        (word[one] == word[other])[known[one] & known[other]]
        for one, other in combinations(range(len(meaning)), 2)
    ]
    shared = np.concatenate(alike)
    return float(shared.mean()) if shared.size else float("nan")


def causal_influence(
    weights: Float[Array, "state word choice"], prior: Float[Array, "word"]
) -> Float[Array, ""]:
    """Causal influence of communication in bits: what a word, put in its place, changes.

    The mutual information, averaged over states, between the word that the listener is made to
    hear (drawn from `prior`) and its choice, whose probabilities under each word are `weights`.
    Lowe et al. (2019) weight words as the talker says them; a uniform prior over the usable words
    asks what the listener would react to, whatever the talker makes of it.
    """
    overall = jnp.einsum("swc,w->sc", weights, prior)
    doubt_left = jax_entr(weights).sum(-1) @ prior
    return (jax_entr(overall).sum(-1) - doubt_left).mean() / jnp.log(2.0)


def _known(meaning: Meaning) -> Float[np.ndarray, "talker other target word"]:
    """The associations that each talker can know: those of the other robots."""
    talkers, guided, targets, words = meaning.shape
    return meaning[~np.isnan(meaning[..., 0])].reshape(talkers, guided - 1, targets, words)


def _said(meaning: Meaning) -> Float[np.ndarray, "talker other target word"]:
    """The likeliest word of each association that a talker can know, one-hot."""
    return np.eye(meaning.shape[-1])[_known(meaning).argmax(-1)]


def _flat(
    speech: Float[np.ndarray, "talker other target word"],
) -> Float[np.ndarray, "talker association word"]:
    return speech.reshape(len(speech), -1, speech.shape[-1])


def _information(speech: Float[np.ndarray, "talker thing word"]) -> PerTalker:
    """I(thing; word) of equally likely things, given the probability of each word for each."""
    return entr(speech.mean(1)).sum(-1) - entr(speech).sum(-1).mean(1)


def _normalised_information(speech: Float[np.ndarray, "talker thing word"]) -> PerTalker:
    """I(thing; word) / H(thing); undefined (NaN) where there is one thing."""
    things = speech.shape[1]
    if things == 1:
        return np.full(len(speech), np.nan)
    return _information(speech) / np.log(things)
