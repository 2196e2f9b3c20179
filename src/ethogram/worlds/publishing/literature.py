"""What has been published: papers as arrays of a fixed capacity, and how drafts choose references.

Papers stand in the order in which they were published, in blocks: one for each initial year, then
one for each step.  A paper's quality is one of `LEVELS` whole numbers, so that sums of qualities
are exact in 32 bits: `prefix` adds them up within a block.

A draft cites distinct papers, each with a chance in proportion to quality times recency,
1 / max(1, age^3), with the age in years at the time of writing.  Recency is that of a block, so a
draw takes a block by its total times its recency, and in it a paper by binary search: a cost that
grows with the logarithm of the number of papers alone.  Draws that repeat a paper are drawn again,
which is to draw without replacement, one after the other.
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float, Int, Key

from ethogram.core.batching import add, in_any_copy, put, take
from ethogram.core.keys import branch, random_words, scaled, unit

LEVELS = 2**14  # of quality, from 0 to the largest
INITIAL_YEARS = 3  # -2, -1, 0: a block each

TOGETHER = 40  # drafts that are served at once: in most steps, most authors wait

Found = tuple[Array, Array]  # papers, draft by draft, and how many of them there are
# For a key and some drafts: papers that these would cite, with repetitions; -1, rarely, for none.
Draw = Callable[[Key[Array, ""], Int[Array, "few"]], Int[Array, "draw few"]]


class Literature(eqx.Module):
    """All published papers; entries from `published` on are empty."""

    level: Int[Array, "paper"]  # of quality
    prefix: Int[Array, "paper"]  # sum of the levels of its block up to and with it
    author: Int[Array, "paper"]  # -1: none, as of initial papers
    journal: Int[Array, "paper"]
    citations: Int[Array, "paper"]
    mark: Int[Array, "paper"]  # the last citation that a paper got, by its number in the step
    start: Int[Array, "bound"]  # first paper of each block, and behind the last one
    total: Int[Array, "block"]  # sum of the levels of each block
    published: Int[Array, ""]
    citable: Int[Array, ""]  # published with a level above 0

    def as_of(self, earlier: "Literature") -> "Literature":
        """What was published at an earlier time, in the arrays of now.

        Papers are only ever added, so the bounds of then tell them.  Whoever looks back like this
        keeps no older array alive, and arrays need not be copied to be written to.
        """
        return dataclasses.replace(
            self,
            start=earlier.start,
            total=earlier.total,
            published=earlier.published,
            citable=earlier.citable,
        )


def begin(
    level: Int[Array, "paper"],
    year: Int[Array, "paper"],
    journal: Int[Array, "paper"],
    cited: Int[Array, "paper reference"],
    room: int,
    blocks: int,
) -> Literature:
    """The initial papers, by nobody, in the order of their years from 0.

    Args:
        level: of quality.
        year: 0, 1 or 2.
        journal: that published them.
        cited: what they cite; -1: nothing.
        room: for how many papers, these among them.
        blocks: how many there will be.

    """
    papers = len(level)
    bounds = jnp.searchsorted(year, jnp.arange(INITIAL_YEARS + 1))
    whole = jnp.cumsum(level)
    before = jnp.concatenate([jnp.zeros(1, whole.dtype), whole])

    def roomy(values: Array, fill: int = 0) -> Array:
        return jnp.full(room, fill, jnp.int32).at[:papers].set(values)

    counts = (cited >= 0).astype(jnp.int32)
    return Literature(
        level=roomy(level),
        prefix=roomy(whole - before[bounds[year]]),
        author=roomy(jnp.full(papers, -1), -1),
        journal=roomy(journal),
        citations=add(roomy(jnp.zeros(papers, jnp.int32)), jnp.maximum(cited, 0), counts),
        mark=roomy(jnp.zeros(papers, jnp.int32)),
        start=jnp.full(blocks + 1, papers, jnp.int32).at[: INITIAL_YEARS + 1].set(bounds),
        total=add(jnp.zeros(blocks, jnp.int32), year, level),
        published=jnp.int32(papers),
        citable=(level > 0).sum(),
    )


def append(
    papers: Literature,
    time: Int[Array, ""],
    author: Int[Array, "draft"],
    journal: Int[Array, "draft"],
    level: Int[Array, "draft"],
    count: Int[Array, ""],
) -> Literature:
    """Add the first so many drafts to the block of a step, which still has to be ended."""
    block, place = INITIAL_YEARS + time, papers.published + jnp.arange(len(author))
    return Literature(
        level=put(papers.level, place, level),
        prefix=put(papers.prefix, place, take(papers.total, block) + jnp.cumsum(level)),
        author=put(papers.author, place, author),
        journal=put(papers.journal, place, journal),
        citations=papers.citations,
        mark=papers.mark,
        start=papers.start,
        total=add(papers.total, block, level.sum()),
        published=papers.published + count,
        citable=papers.citable + (level > 0).sum(),
    )


def year_of(block: Int[Array, "..."], steps_per_year: int) -> Int[Array, "..."]:
    """The year of a block: -2, -1, 0 for the initial ones, then 1 for the first steps."""
    initial = block - (INITIAL_YEARS - 1)
    return jnp.where(block < INITIAL_YEARS, initial, 1 + (block - INITIAL_YEARS) // steps_per_year)


def first_block(year: Int[Array, ""], steps_per_year: int) -> Int[Array, ""]:
    """The first block of a year."""
    initial = year + (INITIAL_YEARS - 1)
    return jnp.where(year < 1, initial, INITIAL_YEARS + (year - 1) * steps_per_year)


def recency(age: Int[Array, "..."]) -> Float[Array, "..."]:
    """1 / max(1, age^3), with the age in years."""
    return 1.0 / jnp.maximum(1, age).astype(float) ** 3


def draws_for(references: int) -> int:
    """Draws for each draft before looking which are new: enough, mostly."""
    return references + max(2, references // 5)


def draw(
    literature: Literature,
    year: Int[Array, ""],
    steps_per_year: int,
    draws: int,
    largest: int,
) -> Draw:
    """Draws of papers for drafts of this year.

    Args:
        literature: what can be cited.
        year: the current one, from 1.
        steps_per_year: that blocks of a year are.
        draws: for each draft.
        largest: number of papers that a block can have.

    """
    blocks = jnp.arange(len(literature.total))
    age = year - year_of(blocks, steps_per_year)
    # the oldest first: sums of small weights stay exact, and so do numbers near zero
    reach = jnp.cumsum(literature.total * jnp.where(age >= 0, recency(age), 0.0))

    def drawn(key: Key[Array, ""], drafts: Int[Array, "few"]) -> Int[Array, "draw few"]:
        for_block, for_paper = random_words(key, 2, draws, len(drafts))
        anywhere = jnp.zeros_like(for_block, jnp.int32), len(blocks), len(blocks)
        block = first_beyond(reach, unit(for_block) * reach[-1], *anywhere)
        mass = take(literature.total, block)
        first, end = take(literature.start, block), take(literature.start, block + 1)
        paper = first_beyond(literature.prefix, scaled(for_paper, mass), first, end, largest)
        return jnp.where(mass > 0, paper, -1)

    return drawn


def first_beyond(
    rising: Array, aim: Array, first: Int[Array, "..."], end: Int[Array, "..."] | int, most: int
) -> Int[Array, "..."]:
    """The first entry from `first` to before `end`, at most `most` later, that exceeds the aim.

    The last one if none does.
    """

    def halve(before: Array, stride: Int[Array, ""]) -> tuple[Array, None]:
        last = before + (stride - 1)
        below = take(rising, jnp.minimum(last, len(rising) - 1)) <= aim
        return jnp.where(below & (last < end - 1), last + 1, before), None

    # a loop: written out, the compiler would compute every look-up from all those before it again
    powers = reversed(range((most - 1).bit_length()))
    strides = jnp.array([1 << power for power in powers], jnp.int32)
    return lax.scan(halve, first, strides)[0]


def distinct(
    key: Key[Array, ""],
    drawn: Draw,
    needed: Int[Array, "draft"],
    references: int,
) -> Int[Array, "draft reference"]:
    """The first different papers of a sequence of draws for each draft; -1 where fewer are needed.

    Drafts that need any are served some at a time, until these have all that they need.
    """
    drafts = len(needed)
    few = min(drafts, TOGETHER)
    waiting, count = chosen_first(needed > 0), (needed > 0).sum()
    slot = jnp.arange(references)

    def serve(at: tuple[Array, Array]) -> tuple[Array, Array]:
        cited, done = at
        number = done + jnp.arange(few)
        due = number < count
        draft = take(waiting, jnp.minimum(number, drafts - 1))

        def papers(round_: Int[Array, ""]) -> Int[Array, "draw few"]:
            return drawn(branch(branch(key, done), round_), draft)

        found = _different(papers, jnp.where(due, take(needed, draft), 0), references)
        place = jnp.where(due, draft, drafts) * references + slot[:, None]  # beyond: dropped
        return put(cited, place, found), done + few

    nothing = jnp.full(drafts * references, -1), jnp.int32(0)
    cited, _ = lax.while_loop(lambda at: in_any_copy(at[1] < count), serve, nothing)
    return cited.reshape(drafts, references)


def _different(
    papers: Callable[[Int[Array, ""]], Int[Array, "draw few"]],
    needed: Int[Array, "few"],
    references: int,
) -> Int[Array, "reference few"]:
    """The first different papers of rounds of draws; drafts are the last axis, which is fast."""
    slot = jnp.arange(references)[:, None]

    def add(found: Found, paper: Int[Array, "few"]) -> tuple[Found, None]:
        kept, count = found
        new = (paper >= 0) & (kept != paper).all(0) & (count < needed)
        return (jnp.where(new & (slot == count), paper, kept), count + new), None

    def more(at: tuple[Found, Array]) -> tuple[Found, Array]:
        found, round_ = at
        return lax.scan(add, found, papers(round_))[0], round_ + 1

    start = jnp.full((references, len(needed)), -1), jnp.zeros_like(needed)
    (kept, _), _ = lax.while_loop(lambda at: (at[0][1] < needed).any(), more, (start, jnp.int32(0)))
    return kept


def distinct_of_few(
    key: Key[Array, ""],
    weight: Float[Array, "draft paper"],
    needed: Int[Array, "draft"],
    references: int,
) -> Int[Array, "draft reference"]:
    """As `distinct`, but weighing every paper for every draft: where nearly all must be cited.

    The papers with the largest log(weight) + g, with g of the standard Gumbel distribution, are a
    draw without replacement (Yellott, 1977).
    """
    gumbel = -jnp.log(-jnp.log(unit(random_words(key, *weight.shape)) * (1 - 2.0**-24)))
    score = jnp.where(weight > 0, jnp.log(weight) + gumbel, -jnp.inf)
    papers = jnp.arange(weight.shape[1])

    def best(score: Array, _: None) -> tuple[Array, Array]:
        paper = score.argmax(1)
        return jnp.where(papers == paper[:, None], -jnp.inf, score), paper

    _, cited = lax.scan(best, score, None, references)
    return jnp.where(jnp.arange(references) < needed[:, None], cited.T, -1)


def chosen_first(chosen: Bool[Array, "item"]) -> Int[Array, "item"]:
    """The numbers of all items, those chosen first, each part in order."""
    number, so_far = jnp.arange(len(chosen)), jnp.cumsum(chosen)
    place = jnp.where(chosen, so_far - 1, so_far[-1] + number - so_far)
    return put(jnp.zeros_like(number), place, number)
