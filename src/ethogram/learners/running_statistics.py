"""The mean and the variance of all that was ever seen, from what is seen batch by batch."""

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float

SMALLEST_VARIANCE = 1e-8


class RunningStatistics(eqx.Module):
    """Mean and variance, of each of some numbers."""

    count: Float[Array, "*of"]
    mean: Float[Array, "*of"]
    squares: Float[Array, "*of"]  # the sum of squared distances from the mean

    @classmethod
    def of_nothing(cls, *shape: int) -> "RunningStatistics":
        """Statistics of numbers of which none was seen."""
        return cls(jnp.zeros(shape), jnp.zeros(shape), jnp.zeros(shape))

    @property
    def deviation(self) -> Float[Array, "*of"]:
        """The standard deviation, above 0; 1 if nothing was seen."""
        variance = self.squares / jnp.maximum(self.count, 1)
        return jnp.sqrt(jnp.where(self.count > 0, variance, 1.0) + SMALLEST_VARIANCE)

    def normalized(self, values: Float[Array, "..."], largest: float) -> Float[Array, "..."]:
        """Values with mean 0 and deviation 1, clipped to a largest size."""
        return jnp.clip((values - self.mean) / self.deviation, -largest, largest)

    def after(
        self, values: Float[Array, "batch *of"], counted: Bool[Array, "batch *of"]
    ) -> "RunningStatistics":
        """Statistics that have seen a batch, too (Chan, Golub & LeVeque, 1979).

        Args:
            values: of which there may be many for each number.
            counted: which of them count.

        """
        count = counted.sum(0)
        mean = jnp.where(counted, values, 0.0).sum(0) / jnp.maximum(count, 1)
        squares = jnp.where(counted, jnp.square(values - mean), 0.0).sum(0)
        shift, total = mean - self.mean, self.count + count
        share = count / jnp.maximum(total, 1)
        return RunningStatistics(
            count=total,
            mean=self.mean + shift * share,  # eq. 2.1
            squares=self.squares + squares + jnp.square(shift) * self.count * share,
        )
