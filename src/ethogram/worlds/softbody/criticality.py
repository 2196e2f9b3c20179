"""Criticality of bodies: how near the sizes of their avalanches are to a power law.

A body that is neither rigid nor loose passes a pulse on to few voxels often and to many seldom: its
avalanches have no size of their own.  The score of a body (thesis, section 6.4.1) compares how
often each size occurs with a straight line in logarithms.  Avalanches are those of
`ethogram.physics.lattice2d.avalanches`.

Beside it stands what Clauset, Shalizi and Newman ("Power-law distributions in empirical data",
2009) ask of such a claim: the most likely exponent, and the p-value of the fit.
"""

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Int
from scipy.optimize import minimize_scalar

from ethogram.core.errors import InvalidSettings
from ethogram.physics.lattice2d import Lattice, Material, avalanches, lattices

THRESHOLD = (6.092750496194226e-3, -1.4273597198968677e-4, 9.238294116972325e-7)
LARGEST = 77  # voxels, up to which the threshold falls
EXPONENTS = (0.0, 20.0)  # of a power law, searched
RESAMPLED = 400  # samples behind a p-value: it is known to 0.025


def threshold(voxels: int) -> float:
    """Change of the area ratio in a step of which an active voxel has more: tau (Table 6.1).

    A parabola in the number of voxels, as the thesis' authors fitted it; beyond 77 voxels, where it
    would rise again, its least value.

    Args:
        voxels: of the body.

    """
    n = min(voxels, LARGEST)
    return THRESHOLD[0] + THRESHOLD[1] * n + THRESHOLD[2] * n**2


class Criticality(NamedTuple):
    """Score of a body and what it is made of."""

    score: float  # f = R^2 + exp(-2 D), from 0 to 2
    r_squared: float  # of the straight line through the logarithms of sizes and counts
    distance: float  # D, the largest between running sums of line and logarithms of counts
    slope: float  # of the line


def criticality(sizes: Int[np.ndarray, "avalanche"], voxels: int) -> Criticality:
    """The score of the avalanches of a body (thesis, section 6.4.1).

    A size that does not occur counts as 0, as if it had occurred once.  Bodies all of whose
    avalanches have one size score 0.

    Args:
        sizes: of the avalanches.
        voxels: of the body: the largest size that there could be.

    """
    counts = np.bincount(np.asarray(sizes), minlength=voxels + 1)[1:]
    if (counts > 0).sum() < 2:
        return Criticality(0.0, 0.0, 0.0, 0.0)
    x, y = np.log10(np.arange(1, len(counts) + 1)), np.log10(np.maximum(counts, 1))
    slope, intercept = np.polyfit(x, y, 1)
    line = intercept + slope * x
    spread = ((y - y.mean()) ** 2).sum()
    r_squared = 1 - ((y - line) ** 2).sum() / spread if spread > 0 else 0.0
    distance = np.abs(np.cumsum(line) - np.cumsum(y)).max()
    score = r_squared + np.exp(-2 * distance)
    return Criticality(float(score), float(r_squared), float(distance), float(slope))


class PowerLaw(NamedTuple):
    """The most likely power law of sizes from 1 to a largest one, and how well it fits."""

    exponent: float  # alpha: sizes s occur as s^-alpha
    distance: float  # Kolmogorov and Smirnov's, between the two distributions
    p_value: float  # share of samples of that law that fit worse; below 0.1 it is ruled out


def power_law(
    sizes: Int[np.ndarray, "avalanche"], voxels: int, *, seed: int = 0, samples: int = RESAMPLED
) -> PowerLaw:
    """The most likely power law, with the p-value of its fit (Clauset, Shalizi and Newman, 2009).

    Sizes are from 1 to the number of voxels, so the law is cut off there; all sizes count.

    Args:
        sizes: of the avalanches.
        voxels: of the body.
        seed: of the samples behind the p-value.
        samples: how many.

    """
    support = np.arange(1, voxels + 1)

    def law(exponent: float) -> np.ndarray:
        weight = support ** -float(exponent)
        return np.asarray(weight / weight.sum())

    def fitted(counts: np.ndarray) -> tuple[float, float]:
        total, logs = counts.sum(), (counts * np.log(support)).sum()

        def unlikeliness(exponent: float) -> float:
            return float(exponent * logs + total * np.log((support**-exponent).sum()))

        exponent = minimize_scalar(unlikeliness, bounds=EXPONENTS, method="bounded").x
        gap = np.abs(np.cumsum(law(exponent)) - np.cumsum(counts) / total).max()
        return float(exponent), float(gap)

    counts = np.bincount(np.asarray(sizes), minlength=voxels + 1)[1:]
    exponent, distance = fitted(counts)
    drawn = np.random.default_rng(seed).multinomial(counts.sum(), law(exponent), samples)
    further = np.mean([fitted(each)[1] >= distance for each in drawn])
    return PowerLaw(exponent, distance, float(further))


BLOCKS = (64, 8, 1)  # bodies of a call: few sizes, so that little is compiled


def avalanches_of(
    bodies: Sequence[Int[np.ndarray, "_ 2"]],
    thresholds: Sequence[float] | None = None,
    *,
    kernel: str = "auto",
) -> list[tuple[Int[np.ndarray, "_"], Int[np.ndarray, "_"]]]:
    """Sizes and durations of the avalanches of many bodies, one for each voxel that is driven.

    Bodies of one number of voxels are simulated together.

    Args:
        bodies: cells of each.
        thresholds: tau of each; None is that of its number of voxels.
        kernel: what does it on a CPU (see `ethogram.physics.lattice2d.simulate`).

    Raises:
        InvalidSettings: there is not one threshold for each body.

    """
    taus = [threshold(len(body)) for body in bodies] if thresholds is None else thresholds
    if len(taus) != len(bodies):
        raise InvalidSettings(
            f"{len(taus)} thresholds for {len(bodies)} bodies; allowed: one each."
        )
    found: dict[int, Any] = {}
    for voxels in sorted({len(body) for body in bodies}):
        alike = [number for number, body in enumerate(bodies) if len(body) == voxels]
        while alike:
            size = next(size for size in BLOCKS if size <= len(alike))
            block, alike = alike[:size], alike[size:]
            lattice = lattices([bodies[number] for number in block], voxels)
            tau = jnp.asarray([taus[number] for number in block])
            size_of, duration_of = map(np.asarray, _avalanches(kernel)(lattice, tau))
            found |= {
                number: (size_of[place], duration_of[place]) for place, number in enumerate(block)
            }
    return [found[number] for number in range(len(bodies))]


@cache
def _avalanches(kernel: str) -> Any:
    @eqx.filter_jit
    def many(lattice: Lattice, tau: Float[Array, "body"]) -> Any:
        def one(lattice: Lattice, tau: Array) -> Any:
            return avalanches(lattice, Material.soft(), tau, kernel=kernel)

        return jax.vmap(one)(lattice, tau)

    return many
