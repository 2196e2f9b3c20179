"""Where cars are at the start: anywhere on the sections, apart from each other (section 4.3.2)."""

import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int, UInt32

from ethogram.core.batching import take
from ethogram.core.keys import scaled
from ethogram.core.settings import Number

PARTS = 256  # of a metre, in which places are counted


def scattered(
    bits: UInt32[Array, "car"],
    present: Bool[Array, "car"],
    lengths: Float[Array, "section"],
    gap: Number,
) -> tuple[Int[Array, "car"], Float[Array, "car"]]:
    """Sections, and places on them, uniform on all of them as one line, with gaps between cars.

    Uniform places on a line shorter by a gap per car are moved on by a gap for each car before.
    Computed in whole parts of a metre, so that there is no rounding.

    Args:
        bits: a random word per car.
        present: whether it is there.
        lengths: of the sections, m.
        gap: that is left at least, m.

    """
    parts = jnp.floor(lengths * PARTS).astype(jnp.int32)
    gap_parts = jnp.ceil(jnp.asarray(gap) * PARTS).astype(jnp.int32)
    free = scaled(bits, parts.sum(dtype=jnp.int32) - present.sum(dtype=jnp.int32) * gap_parts)
    number = jnp.arange(len(bits))
    tied = (free[:, None] == free) & (number[:, None] < number)
    before = ((free[:, None] < free) | tied) & present[:, None]
    place = free + before.sum(0, dtype=jnp.int32) * gap_parts
    ends = jnp.cumsum(parts, dtype=jnp.int32)
    section = (place >= ends[:-1, None]).sum(0, dtype=jnp.int32)
    position = place - take(ends - parts, section)
    return section, position.astype(lengths.dtype) / PARTS
