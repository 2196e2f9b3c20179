"""The parameters of CMA-ES, which follow from numbers of genes and candidates.

Equations are numbered as in Hansen, "The CMA Evolution Strategy: A Tutorial" (2016,
arXiv:1604.00772), Table 1.  In a separable covariance the rates c_1 and c_mu are (n + 2) / 3 times
as high (Ros and Hansen, "A simple modification in CMA-ES achieving linear time and space
complexity", 2008); in an isotropic one they are 0.
"""

from math import ceil, exp, floor, log, sqrt
from typing import NamedTuple

import numpy as np

FULL_GENES = 200  # up to so many genes the covariance is full, unless another is asked for


class Parameters(NamedTuple):
    """Numbers that stay as they are, in 64 bits."""

    weights: np.ndarray  # w_i of the candidates, the fittest first; beyond mu negative, or 0
    parents: int  # mu
    effective_parents: float  # mu_eff
    c_sigma: float  # rate of the path of sigma,
    d_sigma: float  # and damping
    c_c: float  # rate of the path of the covariance
    c_1: float  # rate of the rank-one update
    c_mu: float  # rate of the rank-mu update
    expected_norm: float  # E||N(0, I)||
    flat_factor: float  # of sigma where fitness is flat
    gap: int  # generations from one eigendecomposition to the next


def default_population_size(genes: int) -> int:
    """Lambda, 4 + floor(3 ln n)."""
    return 4 + floor(3 * log(genes))  # eq. 48


def parameters(genes: int, population_size: int, covariance: str, *, active: bool) -> Parameters:
    """All parameters.

    Args:
        genes: n.
        population_size: lambda, 2 or more.
        covariance: `full`, `separable` or `isotropic`.
        active: whether candidates worse than the mu best have negative weights.

    """
    n, parents = genes, population_size // 2
    ranks = np.arange(1, population_size + 1)
    raw = log((population_size + 1) / 2) - np.log(ranks)  # eq. 49
    mu_eff = effective_number(raw[:parents])
    speed = {"full": 1.0, "separable": (n + 2) / 3, "isotropic": 0.0}[covariance]
    c_1 = speed * 2 / ((n + 1.3) ** 2 + mu_eff)  # eq. 57
    c_mu = speed * 2 * (mu_eff - 2 + 1 / mu_eff) / ((n + 2) ** 2 + mu_eff)  # eq. 58
    c_1 = min(1.0, c_1)
    c_mu = min(1 - c_1, c_mu)
    weights = np.where(ranks <= parents, raw, 0.0) / raw[:parents].sum()  # eq. 53
    if active and c_mu > 0:
        mu_eff_minus = effective_number(raw[parents:])
        alpha = min(
            1 + c_1 / c_mu,  # eq. 50
            1 + 2 * mu_eff_minus / (mu_eff + 2),  # eq. 51
            (1 - c_1 - c_mu) / (n * c_mu),  # eq. 52
        )
        negative = np.minimum(raw, 0.0)
        weights = weights + alpha * negative / -negative.sum()  # eq. 53
    c_sigma = (mu_eff + 2) / (n + mu_eff + 5)  # eq. 55
    d_sigma = 1 + 2 * max(0.0, sqrt((mu_eff - 1) / (n + 1)) - 1) + c_sigma  # eq. 55
    return Parameters(
        weights=weights,
        parents=parents,
        effective_parents=mu_eff,
        c_sigma=c_sigma,
        d_sigma=d_sigma,
        c_c=(4 + mu_eff / n) / (n + 4 + 2 * mu_eff / n),  # eq. 56
        c_1=c_1,
        c_mu=c_mu,
        expected_norm=sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2)),
        flat_factor=exp(0.2 + c_sigma / d_sigma),  # appendix C.1, "escape flat fitness"
        gap=max(1, floor(1 / (10 * n * (c_1 + c_mu)))) if c_1 + c_mu > 0 else 1,
    )


def effective_number(weights: np.ndarray) -> float:
    """How many equal weights would select as much: (sum w)^2 / sum w^2."""
    return float(weights.sum() ** 2 / (weights**2).sum())


def smallest_count(share: float, number: int) -> int:
    """How many of a number are at least a share of it: 7 of 10 are 0.7 of them."""
    return ceil(share * number - 1e-9)
