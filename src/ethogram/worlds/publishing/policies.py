"""The thesis' static policies (section 7.3.4), each of one role: `(key, observation) -> action`.

Authors: `random_author` submits anywhere, and writes anew after too many rejections; `Minded`
submits to journals whose rank by impact factor fits the draft's quality, one bin lower for every
rejection.  Editors: `editor(share)` turns away what is below a quantile of what the journal has
published.
"""

from collections.abc import Callable
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Int, Key

from ethogram.core.errors import InvalidSettings
from ethogram.core.rollout import Policy
from ethogram.core.settings import Number
from ethogram.core.world import PerRole
from ethogram.worlds.publishing.world import ACCEPT_ALL, Publishing

RolePolicy = Callable[[Key[Array, ""], Array], Array]  # (key, observation) -> action

SHARES = {"accept_everything": ACCEPT_ALL, "mild_scrutiny": 0.25, "improve_only": 0.5}
MAX_REJECTIONS = 10
BINS = 10


class Random(eqx.Module):
    """Any journal, with equal chance; a new draft after more than so many rejections."""

    max_rejections: int = MAX_REJECTIONS

    def __call__(
        self, key: Key[Array, ""], seen: Float[Array, "author feature"]
    ) -> Int[Array, "author"]:
        """0 or a journal from 1, for each author."""
        journals = seen.shape[1] - 2
        chosen = jax.random.randint(key, seen.shape[:1], 1, journals + 1)
        return jnp.where(seen[:, 1] > self.max_rejections, 0, chosen)


class Minded(eqx.Module):
    """A journal of the bin k = floor(bins q / q_max) - rejections, within 1 to `bins`.

    Journals are ranked by impact factor, those that have none last and ties at random, and stand in
    bins that are as equal as possible; bin `bins` has the highest.  `rule="literal_clamped"` is
    equation 7.4 as printed, min(1, ...), kept at 1, with the highest impact factors in bin 1.
    """

    quality_max: Number
    bins: int = eqx.field(static=True, default=BINS)
    rule: Literal["ranked", "literal_clamped"] = eqx.field(static=True, default="ranked")
    remainder: Literal["spread", "drop"] = eqx.field(static=True, default="spread")
    max_rejections: int | None = eqx.field(static=True, default=None)

    def __call__(
        self, key: Key[Array, ""], seen: Float[Array, "author feature"]
    ) -> Int[Array, "author"]:
        """0 or a journal from 1, for each author."""
        for_ties, for_choice = jax.random.split(key)
        quality, rejections, impact = seen[:, 0], seen[:, 1], seen[0, 2:]
        journals = len(impact)
        if self.bins > journals:
            raise InvalidSettings(
                f"Minded: bins = {self.bins}; allowed: at most as many as there are journals, "
                f"{journals}."
            )
        if self.rule == "literal_clamped":
            impact, wanted = -jnp.where(impact < 0, -jnp.inf, impact), jnp.ones_like(quality)
        else:
            wanted = jnp.floor(self.bins * quality / self.quality_max) - rejections
        ranked = jnp.lexsort((jax.random.uniform(for_ties, (journals,)), impact))
        bin_ = jnp.clip(wanted, 1, self.bins).astype(jnp.int32) - 1
        first, size = self._bounds(bin_, journals)
        offset = jnp.floor(jax.random.uniform(for_choice, quality.shape) * size).astype(jnp.int32)
        chosen = 1 + ranked[first + jnp.minimum(offset, size - 1)]
        if self.max_rejections is None:
            return chosen
        return jnp.where(rejections > self.max_rejections, 0, chosen)

    def _bounds(
        self, bin_: Int[Array, "author"], journals: int
    ) -> tuple[Int[Array, "author"], Int[Array, "author"]]:
        """First rank and size of bins, counted from 0; dropped are journals of the lowest ranks."""
        if self.remainder == "drop":
            size = journals // self.bins
            return journals - size * (self.bins - bin_), jnp.full_like(bin_, size)
        first = bin_ * journals // self.bins
        return first, (bin_ + 1) * journals // self.bins - first


class Scrutiny(eqx.Module):
    """Editors that turn away what is below a share of what their journal has published."""

    share: float

    def __call__(
        self, key: Key[Array, ""], seen: Float[Array, "journal feature"]
    ) -> Float[Array, "journal"]:
        """The same for all."""
        del key
        return jnp.full(seen.shape[0], self.share)


def static(world: Publishing, author: str, editor: str) -> Policy:
    """Both roles' policies by name: "random" or "minded"; a name in `SHARES`."""
    authors: dict[str, RolePolicy] = {"random": Random(), "minded": Minded(world.quality_max)}
    for what, name, known in (("author", author, authors), ("editor", editor, SHARES)):
        if name not in known:
            raise InvalidSettings(f"{what} = {name!r}; allowed: {', '.join(known)}.")
    submit, judge = authors[author], Scrutiny(SHARES[editor])

    def act(key: Key[Array, ""], observation: PerRole) -> PerRole:
        first, second = jax.random.split(key)
        return {
            "author": submit(first, observation["author"]),
            "editor": judge(second, observation["editor"]),
        }

    return act
