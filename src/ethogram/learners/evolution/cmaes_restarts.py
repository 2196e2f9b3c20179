"""When a run of CMA-ES has converged or got stuck: Hansen's tutorial, section B.3, in 32 bits.

Any of these ends a run:

- the best fitness since the last restart has not risen for 100 + 30 n / lambda generations (for
  EqualFunValues and Stagnation, which need a history of fitness);
- a fifth of a standard deviation, added to the mean, no longer changes one of its genes
  (NoEffectCoord, which in 32 bits comes before TolX);
- the longest axis is as long as it may become (TolXUp);
- the condition of C is as high as it may become (ConditionCov: 1e7 in place of 1e14).
"""

import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int

from ethogram.core.settings import Number
from ethogram.learners.evolution.cmaes_covariance import LEAST_EIGENVALUE, Covariance

_NEARLY = 1.01  # as much as a limit, but for rounding


def patience(genes: int, population_size: int) -> int:
    """Generations without a better one that end a run."""
    return 100 + 30 * genes // population_size


def is_over(
    unimproved: Int[Array, ""],
    patience: int,
    mean: Float[Array, "gene"],
    sigma: Float[Array, ""],
    longest: Number,
    covariance: Covariance,
) -> Bool[Array, ""]:
    """Whether a run has come to its end.

    Args:
        unimproved: generations since the best fitness last rose.
        patience: how many of them there may be.
        mean: m.
        sigma: the step size.
        longest: axis there may be, sigma max(D).
        covariance: C.

    """
    values = covariance.eigenvalues()
    moved = mean + 0.2 * sigma * jnp.sqrt(covariance.variances())
    return (
        (unimproved >= patience)
        | (moved == mean).any()
        | (sigma * jnp.sqrt(values.max()) * _NEARLY >= longest)
        | (values.min() <= LEAST_EIGENVALUE * values.max() * _NEARLY)
    )
