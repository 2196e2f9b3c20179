"""The initial state: qualities by a power law, references, and which journal published what.

Thesis, section 7.3.5.  Papers belong to the years -2, -1 and 0, each with equal chance, and cite
those before them.  `assign` places them in journals:

- "two_phase": papers and references are drawn first; then the papers of the years -2 and -1, those
  that count for the impact factors of year 0, are placed in random order, with their citations
  known, each in the journal that brings the distribution of rounded impact factors nearest to the
  real one (journals without papers are in no bin, and count among all);
- "online": as printed, paper by paper as they are drawn, with the citations there are so far;
- "random": anywhere.

The papers of year 0 count for no impact factor yet, and go anywhere, but for "online".
"""

from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Float, Int, Key

from ethogram.core.keys import scaled, unit
from ethogram.core.settings import Number
from ethogram.worlds.publishing.impact_2018 import IMPACT_2018, Sources
from ethogram.worlds.publishing.literature import (
    INITIAL_YEARS,
    distinct,
    draws_for,
    first_beyond,
    recency,
    words,
)

Assignment = Literal["two_phase", "online", "random"]
Scale = Literal["linear", "none"]
AIMS = {of: np.array(counts) / sum(counts) for of, counts in IMPACT_2018.items()}
BINS = len(AIMS["journals"])


def power_law(
    key: Key[Array, ""],
    shape: tuple[int, ...],
    *,
    slope: Number,
    greatest: Number,
    quality_max: Number,
    scale: Scale,
) -> Float[Array, "..."]:
    """Qualities with a density of x^-slope on [1, greatest], stretched to [0, quality_max]."""
    chance = jax.random.uniform(key, shape)
    power = 1 - slope
    log = jnp.log(greatest)
    x = jnp.where(
        jnp.abs(power) < 1e-6,
        jnp.exp(chance * log),
        (1 + chance * (greatest**power - 1)) ** (1 / jnp.where(power == 0, 1.0, power)),
    )
    if scale == "linear":
        return (x - 1) / (greatest - 1) * quality_max
    return jnp.minimum(x, quality_max)


def initial_references(
    key: Key[Array, ""],
    level: Int[Array, "paper"],
    year: Int[Array, "paper"],
    references: int,
) -> Int[Array, "paper reference"]:
    """What each paper cites of those before it; years from 0, in order."""
    papers, draws = len(level), draws_for(references)
    bounds = jnp.searchsorted(year, jnp.arange(INITIAL_YEARS + 1))
    whole = jnp.cumsum(level)
    before = jnp.concatenate([jnp.zeros(1, whole.dtype), whole])
    prefix = whole - before[bounds[year]]
    own = jnp.arange(papers)
    limit = jnp.minimum(bounds[1:], own[:, None])  # paper, year: where what it can cite ends
    total = before[limit] - before[jnp.minimum(bounds[:-1], limit)]
    reach = jnp.cumsum(total * recency(year[:, None] - jnp.arange(INITIAL_YEARS)), axis=1)

    def drawn(key: Key[Array, ""], drafts: Int[Array, "few"]) -> Int[Array, "draw few"]:
        for_year, for_paper = words(key, draws, len(drafts))
        steps = reach[drafts]
        aim = unit(for_year) * steps[:, -1]
        block = jnp.minimum((aim[..., None] >= steps).sum(-1), INITIAL_YEARS - 1)
        mass, end = total[drafts, block], limit[drafts, block]
        first = jnp.minimum(bounds[block], end)
        paper = first_beyond(prefix, scaled(for_paper, mass), first, end, papers)
        return jnp.where(mass > 0, paper, -1)

    citable = jnp.cumsum(level > 0) - (level > 0)
    return distinct(key, drawn, jnp.minimum(references, citable), references)


def histogram(
    received: Int[Array, "journal"], papers: Int[Array, "journal"]
) -> Float[Array, "bin"]:
    """Shares of journals by rounded impact factor; those without papers are in no bin."""
    return jnp.zeros(BINS).at[_bins(received, papers)].add(papers > 0) / len(papers)


def distance(
    received: Int[Array, "journal"], papers: Int[Array, "journal"], sources: Sources = "journals"
) -> Float[Array, ""]:
    """From the real distribution, Euclidean."""
    return jnp.linalg.norm(histogram(received, papers) - AIMS[sources])


def place(
    key: Key[Array, ""],
    year: Int[Array, "paper"],
    cited: Int[Array, "paper reference"],
    journals: int,
    assign: Assignment,
    sources: Sources,
) -> Int[Array, "paper"]:
    """The journal of each initial paper; years from 0, in order."""
    for_place, for_order, for_ties = jax.random.split(key, 3)
    papers, last = len(year), INITIAL_YEARS - 1
    anywhere = jax.random.randint(for_place, (papers,), 0, journals)
    if assign == "random":
        return anywhere
    counts = (cited >= 0) & (year[:, None] == last) & (year[cited] < last)  # citations that count
    received = jnp.zeros(papers, jnp.int32).at[cited].add(counts)
    known = assign == "two_phase"
    chance = jax.random.uniform(for_order, (papers,))
    order = jnp.lexsort((chance, year == last)) if known else jnp.arange(papers)
    placed = (year < last).sum() if known else papers
    ties = jax.random.uniform(for_ties, (papers, journals))

    def settle(number: Int[Array, ""], so_far: tuple[Array, ...]) -> tuple[Array, ...]:
        journal, got, size = so_far
        paper = order[number]
        if not known:  # it brings its citations of those that were placed
            got = got.at[journal[cited[paper]]].add(counts[paper])
        one = (year[paper] < last).astype(jnp.int32)
        gain = one * received[paper] if known else 0
        chosen = _nearest(ties[number], got, size, gain, one, AIMS[sources])
        joins = jnp.arange(journals) == chosen
        return journal.at[paper].set(chosen), got + joins * gain, size + joins * one

    nothing = jnp.zeros(journals, jnp.int32)
    return lax.fori_loop(0, placed, settle, (anywhere, nothing, nothing))[0]


def _nearest(
    tie: Float[Array, "journal"],
    received: Int[Array, "journal"],
    papers: Int[Array, "journal"],
    gain: Int[Array, ""] | int,
    one: Int[Array, ""],
    aim: np.ndarray,
) -> Int[Array, ""]:
    """The journal that a paper should join so that the distribution is nearest to the real one.

    With a surplus of s journals in a bin over those wanted, one that leaves the bin changes the sum
    of squares by 1 - 2 s, one that enters it by 1 + 2 s.
    """
    journals, there = len(papers), papers > 0
    now, then = _bins(received, papers), _bins(received + gain, papers + one)
    bins = jnp.arange(BINS)
    at_now = (now[:, None] == bins) & there[:, None]
    surplus = at_now.sum(0) - journals * aim
    leaves = jnp.where(there, 1 - 2 * (at_now * surplus).sum(1), 0.0)
    enters = 1 + 2 * ((then[:, None] == bins) * surplus).sum(1)
    moves = (now != then) | (~there & (one > 0))
    change = jnp.where(moves, enters + leaves, 0.0)
    tied = change <= change.min() + 1e-4
    return jnp.argmax(jnp.where(tied, tie, -1.0))


def _bins(received: Int[Array, "journal"], papers: Int[Array, "journal"]) -> Int[Array, "journal"]:
    """The rounded impact factor of each journal; the last bin is of all that are larger."""
    rounded = jnp.round(received / jnp.maximum(papers, 1)).astype(jnp.int32)
    return jnp.minimum(rounded, BINS - 1)
