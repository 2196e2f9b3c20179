"""The editorial step: submissions are accepted or rejected, papers come out and cite, years end.

Within a step drafts cite what there was before it.
"""

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING

import equinox as eqx
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float, Int, Key

from ethogram.core.batching import add, in_any_copy, put, take
from ethogram.core.keys import branch
from ethogram.worlds.publishing.citations import CitationStats, cite, rise
from ethogram.worlds.publishing.journals import Qualities
from ethogram.worlds.publishing.literature import (
    INITIAL_YEARS,
    TOGETHER,
    Literature,
    append,
    chosen_first,
    distinct,
    draw,
    draws_for,
    first_block,
)
from ethogram.worlds.publishing.state import Drafts, State

if TYPE_CHECKING:
    from ethogram.worlds.publishing.world import Publishing

# (citations received Int[journal], papers of two years Int[journal]) -> impact Float[journal]
ImpactFactor = Callable[[Array, Array], Array]


class Published(eqx.Module):
    """What changes as papers are published."""

    literature: Literature
    citation_stats: CitationStats
    qualities: Qualities
    received: Int[Array, "journal"]


def submit(
    world: "Publishing",
    key: Key[Array, ""],
    state: State,
    choice: Int[Array, "author"],
    share: Float[Array, "journal"],
    acting: Bool[Array, "author"],
) -> State:
    """The state after those who act have submitted or written anew.

    Args:
        world: its settings.
        key: consumed; draws the new drafts.
        state: before.
        choice: 0, to write anew, or a journal, from 1.
        share: the quantile below which each journal's editor rejects; below 0, nothing is.
        acting: who acts.

    """
    journal = jnp.maximum(choice - 1, 0)
    submits = acting & (choice > 0)
    threshold = jnp.where(share < 0, -jnp.inf, state.qualities.quantile(jnp.maximum(share, 0)))
    accepted = submits & (state.drafts.level >= take(threshold, journal))
    rejected = submits & ~accepted
    published = publish(world, state, journal, accepted)
    papers = published.literature
    writes = accepted | (acting & (choice == 0))
    known = papers.as_of(state.literature)
    drafts = write(world, key, state.quality, state.drafts, known, world.year(state), writes)
    return State(
        quality=state.quality,
        drafts=Drafts(drafts.level, drafts.cited, drafts.rejections + rejected),
        citation_stats=published.citation_stats,
        literature=papers,
        qualities=published.qualities,
        window=state.window,
        this_year=add(state.this_year, journal, accepted.astype(jnp.int32)),
        received=published.received,
        impact=state.impact,
        rejected=add(state.rejected, journal, rejected.astype(jnp.int32)),
        time=state.time,
    )


def publish(
    world: "Publishing",
    state: State,
    journal: Int[Array, "author"],
    accepted: Bool[Array, "author"],
) -> Published:
    """The accepted drafts as papers, some at a time, with what they cite counted."""
    waiting, count = chosen_first(accepted), accepted.sum()
    some = min(world.authors, TOGETHER)
    tally = state.citation_stats.tally.at[:, 0].add(accepted.astype(jnp.int32))
    stats = eqx.tree_at(lambda s: s.tally, state.citation_stats, tally)
    before = Published(state.literature, stats, state.qualities, state.received)

    def some_more(at: tuple[Published, Array]) -> tuple[Published, Array]:
        so_far, done = at
        number = done + jnp.arange(some)
        author = take(waiting, jnp.minimum(number, world.authors - 1))
        due, place = number < count, take(journal, author)
        level = jnp.where(due, take(state.drafts.level, author), 0)
        cited = jnp.where(due[:, None], state.drafts.cited[author], -1)
        papers = append(so_far.literature, state.time, author, place, level, due.sum())
        stats, papers = cite(papers, so_far.citation_stats, cited)
        received = so_far.received + citations_in_window(world, papers, world.year(state), cited)
        qualities = so_far.qualities.add(place, level, due)
        return Published(papers, stats, qualities, received), done + some

    begin = before, jnp.int32(0)
    after, _ = lax.while_loop(lambda at: in_any_copy(at[1] < count), some_more, begin)
    papers = after.literature
    # where the next block starts: outside the loop, as also a step without papers has an end
    start = put(papers.start, INITIAL_YEARS + state.time + 1, papers.published)
    papers = dataclasses.replace(papers, start=start)
    return Published(papers, rise(after.citation_stats), after.qualities, after.received)


def citations_in_window(
    world: "Publishing",
    papers: Literature,
    year: Int[Array, ""],
    cited: Int[Array, "draft reference"],
) -> Int[Array, "journal"]:
    """Citations, by the cited papers' journals, of papers of the two years before (eq. 7.3)."""
    first, end = (
        take(papers.start, first_block(at, world.steps_per_year)) for at in (year - 2, year)
    )
    counts = (cited >= first) & (cited < end)
    journal = take(papers.journal, jnp.maximum(cited, 0))
    return add(jnp.zeros(world.journals, jnp.int32), journal, counts.astype(jnp.int32))


def write(
    world: "Publishing",
    key: Key[Array, ""],
    quality: Float[Array, "author"],
    drafts: Drafts,
    known: Literature,
    year: Int[Array, ""],
    who: Bool[Array, "author"],
) -> Drafts:
    """New drafts of those who write, the old ones of the others."""
    level = world.levels(world.draft_quality(branch(key, 0), quality))
    largest = max(world.authors, world.initial_papers)
    drawn = draw(known, year, world.steps_per_year, draws_for(world.references), largest)
    needed = jnp.where(who, jnp.minimum(world.references, known.citable), 0)
    cited = distinct(branch(key, 1), drawn, needed, world.references)
    return Drafts(
        jnp.where(who, level, drafts.level),
        jnp.where(who[:, None], cited, drafts.cited),
        jnp.where(who, 0, drafts.rejections),
    )


def pass_time(state: State, steps_per_year: int, impact_factor: ImpactFactor) -> State:
    """The next moment; a year that ends gives its impact factors and becomes the year before."""
    time = state.time + 1
    ends = time % steps_per_year == 0
    shifted = jnp.stack([state.this_year, state.window[:, 0]], 1)
    impact = impact_factor(state.received, state.window.sum(1))
    return eqx.tree_at(
        lambda s: (s.window, s.this_year, s.received, s.impact, s.time),
        state,
        (
            jnp.where(ends, shifted, state.window),
            jnp.where(ends, 0, state.this_year),
            jnp.where(ends, 0, state.received),
            jnp.where(ends, impact, state.impact),
            time,
        ),
    )
