"""What authors and journals are judged by, by name; other packages add theirs.

An indicator is a function of the world's state.  How well it tells the quality that nobody sees is
its correlation with that of the authors, or of what the journals have published.  An indicator of
another package is registered under the entry point `ethogram.indicators`, for example

    [project.entry-points."ethogram.indicators"]
    papers_per_author = "bibliometry:PAPERS"
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from ethogram.core.registry import Registry
from ethogram.worlds.publishing.state import State


@dataclass(frozen=True)
class Indicator:
    """A number for each author or each journal, not a number where it is not defined."""

    of: Literal["author", "journal"]
    measure: Callable[[State], Float[Array, "agent"]]


def acceptance_rate(state: State) -> Float[Array, "journal"]:
    """Papers published, the initial ones too, of those and all that were rejected (eq. 7.2)."""
    published = state.qualities.papers
    decided = published + state.rejected
    return jnp.where(decided > 0, published / jnp.maximum(decided, 1), jnp.nan)


H_INDEX = Indicator("author", lambda state: state.citation_stats.h_index.astype(float))  # eq. 7.1
IMPACT_FACTOR = Indicator("journal", lambda state: state.impact)  # eq. 7.3, last complete year
ACCEPTANCE_RATE = Indicator("journal", acceptance_rate)
PAPERS = Indicator("journal", lambda state: state.qualities.papers.astype(float))

_HERE = "ethogram.worlds.publishing.indicators"
INDICATORS: Registry[Indicator] = Registry(
    "indicator",
    "ethogram.indicators",
    {
        "h_index": f"{_HERE}:H_INDEX",
        "impact_factor": f"{_HERE}:IMPACT_FACTOR",
        "acceptance_rate": f"{_HERE}:ACCEPTANCE_RATE",
        "papers": f"{_HERE}:PAPERS",
    },
)
