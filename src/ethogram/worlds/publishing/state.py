"""What there is in the world of chapter 7 at one moment."""

import equinox as eqx
from jax import Array
from jaxtyping import Float, Int

from ethogram.worlds.publishing.citations import CitationStats
from ethogram.worlds.publishing.journals import Qualities
from ethogram.worlds.publishing.literature import Literature


class Drafts(eqx.Module):
    """What authors are working on."""

    level: Int[Array, "author"]  # of quality
    cited: Int[Array, "author reference"]  # papers; -1: none
    rejections: Int[Array, "author"]


class State(eqx.Module):
    """Authors, drafts, papers and journals."""

    quality: Float[Array, "author"]  # of authors, in [0, q_max]
    drafts: Drafts
    citation_stats: CitationStats
    literature: Literature
    qualities: Qualities
    window: Int[Array, "journal 2"]  # papers of the year before, and of the one before that
    this_year: Int[Array, "journal"]  # papers
    received: Int[Array, "journal"]  # citations this year of papers in the window
    impact: Float[Array, "journal"]  # of the last complete year
    rejected: Int[Array, "journal"]
    time: Int[Array, ""]  # steps
