"""Search spaces: where the numbers that are searched for are drawn from, and their limits."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Key

from ethogram.core.errors import InvalidSettings


class SearchSpace(eqx.Module):
    """Ranges and limits of each gene (parameter), as arrays over genes.

    Raises:
        InvalidSettings: arrays differ in length or are empty, a range to draw from is not finite,
            is upside down, or leaves the limits.

    """

    low: Float[Array, "gene"] = eqx.field(converter=jnp.asarray)  # drawn uniformly from here
    high: Float[Array, "gene"] = eqx.field(converter=jnp.asarray)  # to here
    lower: Float[Array, "gene"] = eqx.field(converter=jnp.asarray)  # limits: never below
    upper: Float[Array, "gene"] = eqx.field(converter=jnp.asarray)  # never above

    def __check_init__(self) -> None:
        """Refuse ranges that no gene fits."""
        arrays = {name: getattr(self, name) for name in ("low", "high", "lower", "upper")}
        if any(isinstance(array, jax.core.Tracer) for array in arrays.values()):
            return
        shapes = {name: array.shape for name, array in arrays.items()}
        if len(set(shapes.values())) > 1 or len(self.low.shape) != 1 or not self.low.size:
            raise InvalidSettings(
                f"SearchSpace: one range for each gene, and at least one; not {shapes}."
            )
        low, high, lower, upper = (np.asarray(array) for array in arrays.values())
        wrong = ~(np.isfinite(low) & np.isfinite(high) & (low <= high))
        with np.errstate(over="ignore"):
            wrong |= ~np.isfinite(high - low)
        wrong |= ~((lower <= low) & (high <= upper))
        for gene in np.flatnonzero(wrong)[:1]:
            raise InvalidSettings(
                f"SearchSpace: gene {gene} is drawn from {low[gene]} to {high[gene]} and limited "
                f"to {lower[gene]} to {upper[gene]}; allowed: lower <= low <= high <= upper, with "
                "low and high finite."
            )

    @property
    def size(self) -> int:
        """How many genes there are."""
        return self.low.shape[-1]

    def sample(self, key: Key[Array, ""], individuals: int) -> Float[Array, "individual gene"]:
        """Genomes drawn at random, every gene uniform over its range."""
        shape = (individuals, self.size)
        return jax.random.uniform(key, shape, minval=self.low, maxval=self.high)

    def clip(self, genome: Float[Array, "*individual gene"]) -> Float[Array, "*individual gene"]:
        """Genomes with every gene within its limits."""
        return jnp.clip(genome, self.lower, self.upper)
