"""Fitness functions with known tops, and search spaces, for the tests of evolution."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ethogram.core.search_space import SearchSpace
from ethogram.learners.evolution import Evaluation


class Of(eqx.Module):
    """The fitness that a function gives, of which nobody diverges."""

    function: Callable[..., jax.Array] = eqx.field(static=True)
    deterministic: bool = eqx.field(static=True, default=True)

    def __call__(self, key, genomes):
        del key
        return Evaluation(self.function(genomes), jnp.zeros(len(genomes), bool))


class Noisy(eqx.Module):
    """The first gene, and a draw for all alike: the old cannot live on a lucky one."""

    deterministic: bool = eqx.field(static=True, default=False)

    def __call__(self, key, genomes):
        fitness = genomes[:, 0] + jax.random.normal(key)
        return Evaluation(fitness, jnp.zeros(len(genomes), bool))


class Diverging(eqx.Module):
    """Fitness of which the first three candidates have none."""

    deterministic: bool = eqx.field(static=True, default=True)

    def __call__(self, key, genomes):
        del key
        fitness = genomes[:, 0].at[0].set(jnp.nan).at[1].set(jnp.inf)
        return Evaluation(fitness, jnp.zeros(fitness.shape, bool).at[2].set(True))


def space(genes, low=0.0, high=1.0, lower=-np.inf, upper=np.inf):
    """The same range and limits for all genes."""
    return SearchSpace(*(np.full(genes, bound) for bound in (low, high, lower, upper)))


def sphere(genome):
    return -(genome**2).sum(-1)


def flat(genome):
    return 0 * genome.sum(-1)


def ellipsoid(genome):
    """Axes whose curvatures differ up to a million times."""
    genes = genome.shape[-1]
    return -(10.0 ** (6 * np.arange(genes) / (genes - 1)) * genome**2).sum(-1)


def rotated_ellipsoid(genome):
    genes = genome.shape[-1]
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(genes, genes)))[0]
    return ellipsoid(genome @ turn.astype(np.float32))


def rosenbrock(genome):
    """A bent valley; the top is at 1 everywhere."""
    here, after = genome[..., :-1], genome[..., 1:]
    return -(100 * (after - here**2) ** 2 + (1 - here) ** 2).sum(-1)
