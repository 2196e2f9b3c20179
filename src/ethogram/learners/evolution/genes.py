"""What a genome is made of: where genes are drawn, and within what they stay."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float, Key

from ethogram.core.errors import InvalidSettings


class Genes(eqx.Module):
    """Ranges of each gene, as arrays over genes.

    Raises:
        InvalidSettings: arrays differ in length or are empty, a range to draw from is not finite,
            is upside down, or leaves the limits.

    """

    low: Float[Array, "gene"] = eqx.field(converter=jnp.asarray)  # random ones: uniform from here
    high: Float[Array, "gene"] = eqx.field(converter=jnp.asarray)  # to here
    lowest: Float[Array, "gene"] = eqx.field(converter=jnp.asarray)  # mutated ones: never below
    highest: Float[Array, "gene"] = eqx.field(converter=jnp.asarray)  # never above

    def __check_init__(self) -> None:
        """Refuse ranges that no gene fits."""
        arrays = {name: getattr(self, name) for name in ("low", "high", "lowest", "highest")}
        if any(isinstance(array, jax.core.Tracer) for array in arrays.values()):
            return
        shapes = {name: array.shape for name, array in arrays.items()}
        if len(set(shapes.values())) > 1 or len(self.low.shape) != 1 or not self.low.size:
            raise InvalidSettings(
                f"Genes: one range for each gene, and at least one; not {shapes}."
            )
        low, high, lowest, highest = (np.asarray(array) for array in arrays.values())
        wrong = ~(np.isfinite(low) & np.isfinite(high) & (low <= high))
        wrong |= ~((lowest <= low) & (high <= highest))
        for gene in np.flatnonzero(wrong)[:1]:
            raise InvalidSettings(
                f"Genes: gene {gene} is drawn from {low[gene]} to {high[gene]} and limited to "
                f"{lowest[gene]} to {highest[gene]}; allowed: lowest <= low <= high <= highest, "
                "with low and high finite."
            )

    def __len__(self) -> int:
        """How many genes a genome has."""
        return self.low.shape[-1]

    def random(self, key: Key[Array, ""], individuals: int) -> Float[Array, "individual gene"]:
        """New genomes, every gene uniform over its range."""
        shape = (individuals, len(self))
        return jax.random.uniform(key, shape, minval=self.low, maxval=self.high)

    def mutate(
        self,
        genome: Float[Array, "individual gene"],
        chosen: Bool[Array, "individual gene"],
        change: Float[Array, "individual gene"],
    ) -> Float[Array, "individual gene"]:
        """Add changes to the chosen genes, and keep them within their limits."""
        return jnp.clip(genome + jnp.where(chosen, change, 0.0), self.lowest, self.highest)
