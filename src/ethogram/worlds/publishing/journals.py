"""What journals are judged by: impact factors, and the qualities that they have published.

The qualities of a journal's papers are kept as counts, of coarse bins and of levels: the paper of
any rank is found by two short sums, however many papers there are.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int

from ethogram.core.settings import Number
from ethogram.worlds.publishing.literature import LEVELS

COARSE = 128
FINE = LEVELS // COARSE


class Qualities(eqx.Module):
    """How many papers of each quality every journal has published."""

    coarse: Int[Array, "journal bin"]
    fine: Int[Array, "journal level"]

    @property
    def papers(self) -> Int[Array, "journal"]:
        """How many papers each journal has published."""
        return self.coarse.sum(1)

    def add(
        self, journal: Int[Array, "paper"], level: Int[Array, "paper"], there: Bool[Array, "paper"]
    ) -> "Qualities":
        """Count more papers, those that are there."""
        one = there.astype(jnp.int32)
        return Qualities(
            self.coarse.at[journal, level // FINE].add(one, mode="drop"),
            self.fine.at[journal, level].add(one, mode="drop"),
        )

    def quantile(self, share: Float[Array, "journal"]) -> Float[Array, "journal"]:
        """The level below which a share of a journal's papers lies, by linear interpolation.

        As NumPy's default: between the papers of rank share x (n - 1) rounded down and up.  For an
        empty journal it is 0.
        """
        position = share * jnp.maximum(self.papers - 1, 0)
        low = jnp.floor(position).astype(jnp.int32)
        high = jnp.minimum(low + 1, jnp.maximum(self.papers - 1, 0))
        below, above = self._of_rank(low), self._of_rank(high)
        return below + (position - low) * (above - below)

    def _of_rank(self, rank: Int[Array, "journal"]) -> Float[Array, "journal"]:
        """The level of each journal's paper of that rank, from 0, by rising level."""

        def find(coarse: Array, fine: Array, rank: Array) -> Array:
            reach = jnp.cumsum(coarse)
            bin_ = jnp.minimum(jnp.searchsorted(reach, rank, side="right"), COARSE - 1)
            left = rank - jnp.where(bin_ > 0, reach[bin_ - 1], 0)
            inside = jnp.cumsum(jax.lax.dynamic_slice(fine, (bin_ * FINE,), (FINE,)))
            return bin_ * FINE + jnp.minimum(jnp.searchsorted(inside, left, side="right"), FINE - 1)

        empty = self.papers == 0
        found = jax.vmap(find)(self.coarse, self.fine, rank)
        return jnp.where(empty, 0, found).astype(float)


def empty(journals: int) -> Qualities:
    """Nothing published."""
    return Qualities(
        jnp.zeros((journals, COARSE), jnp.int32), jnp.zeros((journals, LEVELS), jnp.int32)
    )


def impact_factor(
    received: Int[Array, "journal"], papers: Int[Array, "journal"], undefined: Number
) -> Float[Array, "journal"]:
    """Citations that a year's papers give those of the two years before, per such paper (eq. 7.3).

    Args:
        received: such citations.
        papers: published in the two years before.
        undefined: the value where there are none.

    """
    return jnp.where(papers > 0, received / jnp.maximum(papers, 1), undefined)
