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

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float, Int, Key

LEVELS = 2**14  # of quality, from 0 to the largest
INITIAL_YEARS = 3  # -2, -1, 0: a block each
AT_ONCE = 16  # draws for each draft before looking which are new

Draw = Callable[[Key[Array, ""]], Int[Array, "draft draw"]]


class Literature(eqx.Module):
    """All published papers; entries from `published` on are empty."""

    level: Int[Array, "paper"]  # of quality
    prefix: Int[Array, "paper"]  # sum of the levels of its block up to and with it
    author: Int[Array, "paper"]  # -1: none, as of initial papers
    journal: Int[Array, "paper"]
    block: Int[Array, "paper"]
    citations: Int[Array, "paper"]
    mark: Int[Array, "paper"]  # the last citation that a paper got, by its number in the step
    start: Int[Array, "bound"]  # first paper of each block, and behind the last one
    total: Int[Array, "block"]  # sum of the levels of each block
    published: Int[Array, ""]
    citable: Int[Array, ""]  # published with a level above 0


def year_of(block: Int[Array, "..."], steps_per_year: int) -> Int[Array, "..."]:
    """The year of a block: -2, -1, 0 for the initial ones, then 1 for the first steps."""
    initial = block - (INITIAL_YEARS - 1)
    return jnp.where(block < INITIAL_YEARS, initial, 1 + (block - INITIAL_YEARS) // steps_per_year)


def recency(age: Int[Array, "..."]) -> Float[Array, "..."]:
    """1 / max(1, age^3), with the age in years."""
    return 1.0 / jnp.maximum(1, age).astype(float) ** 3


def draw(literature: Literature, year: Int[Array, ""], steps_per_year: int, drafts: int) -> Draw:
    """Draws of papers that a draft of this year would cite, with repetitions."""
    blocks = jnp.arange(len(literature.total))
    age = year - year_of(blocks, steps_per_year)
    weight = literature.total * jnp.where(age >= 0, recency(age), 0.0)
    reach = jnp.cumsum(weight)

    def drawn(key: Key[Array, ""]) -> Int[Array, "draft draw"]:
        for_block, for_paper = jax.random.split(key)
        shape = drafts, AT_ONCE
        aim = jax.random.uniform(for_block, shape) * reach[-1]
        block = jnp.minimum(jnp.searchsorted(reach, aim, side="right"), len(blocks) - 1)
        aim = jax.random.randint(for_paper, shape, 0, jnp.maximum(literature.total[block], 1))
        return within(literature.prefix, literature.start[block], literature.start[block + 1], aim)

    return drawn


def within(
    prefix: Int[Array, "paper"],
    first: Int[Array, "..."],
    end: Int[Array, "..."],
    aim: Int[Array, "..."],
) -> Int[Array, "..."]:
    """The first paper from `first` to before `end` whose prefix exceeds the aim."""

    def halve(_: Any, bounds: tuple[Array, Array]) -> tuple[Array, Array]:
        low, high = bounds
        middle = (low + high) // 2
        beyond = prefix[jnp.minimum(middle, len(prefix) - 1)] > aim
        open_ = low < high
        return jnp.where(open_ & ~beyond, middle + 1, low), jnp.where(open_ & beyond, middle, high)

    return lax.fori_loop(0, len(prefix).bit_length(), halve, (first, end))[0]


def distinct(
    key: Key[Array, ""], drawn: Draw, needed: Int[Array, "draft"], references: int
) -> Int[Array, "draft reference"]:
    """The first different papers of a sequence of draws; -1 where fewer are needed."""
    drafts = needed.shape[0]

    def lacking(found: tuple[Array, Array, Array]) -> Bool[Array, ""]:
        return (found[1] < needed).any()

    def more(found: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        kept, count, number = found
        papers = drawn(jax.random.fold_in(key, number))
        slot = jnp.arange(references)

        def add(so_far: tuple[Array, Array], paper: Array) -> tuple[tuple[Array, Array], None]:
            kept, count = so_far
            new = (kept != paper[:, None]).all(1) & (count < needed)
            kept = jnp.where(new[:, None] & (slot == count[:, None]), paper[:, None], kept)
            return (kept, count + new), None

        (kept, count), _ = lax.scan(add, (kept, count), papers.T)
        return kept, count, number + 1

    nothing = jnp.full((drafts, references), -1)
    start = nothing, jnp.zeros(drafts, jnp.int32), jnp.int32(0)
    return lax.while_loop(lacking, more, start)[0]
