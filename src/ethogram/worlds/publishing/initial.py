"""The initial state: qualities by a power law, references, and which journal published what.

Thesis, section 7.3.5.  Papers belong to the years -2, -1 and 0, each with equal chance, and cite
those before them.  An `Assignment` places them in journals, one of these or one's own:

- "two_phase": papers and references are drawn first; then the papers of the years -2 and -1, those
  that count for the impact factors of year 0, are placed in random order, with their citations
  known, each in the journal that brings the distribution of rounded impact factors nearest to the
  real one (journals without papers are in no bin, and count among all);
- "online": as printed, paper by paper as they are drawn, with the citations there are so far;
- "random": anywhere.

The papers of year 0 count for no impact factor yet, and go anywhere, but for "online".
"""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Float, Int, Key

from ethogram.core.batching import add, in_any_copy, put, take
from ethogram.core.keys import branch, random_words, scaled, unit
from ethogram.core.settings import function_of, of_shape
from ethogram.worlds.publishing.citations import CitationStats
from ethogram.worlds.publishing.editorial import write
from ethogram.worlds.publishing.impact_2018 import IMPACT_2018, Sources
from ethogram.worlds.publishing.journals import empty
from ethogram.worlds.publishing.literature import (
    INITIAL_YEARS,
    begin,
    distinct,
    distinct_of_few,
    draws_for,
    first_beyond,
    recency,
)
from ethogram.worlds.publishing.state import Drafts, State

if TYPE_CHECKING:
    from ethogram.worlds.publishing.world import Publishing

# (key, year Int[paper] from 0 in order, cited Int[paper, reference], journals, shares of journals
# wanted by rounded impact factor Float[bin]) -> journal Int[paper]
Assignment: TypeAlias = Callable[[Array, Array, Array, int, np.ndarray], Array]
AIMS = {of: np.array(counts) / sum(counts) for of, counts in IMPACT_2018.items()}
BINS = len(AIMS["journals"])
FEW = 32  # papers, the first, that may have to cite nearly all before them


def initial_state(world: "Publishing", key: Key[Array, ""]) -> State:
    """Papers of the years -2 to 0, and authors that have published nothing."""
    for_authors, for_papers, for_years, for_cited, for_place, for_drafts = jax.random.split(key, 6)
    quality = world.power_law(for_authors, world.authors)
    level = world.levels(world.power_law(for_papers, world.initial_papers))
    year = jnp.sort(jax.random.randint(for_years, (world.initial_papers,), 0, INITIAL_YEARS))
    cited = initial_references(for_cited, level, year, world.references)
    assign = function_of(ASSIGNMENTS, world.init_assignment)
    journal = assign(for_place, year, cited, world.journals, AIMS[world.init_sources])
    journal = of_shape("init_assignment", journal, year.shape)
    counts = (cited >= 0) & (year[:, None] == INITIAL_YEARS - 1)
    counts &= take(year, jnp.maximum(cited, 0)) < INITIAL_YEARS - 1
    nobody = jnp.zeros(world.journals, jnp.int32)
    room = world.capacity + world.authors  # a step writes as many entries as there are authors
    in_year = jnp.zeros(world.journals * INITIAL_YEARS, jnp.int32)
    in_year = add(in_year, journal * INITIAL_YEARS + year, jnp.ones_like(year))
    papers = in_year.reshape(world.journals, INITIAL_YEARS)
    cited_in = take(journal, jnp.maximum(cited, 0))
    received = add(nobody, cited_in, counts.astype(jnp.int32))
    none = jnp.zeros(world.authors, jnp.int32)
    tally = jnp.zeros((world.authors, world.horizon + 2), jnp.int32)
    state = State(
        quality=quality,
        drafts=Drafts(none, jnp.full((world.authors, world.references), -1), none),
        citation_stats=CitationStats(none, none, tally),
        literature=begin(level, year, journal, cited, room, INITIAL_YEARS + world.horizon),
        qualities=empty(world.journals).add(journal, level, level >= 0),
        window=papers[:, :0:-1],
        this_year=nobody,
        received=nobody,
        impact=world.impact_factor(received, papers[:, :-1].sum(1)),
        rejected=nobody,
        time=jnp.int32(0),
    )
    everyone = jnp.ones(world.authors, bool)
    drafts = write(
        world, for_drafts, quality, state.drafts, state.literature, world.year(state), everyone
    )
    return eqx.tree_at(lambda s: s.drafts, state, drafts)


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
        for_year, for_paper = random_words(key, 2, draws, len(drafts))
        row = drafts * INITIAL_YEARS
        steps = [take(reach.reshape(-1), row + year) for year in range(INITIAL_YEARS)]
        aim = unit(for_year) * steps[-1]
        block = sum((aim >= step).astype(jnp.int32) for step in steps[:-1])
        mass, end = (take(each.reshape(-1), row + block) for each in (total, limit))
        first = jnp.minimum(take(bounds, block), end)
        paper = first_beyond(prefix, scaled(for_paper, mass), first, end, papers)
        return jnp.where(mass > 0, paper, -1)

    citable = jnp.cumsum(level > 0) - (level > 0)
    needed = jnp.minimum(references, citable)
    few = min(FEW, papers)
    own, year = own[:few], year[:few]
    weight = level[:few] * recency(year[:, None] - year) * (own < own[:, None])
    first = distinct_of_few(branch(key, 0), weight, needed[:few], references)
    later = distinct(
        branch(key, 1), drawn, jnp.where(jnp.arange(papers) < few, 0, needed), references
    )
    return jnp.concatenate([first, later[few:]])


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


def anywhere(
    key: Key[Array, ""],
    year: Int[Array, "paper"],
    cited: Int[Array, "paper reference"],
    journals: int,
    aim: Float[np.ndarray, "bin"],
) -> Int[Array, "paper"]:
    """A random journal for each initial paper."""
    del cited, aim
    for_place, _, _ = jax.random.split(key, 3)
    return jax.random.randint(for_place, year.shape, 0, journals)


def nearest_to_aim(
    key: Key[Array, ""],
    year: Int[Array, "paper"],
    cited: Int[Array, "paper reference"],
    journals: int,
    aim: Float[np.ndarray, "bin"],
    *,
    known: bool,
) -> Int[Array, "paper"]:
    """A journal for each initial paper, so that impact factors come near to those aimed at.

    Args:
        key: consumed.
        year: from 0, in order.
        cited: papers.
        journals: how many there are.
        aim: shares of journals wanted by rounded impact factor.
        known: whether papers are placed when the citations of all are known, or, as printed, with
            those of the papers before.

    """
    for_place, for_order, for_ties = jax.random.split(key, 3)
    papers, last = len(year), INITIAL_YEARS - 1
    random = jax.random.randint(for_place, (papers,), 0, journals)
    before = take(year, jnp.maximum(cited, 0)) < last
    counts = (cited >= 0) & (year[:, None] == last) & before  # citations that count
    received = add(jnp.zeros(papers, jnp.int32), jnp.maximum(cited, 0), counts.astype(jnp.int32))
    # the papers of the last year last: they count for nothing yet, and stay where they are
    chance = unit(random_words(for_order, papers))
    order = jnp.argsort(chance + 2.0 * (year == last)) if known else jnp.arange(papers)
    count = (year < last).sum() if known else jnp.int32(papers)
    ties = unit(random_words(for_ties, papers, journals))
    wanted = jnp.asarray(journals * aim)

    def settle(at: tuple[_Placed, Array]) -> tuple[_Placed, Array]:
        so_far, done = at
        paper = take(order, jnp.minimum(done, papers - 1))
        if not known:  # it brings its citations of those that were placed
            brought = so_far.received.at[so_far.journal[cited[paper]]].add(counts[paper])
            so_far = so_far._replace(received=brought)
        one = (take(year, paper) < last).astype(jnp.int32)
        gain = one * take(received, paper) * known
        chosen = _nearest(ties[done], so_far, gain, one, wanted)
        joins = jnp.arange(journals) == chosen
        return _Placed(
            put(so_far.journal, jnp.where(done < count, paper, papers), chosen),  # beyond: dropped
            so_far.received + joins * gain,
            so_far.papers + joins * one,
        ), done + 1

    nothing = jnp.zeros(journals, jnp.int32)
    start = _Placed(random, nothing, nothing), jnp.int32(0)
    placed, _ = lax.while_loop(lambda at: in_any_copy(at[1] < count), settle, start)
    return placed.journal


ASSIGNMENTS: dict[str, Assignment] = {
    "two_phase": partial(nearest_to_aim, known=True),
    "online": partial(nearest_to_aim, known=False),
    "random": anywhere,
}


class _Placed(NamedTuple):
    """Where papers are, as far as they were placed."""

    journal: Int[Array, "paper"]
    received: Int[Array, "journal"]  # citations that count
    papers: Int[Array, "journal"]  # that count


def _nearest(
    tie: Float[Array, "journal"],
    so_far: _Placed,
    gain: Int[Array, ""],
    one: Int[Array, ""],
    aim: Float[Array, "bin"],
) -> Int[Array, ""]:
    """The journal that a paper should join so that the distribution is nearest to the real one.

    With a surplus of s journals in a bin over those wanted, one that leaves the bin changes the sum
    of squares by 1 - 2 s, one that enters it by 1 + 2 s.
    """
    _, received, papers = so_far
    there = papers > 0
    now, then = _bins(received, papers), _bins(received + gain, papers + one)
    surplus = ((now == jnp.arange(BINS)[:, None]) & there).sum(1) - aim
    leaves = jnp.where(there, 1 - 2 * take(surplus, now), 0.0)
    enters = 1 + 2 * take(surplus, then)
    moves = (now != then) | (~there & (one > 0))
    change = jnp.where(moves, enters + leaves, 0.0)
    return jnp.argmax(jnp.where(change <= change.min() + 1e-4, tie, -1.0))


def _bins(received: Int[Array, "journal"], papers: Int[Array, "journal"]) -> Int[Array, "journal"]:
    """The rounded impact factor of each journal; the last bin is of all that are larger."""
    rounded = jnp.round(received / jnp.maximum(papers, 1)).astype(jnp.int32)
    return jnp.minimum(rounded, BINS - 1)
