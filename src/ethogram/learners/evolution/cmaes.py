"""CMA-ES: evolution that learns the shape of its mutations (Hansen and Ostermeier, 2001).

Candidates are drawn from N(m, sigma^2 C).  The mean m moves to the weighted mean of the fittest, a
path of such moves tells whether sigma should grow or shrink, and C learns along which genes moves
succeed.  Equations are numbered as in Hansen, "The CMA Evolution Strategy: A Tutorial" (2016,
arXiv:1604.00772), which this follows line by line; its parameters are in `cmaes_parameters`.

C is full, separable (a diagonal; Ros and Hansen, 2008) or isotropic (the identity); unless one is
asked for, it is full up to 200 genes and separable beyond.  At 5000 genes and 10 000 candidates in
all a full one would not have moved by a thousandth.

Presets:

- `modern`, the default: the tutorial's, in which the worst candidates have negative weights.
- `thesis` (section 6.4.2, "a CMA-ES" with 10 000 births): no negative weights; sigma is 0.5 at
  first and grows where 70% of the candidates tie, and there are no restarts.  Its genomes start in
  [0, 1] and have no limits: so must the search space.

Deviations from the tutorial:

- The root of C is the symmetric one, not B D; steps have the same distribution.
- C is decomposed every max(1, floor(1 / (10 n (c_1 + c_mu)))) generations (its section B.2), in
  all runs that are side by side in the same ones.
- Ranks are strict: of candidates that tie, who comes first is drawn at random, and no two have the
  same weight.
- With `flat_share` sigma grows where so many candidates tie for the best (its appendix C.1), but
  not where all have diverged.  The longest axis is never longer than 10 000 times the first
  sigma, where the tutorial would stop (TolXUp, B.3).
- Candidates beyond the limits of a search space are put on them, and it is these that are evaluated
  and learned from: there is no penalty.
- With `restarts`, a run that has converged or got stuck (see `cmaes_restarts`) begins anew from a
  mean that is drawn anew, with as many candidates as before: IPOP (Auger and Hansen, 2005) would
  double them, but arrays keep their sizes.  The best ever is kept.
"""

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float, Int, Key
from pydantic import Field

from ethogram.core.batching import in_any_copy, take
from ethogram.core.memory import require_memory
from ethogram.core.settings import Number, Positive, setting
from ethogram.learners.base import Metrics
from ethogram.learners.evolution.base import (
    WORST_FITNESS,
    BestEver,
    Evaluation,
    EvolutionaryLearner,
    best_first,
    fitness_metrics,
    with_worst,
)
from ethogram.learners.evolution.cmaes_covariance import COVARIANCES, Change, Covariance
from ethogram.learners.evolution.cmaes_parameters import (
    FULL_GENES,
    Parameters,
    default_population_size,
    parameters,
    smallest_count,
)
from ethogram.learners.evolution.cmaes_restarts import is_over, patience

PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "modern": {},
        "thesis": {"active": False, "flat_share": 0.7, "sigma0": 0.5, "restarts": False},
    }
)

LARGEST_GROWTH = 1e4  # of the longest axis, sigma max(D), times the first sigma
LARGEST_EIGENVALUE = 1e8  # of C; beyond it, or below its inverse, sigma takes over the difference
LEAST_SIGMA = 1e-30  # that steps can be divided by

_RESTART = 1  # folded into the key of `tell`, for the mean of a new run


class CMAESState(eqx.Module):
    """The distribution that candidates are drawn from, and how it has moved."""

    mean: Float[Array, "gene"]  # m
    sigma: Float[Array, ""]
    sigma_path: Float[Array, "gene"]  # p_sigma
    path: Float[Array, "gene"]  # p_c
    covariance: Covariance  # C
    generation: Int[Array, ""]  # g, since the last restart
    generations: Int[Array, ""]  # in all
    fitness: Float[Array, "candidate"]  # of the candidates that were evaluated last
    best_ever: BestEver
    diverged: Int[Array, ""]  # of the candidates that were evaluated last
    restart_fitness: Float[Array, ""]  # the best since the last restart
    unimproved: Int[Array, ""]  # generations since it last rose
    restarts: Int[Array, ""]


class CMAES(EvolutionaryLearner):
    """CMA-ES for any fitness function.

    Candidates that diverge, or whose fitness is not finite, get the worst fitness, are counted, and
    stay out of means.

    Attributes:
        search_space: where the first mean is drawn, and within what candidates stay.
        fitness: of all candidates in one call (see `ethogram.learners.evolution.base.Fitness`).
        population_size: lambda, candidates of a generation, from 2 to 100 000; None is
            4 + floor(3 ln n).
        sigma0: the first sigma, in units of the genes; above 0.
        covariance: `full`, `separable` or `isotropic`; None is full up to 200 genes, else
            separable.
        active: whether the worst candidates have negative weights.
        flat_share: of the candidates, above 0 and up to 1: where at least as many tie for the best,
            sigma grows; None for never.
        restarts: whether a run that has converged or got stuck begins anew.

    """

    population_size: int | None = setting(
        None, Annotated[int, Field(ge=2, le=100_000)] | None, static=True
    )
    sigma0: Number = setting(0.5, Positive)
    covariance: str | None = setting(
        None, Literal["full", "separable", "isotropic"] | None, static=True
    )
    active: bool = setting(True, bool, static=True)
    flat_share: float | None = setting(
        None, Annotated[float, Field(gt=0, le=1)] | None, static=True
    )
    restarts: bool = setting(False, bool, static=True)

    @property
    def parameters(self) -> Parameters:
        """The numbers that follow from the settings."""
        return parameters(
            self.search_space.size, self._candidates, self._covariance, active=self.active
        )

    @property
    def _candidates(self) -> int:
        if self.population_size is None:
            return default_population_size(self.search_space.size)
        return self.population_size

    @property
    def _covariance(self) -> str:
        if self.covariance is None:
            return "full" if self.search_space.size <= FULL_GENES else "separable"
        return self.covariance

    def init(self, key: Key[Array, ""]) -> CMAESState:
        """A mean that is drawn from the search space; nothing is evaluated yet.

        Raises:
            TooLarge: a generation would not fit in memory; the message names the size.

        """
        size, genes, kind = self._candidates, self.search_space.size, self._covariance
        require_memory(
            f"CMA-ES of {size:,} candidates of {genes} genes with a {kind} covariance",
            generation_bytes(size, genes, kind),
        )
        return self._start(key)

    def metrics(self, state: CMAESState) -> Metrics:
        """The numbers of a generation.

        The `best` fitness ever, also as `episode_return`; the `mean` of the candidates that did not
        diverge (0 if all did); `sigma`; the `condition` of C, its largest eigenvalue over its
        least; how many candidates have `diverged`; how many `restarts` there were.
        """
        values = state.covariance.eigenvalues()
        return fitness_metrics(state.best_ever.fitness, state.fitness) | {
            "sigma": state.sigma,
            "condition": values.max() / values.min(),
            "diverged": state.diverged,
            "restarts": state.restarts,
        }

    def ask(self, key: Key[Array, ""], state: CMAESState) -> Float[Array, "candidate gene"]:
        """Candidates drawn around the mean, on the limits where they would be beyond."""
        z = jax.random.normal(key, (self._candidates, self.search_space.size))  # eq. 38
        y = state.covariance.scaled(z)  # eq. 39
        return self.search_space.clip(state.mean + state.sigma * y)  # eq. 40

    def tell(
        self,
        key: Key[Array, ""],
        state: CMAESState,
        candidates: Float[Array, "candidate gene"],
        evaluation: Evaluation,
    ) -> CMAESState:
        """The distribution after candidates were evaluated; the key decides ties."""
        evaluation = with_worst(evaluation)
        fitness, generation = evaluation.fitness, state.generation + 1
        rank = jnp.argsort(best_first(key, fitness))
        weights = take(jnp.asarray(self.parameters.weights, jnp.float32), rank)  # w_i, as i:lambda
        y = (candidates - state.mean) / state.sigma
        z = state.covariance.whitened(y)

        step = jnp.maximum(weights, 0.0) @ y  # eq. 41
        mean = state.mean + state.sigma * step  # eq. 42, c_m = 1 of eq. 54
        sigma_path = self._sigma_path(state, jnp.maximum(weights, 0.0) @ z)
        sigma = self._sigma(state.sigma, sigma_path, fitness)
        path, change = self._change(state, generation, sigma_path, step, weights, y, z)
        is_due = in_any_copy((state.generations + 1) % self.parameters.gap == 0)
        covariance, unit = lax.cond(
            is_due, renewed, lambda old: (old, jnp.float32(1)), state.covariance.changed(change)
        )
        sigma = self._within_limits(sigma * unit, covariance)
        best = jnp.maximum(fitness.max(), state.restart_fitness)
        after = CMAESState(
            mean=mean,
            sigma=sigma,
            sigma_path=sigma_path,
            path=path / unit,
            covariance=covariance,
            generation=generation,
            generations=state.generations + 1,
            fitness=fitness,
            best_ever=state.best_ever.after(candidates, fitness),
            diverged=evaluation.diverged.sum(),
            restart_fitness=best,
            unimproved=jnp.where(best > state.restart_fitness, 0, state.unimproved + 1),
            restarts=state.restarts,
        )
        return self._restarted(jax.random.fold_in(key, _RESTART), after) if self.restarts else after

    def _start(self, key: Key[Array, ""]) -> CMAESState:
        """A run that begins at a mean drawn from the search space."""
        size, genes = self._candidates, self.search_space.size
        mean = self.search_space.sample(key, 1)[0]
        none, worst = jnp.int32(0), jnp.float32(WORST_FITNESS)
        return CMAESState(
            mean=mean,
            sigma=jnp.asarray(self.sigma0, jnp.float32),
            sigma_path=jnp.zeros(genes),
            path=jnp.zeros(genes),
            covariance=COVARIANCES[self._covariance].identity(genes),
            generation=none,
            generations=none,
            fitness=jnp.full(size, worst),
            best_ever=BestEver(mean, worst),
            diverged=none,
            restart_fitness=worst,
            unimproved=none,
            restarts=none,
        )

    def _restarted(self, key: Key[Array, ""], state: CMAESState) -> CMAESState:
        """The same state, or where its run is over, the beginning of another."""
        over = is_over(
            state.unimproved,
            patience(self.search_space.size, self._candidates),
            state.mean,
            state.sigma,
            LARGEST_GROWTH * self.sigma0,
            state.covariance,
        )

        def anew() -> CMAESState:
            fresh = dataclasses.replace(
                self._start(key),
                generations=state.generations,
                fitness=state.fitness,
                best_ever=state.best_ever,
                diverged=state.diverged,
                restarts=state.restarts + 1,
            )
            return jax.tree.map(lambda new, old: jnp.where(over, new, old), fresh, state)

        return lax.cond(in_any_copy(over), anew, lambda: state)

    def _sigma_path(self, state: CMAESState, step: Float[Array, "gene"]) -> Float[Array, "gene"]:
        """p_sigma after a step of the mean, which is whitened."""
        of = self.parameters
        gain = (of.c_sigma * (2 - of.c_sigma) * of.effective_parents) ** 0.5
        return (1 - of.c_sigma) * state.sigma_path + gain * step  # eq. 43

    def _sigma(
        self,
        sigma: Float[Array, ""],
        sigma_path: Float[Array, "gene"],
        fitness: Float[Array, "candidate"],
    ) -> Float[Array, ""]:
        """Sigma after a generation: by the length of its path, and larger where fitness is flat."""
        of = self.parameters
        length = jnp.linalg.norm(sigma_path) / of.expected_norm
        sigma = sigma * jnp.exp(of.c_sigma / of.d_sigma * (length - 1))  # eq. 44
        if self.flat_share is not None:
            tied = (fitness == fitness.max()).sum()
            is_flat = tied >= smallest_count(self.flat_share, fitness.size)
            is_flat &= fitness.max() > WORST_FITNESS
            sigma = jnp.where(is_flat, sigma * of.flat_factor, sigma)
        return sigma

    def _within_limits(self, sigma: Float[Array, ""], covariance: Covariance) -> Float[Array, ""]:
        """A sigma with which no axis of the distribution is longer than it may become."""
        longest = jnp.sqrt(covariance.eigenvalues().max())
        return jnp.clip(sigma, LEAST_SIGMA, LARGEST_GROWTH * self.sigma0 / longest)

    def _change(
        self,
        state: CMAESState,
        generation: Int[Array, ""],
        sigma_path: Float[Array, "gene"],
        step: Float[Array, "gene"],
        weights: Float[Array, "candidate"],
        y: Float[Array, "candidate gene"],
        z: Float[Array, "candidate gene"],
    ) -> tuple[Float[Array, "gene"], Change]:
        """p_c, and what becomes of C."""
        of, genes = self.parameters, self.search_space.size
        # the path is not of its stationary length in the first generations
        settled = jnp.sqrt(1 - (1 - of.c_sigma) ** (2 * (generation + 1)))
        limit = (1.4 + 2 / (genes + 1)) * of.expected_norm
        h_sigma = jnp.where(jnp.linalg.norm(sigma_path) / settled < limit, 1.0, 0.0)
        gain = (of.c_c * (2 - of.c_c) * of.effective_parents) ** 0.5
        path = (1 - of.c_c) * state.path + h_sigma * gain * step  # eq. 45
        length = jnp.maximum((z**2).sum(-1), 1e-12)
        balanced = jnp.where(weights >= 0, weights, weights * genes / length)  # eq. 46
        delta = (1 - h_sigma) * of.c_c * (2 - of.c_c)
        kept = 1 + of.c_1 * delta - of.c_1 - of.c_mu * of.weights.sum()  # eq. 47
        return path, Change(kept, path, of.c_1, y, of.c_mu * balanced)


def renewed(covariance: Covariance) -> tuple[Covariance, Float[Array, ""]]:
    """C decomposed, and the unit in which steps are measured from now on, so that C stays in range.

    It is 1 as long as the largest eigenvalue is neither huge nor tiny.
    """
    covariance = covariance.decomposed()
    largest = covariance.eigenvalues().max()
    is_far = (largest > LARGEST_EIGENVALUE) | (largest < 1 / LARGEST_EIGENVALUE)
    unit = jnp.where(is_far, largest, 1.0)
    return covariance.divided(unit), jnp.sqrt(unit)


def generation_bytes(population_size: int, genes: int, covariance: str) -> int:
    """Memory of a generation: candidates, and the covariance before and after with its roots.

    What the fitness function needs is not among it.
    """
    numbers = 8 * population_size * genes
    return 4 * (numbers + (8 * genes**2 if covariance == "full" else 8 * genes))
