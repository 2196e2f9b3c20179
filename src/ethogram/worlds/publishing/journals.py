"""What journals are judged by: impact factors, and the qualities that they have published.

The qualities of a journal's papers are kept in a tree of counts, after Fenwick (1994): each node
halves a range of levels and counts the papers in its lower half.  A paper is counted in one node
per halving at most, and the paper of any rank is found by as many looks, however many there are.
"""

from collections.abc import Callable
from typing import TypeAlias

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int

from ethogram.core.batching import add, take
from ethogram.core.settings import Number
from ethogram.worlds.publishing.literature import LEVELS

# (citations received Int[journal], papers of two years Int[journal], undefined) -> Float[journal]
ImpactFactor: TypeAlias = Callable[[Array, Array, Number], Array]
HALVES = [LEVELS >> depth for depth in range(1, LEVELS.bit_length())]  # of ranges, to single levels


class Qualities(eqx.Module):
    """How many papers of each quality every journal has published."""

    papers: Int[Array, "journal"]
    # of each journal in turn, at first + half - 1: those of the levels from first to a half later
    lower: Int[Array, "journal_x_level"]

    def add(
        self, journal: Int[Array, "paper"], level: Int[Array, "paper"], there: Bool[Array, "paper"]
    ) -> "Qualities":
        """Count more papers, those that are there."""
        half = jnp.array(HALVES)[:, None]
        first = level & ~(2 * half - 1)
        counts = there & (level & half == 0)
        node = journal * LEVELS + first + (half - 1)
        return Qualities(
            add(self.papers, journal, there.astype(jnp.int32)),
            add(self.lower, node, counts.astype(jnp.int32)),
        )

    def quantile(self, share: Float[Array, "journal"]) -> Float[Array, "journal"]:
        """The level below which a share of a journal's papers lies, by linear interpolation.

        As NumPy's default: between the papers of rank share x (n - 1) rounded down and up.  For an
        empty journal it is 0.
        """
        last = jnp.maximum(self.papers - 1, 0)
        position = share * last
        low = jnp.floor(position).astype(jnp.int32)
        below, above = self._of_rank(low), self._of_rank(jnp.minimum(low + 1, last))
        between = below + (position - low) * (above - below)
        return jnp.where(self.papers > 0, between, 0.0)

    def _of_rank(self, rank: Int[Array, "journal"]) -> Float[Array, "journal"]:
        """The level of each journal's paper of that rank, from 0, by rising level."""
        journal, first = jnp.arange(len(rank)) * LEVELS, jnp.zeros_like(rank)
        for half in HALVES:
            lower = take(self.lower, journal + first + (half - 1))
            above = rank >= lower
            first, rank = first + half * above, rank - lower * above
        return first.astype(float)


def empty(journals: int) -> Qualities:
    """Nothing published."""
    return Qualities(jnp.zeros(journals, jnp.int32), jnp.zeros(journals * LEVELS, jnp.int32))


def union(
    received: Int[Array, "journal"], papers: Int[Array, "journal"], undefined: Number
) -> Float[Array, "journal"]:
    """Citations that a year's papers give those of the two years before, per such paper (eq. 7.3).

    Args:
        received: such citations.
        papers: published in the two years before.
        undefined: the value where there are none.

    """
    return jnp.where(papers > 0, received / jnp.maximum(papers, 1), undefined)


def intersection(
    received: Int[Array, "journal"], papers: Int[Array, "journal"], undefined: Number
) -> Float[Array, "journal"]:
    """Eq. 7.3 as printed, of papers of both years: there are none."""
    return union(jnp.zeros_like(received), papers, undefined)


IMPACT_FACTORS: dict[str, ImpactFactor] = {"union": union, "intersection": intersection}
