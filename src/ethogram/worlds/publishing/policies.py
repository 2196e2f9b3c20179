"""The thesis' static policies (section 7.3.4), each of one role: `(key, observation) -> action`.

Authors: `random_author` submits anywhere, and writes anew after too many rejections; `Minded`
submits to journals whose rank by impact factor fits the draft's quality, one bin lower for every
rejection.  Editors: `editor(share)` turns away what is below a quantile of what the journal has
published.
"""

from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Int, Key, UInt32

from ethogram.core.batching import put, take
from ethogram.core.errors import InvalidSettings
from ethogram.core.keys import random_words, scaled
from ethogram.core.module import Module
from ethogram.core.rollout import Policy
from ethogram.core.settings import Number
from ethogram.core.wrappers import RolePolicies, RolePolicy
from ethogram.worlds.publishing.world import ACCEPT_ALL, Publishing

SHARES = {"accept_everything": ACCEPT_ALL, "mild_scrutiny": 0.25, "improve_only": 0.5}
MAX_REJECTIONS = 10
BINS = 10
COUNTED = 64  # journals, up to which it is faster to count those before each than to sort

BinRule = Literal["ranked", "literal_clamped"]
Remainder = Literal["spread", "drop"]


class Random(Module):
    """Any journal, with equal chance; a new draft after more than so many rejections."""

    max_rejections: int = MAX_REJECTIONS

    def __call__(
        self, key: Key[Array, ""], seen: Float[Array, "author feature"]
    ) -> Int[Array, "author"]:
        """0 or a journal from 1, for each author."""
        journals = seen.shape[1] - 2
        chosen = 1 + scaled(random_words(key, len(seen)), journals)
        return jnp.where(seen[:, 1] > self.max_rejections, 0, chosen)


class Minded(Module):
    """A journal of the bin k = floor(bins q / q_max) - rejections, within 1 to `bins`.

    `rule="literal_clamped"` is equation 7.4 as printed, min(1, ...), kept at 1, with the highest
    impact factors in bin 1: every draft goes to one of the best journals.  Bins are those of
    `Ranking`.
    """

    quality_max: Number
    ranking: "Ranking" = eqx.field(default_factory=lambda: Ranking())
    rule: BinRule = eqx.field(static=True, default="ranked")
    max_rejections: int | None = eqx.field(static=True, default=None)

    def __call__(
        self, key: Key[Array, ""], seen: Float[Array, "author feature"]
    ) -> Int[Array, "author"]:
        """0 or a journal from 1, for each author."""
        quality, rejections = seen[:, 0], seen[:, 1]
        bins = self.ranking.bins
        wanted = jnp.floor(bins * quality / self.quality_max) - rejections
        if self.rule == "literal_clamped":
            wanted = jnp.full_like(quality, bins)
        bin_ = jnp.clip(jnp.where(jnp.isnan(wanted), 1, wanted), 1, bins).astype(jnp.int32) - 1
        chosen = self.ranking.choose(key, bin_, seen[0, 2:])
        if self.max_rejections is None:
            return chosen
        return jnp.where(rejections > self.max_rejections, 0, chosen)


class Ranking(Module):
    """Journals by impact factor, those that have none last and ties at random, in equal bins.

    The last bin has the highest.  What cannot be divided is spread over the bins, which are as
    equal as possible, or dropped: then journals of the lowest ranks are in no bin.
    """

    bins: int = eqx.field(static=True, default=BINS)
    remainder: Remainder = eqx.field(static=True, default="spread")

    def choose(
        self, key: Key[Array, ""], bin_: Int[Array, "author"], impact: Float[Array, "journal"]
    ) -> Int[Array, "author"]:
        """A journal of each one's bin, from 1, with equal chance.

        Args:
            key: consumed.
            bin_: from 0.
            impact: negative where undefined.

        Raises:
            InvalidSettings: there are more bins than journals.

        """
        journals = len(impact)
        if self.bins > journals:
            raise InvalidSettings(
                f"bins = {self.bins}; allowed: at most as many as there are journals, {journals}."
            )
        chance = random_words(key, journals + len(bin_))
        ranked = ranking_of(impact, chance[:journals])
        if self.remainder == "drop":
            size = jnp.full_like(bin_, journals // self.bins)
            first = journals - size * (self.bins - bin_)
        else:
            first = bin_ * journals // self.bins
            size = (bin_ + 1) * journals // self.bins - first
        return 1 + take(ranked, first + scaled(chance[journals:], size))


def ranking_of(
    impact: Float[Array, "journal"], tie: UInt32[Array, "journal"]
) -> Int[Array, "journal"]:
    """The journals in the order of their impact factors, and of `tie` where these are equal.

    An impact factor that is no number counts as the lowest.
    """
    impact = jnp.where(jnp.isnan(impact), -jnp.inf, impact)
    number = jnp.arange(len(impact))
    if len(impact) > COUNTED:
        return jnp.lexsort((tie, impact))
    before = number < number[:, None]
    for key in (tie, impact):  # the last one counts first, as for lexsort
        before = (key < key[:, None]) | ((key == key[:, None]) & before)
    return put(number, before.sum(1), number)


class Scrutiny(Module):
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
    return RolePolicies({"author": authors[author], "editor": Scrutiny(SHARES[editor])})
