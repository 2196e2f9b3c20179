"""Qualities: of authors and initial papers by a power law, of drafts about their author's.

Thesis, section 7.3.5.  Where a researcher may want another law, a function of one's own takes the
place of those named here.
"""

from collections.abc import Callable
from typing import TypeAlias

import jax
import jax.numpy as jnp
from jax import Array
from jax.scipy.special import ndtr, ndtri
from jaxtyping import Float, Key, UInt32

from ethogram.core.keys import gaussian, unit
from ethogram.core.settings import Number

# (x in [1, largest], largest, quality_max) -> quality in [0, quality_max]
QualityScale: TypeAlias = Callable[[Array, Number, Number], Array]
# (random words UInt32[author], authors' qualities, sigma, quality_max) -> drafts' qualities
DraftQuality: TypeAlias = Callable[[Array, Array, Number, Number], Array]


def linear(x: Float[Array, "..."], largest: Number, quality_max: Number) -> Float[Array, "..."]:
    """From [1, largest], stretched to [0, quality_max]."""
    return (x - 1) / (largest - 1) * quality_max


def unscaled(x: Float[Array, "..."], largest: Number, quality_max: Number) -> Float[Array, "..."]:
    """As drawn, cut off at quality_max."""
    del largest
    return jnp.minimum(x, quality_max)


QUALITY_SCALES: dict[str, QualityScale] = {"linear": linear, "none": unscaled}


def power_law(
    key: Key[Array, ""],
    shape: tuple[int, ...],
    *,
    exponent: Number,
    largest: Number,
) -> Float[Array, "..."]:
    """Numbers with a density of x^-exponent on [1, largest]."""
    chance = jax.random.uniform(key, shape)
    power = 1 - exponent
    log = jnp.log(largest)
    return jnp.where(
        jnp.abs(power) < 1e-6,
        jnp.exp(chance * log),
        (1 + chance * (largest**power - 1)) ** (1 / jnp.where(power == 0, 1.0, power)),
    )


def clipped(
    chance: UInt32[Array, "author"],
    quality: Float[Array, "author"],
    sigma: Number,
    quality_max: Number,
) -> Float[Array, "author"]:
    """Normal about each author's quality; what lies out of bounds is cut off afterwards."""
    del quality_max
    return quality + sigma * gaussian(chance)


def truncated(
    chance: UInt32[Array, "author"],
    quality: Float[Array, "author"],
    sigma: Number,
    quality_max: Number,
) -> Float[Array, "author"]:
    """Normal about each author's quality, of which what lies out of bounds is not drawn."""
    sigma = jnp.maximum(sigma, 1e-6)
    low, high = (ndtr((bound - quality) / sigma) for bound in (0.0, quality_max))
    return quality + sigma * ndtri(low + unit(chance) * (high - low))


DRAFT_QUALITIES: dict[str, DraftQuality] = {"clipped": clipped, "truncated": truncated}
