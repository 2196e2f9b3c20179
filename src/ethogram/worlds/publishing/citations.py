"""How citations are counted as they come, and h-indices with them (eq. 7.1).

An author's papers are tallied by their number of citations.  With `above`, the papers that have
more citations than the h-index, it is known without counting anew whether the h-index rises: as
soon as more than h papers have more than h citations.
"""

import equinox as eqx
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Int

from ethogram.core.batching import add, in_any_copy, put, take
from ethogram.worlds.publishing.literature import Literature


class CitationStats(eqx.Module):
    """How much the authors' papers are cited, and what follows."""

    h_index: Int[Array, "author"]
    above: Int[Array, "author"]  # papers with more citations than that
    tally: Int[Array, "author count"]  # papers with exactly so many citations; the last: or more


def cite(
    papers: Literature, stats: CitationStats, cited: Int[Array, "draft reference"]
) -> tuple[CitationStats, Literature]:
    """Count citations; h-indices are not raised yet."""
    events = cited.reshape(-1)
    there, paper = events >= 0, jnp.maximum(events, 0)
    beyond = jnp.where(there, events, len(papers.level))  # dropped, if there is none
    number = jnp.arange(len(events))
    before = take(papers.citations, paper)
    # one each, made of what was read: it is read before it is written, and not copied
    citations = add(papers.citations, beyond, (before >= 0).astype(jnp.int32))
    after = take(citations, paper)
    mark = put(papers.mark, beyond, number)
    once = there & (take(mark, paper) == number)  # each paper, once
    owner = take(papers.author, paper)
    counts = once & (owner >= 0)
    owner, counted = jnp.where(counts, owner, 0), counts.astype(jnp.int32)
    width = stats.tally.shape[1]
    tally = stats.tally.reshape(-1)
    tally = add(tally, owner * width + jnp.minimum(before, width - 1), -counted)
    tally = add(tally, owner * width + jnp.minimum(after, width - 1), counted)
    reached = take(stats.h_index, owner)
    passes = (before <= reached) & (after > reached)
    above = add(stats.above, owner, counted * passes)
    stats = CitationStats(stats.h_index, above, tally.reshape(-1, width))
    return stats, eqx.tree_at(lambda p: (p.citations, p.mark), papers, (citations, mark))


def rise(stats: CitationStats) -> CitationStats:
    """Let h-indices be as high as they may."""
    authors, width = stats.tally.shape
    tally = stats.tally.reshape(-1)

    def rising(at: tuple[Array, Array]) -> Array:
        return in_any_copy((at[1] > at[0]).any())

    def by_one(at: tuple[Array, Array]) -> tuple[Array, Array]:
        h_index, above = at
        up = above > h_index
        h_index = h_index + up
        exactly = take(tally, jnp.arange(authors) * width + h_index)
        return h_index, above - jnp.where(up, exactly, 0)

    h_index, above = lax.while_loop(rising, by_one, (stats.h_index, stats.above))
    return CitationStats(h_index, above, stats.tally)
