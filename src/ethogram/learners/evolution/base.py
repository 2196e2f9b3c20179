"""Fitness: what evolution knows of its problem, and what all evolutionary learners share.

Fitness is maximised.  Who is better is decided here, for all: `best_first` orders, `BestEver` keeps
the fittest that there ever was, and `with_worst` says what a broken candidate is worth.
"""

import dataclasses
from abc import abstractmethod
from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int, Key

from ethogram.core.batching import take
from ethogram.core.errors import EthogramError, InvalidSettings
from ethogram.core.module import Module
from ethogram.core.rollout import Policy
from ethogram.core.search_space import SearchSpace
from ethogram.learners.base import Metrics

WORST_FITNESS = -1e30  # of candidates that diverged: finite, and below any other

_EVALUATION = 0  # folded into a generation's key, for what chance there is in fitness


class Evaluation(eqx.Module):
    """Fitness of candidates, and, for those who ask, how they behaved."""

    fitness: Float[Array, "candidate"]  # larger is better
    diverged: Bool[Array, "candidate"]  # whose fitness counts for nothing
    descriptor: Float[Array, "candidate descriptor"] | None = None  # of behaviour, for MAP-Elites


@runtime_checkable
class Fitness(Protocol):
    """A fitness function, of all candidates of a generation in one call.

    Attributes:
        deterministic: whether a genome has the same fitness whatever the key and whenever it is
            evaluated.  If it has not, individuals that stay are evaluated again.

    A fitness may have a method `policy(genome) -> Policy`: how to act by a genome in a world.

    """

    deterministic: bool

    def __call__(self, key: Key[Array, ""], genomes: Float[Array, "candidate gene"]) -> Evaluation:
        """Evaluate candidates; consumes the key."""


class BestEver(eqx.Module):
    """The fittest candidate that was ever evaluated; where fitness is noisy, a lucky one."""

    genome: Float[Array, "gene"]
    fitness: Float[Array, ""]

    def after(
        self, genomes: Float[Array, "candidate gene"], fitness: Float[Array, "candidate"]
    ) -> "BestEver":
        """Who it is after more have been evaluated: the first of those that tie."""
        fittest = fitness.argmax()
        genome, reached = take(genomes, fittest), take(fitness, fittest)
        is_better = reached > self.fitness
        return BestEver(
            jnp.where(is_better, genome, self.genome), jnp.where(is_better, reached, self.fitness)
        )


class EvolutionaryLearner(Module):
    """What all learners do that know a fitness function and nothing else.

    `update` is one generation: `ask` for candidates, evaluate them, `tell` how they did.  Whoever
    evaluates elsewhere uses the two halves.  A learner is one run; runs side by side are
    `ethogram.learners.base.Trials` of it.

    Attributes:
        search_space: where genes are drawn, and within what they stay.
        fitness: of all candidates in one call (see `Fitness`).

    """

    search_space: SearchSpace
    fitness: Fitness

    def __check_init__(self) -> None:
        """Refuse a fitness that does not say what it is."""
        require_fitness(self.fitness)

    @abstractmethod
    def init(self, key: Key[Array, ""]) -> Any:
        """The state before the first generation.

        Raises:
            TooLarge: a generation would not fit in memory; the message names the size.

        """

    @abstractmethod
    def metrics(self, state: Any) -> Metrics:
        """The numbers of a generation."""

    @abstractmethod
    def ask(self, key: Key[Array, ""], state: Any) -> Float[Array, "candidate gene"]:
        """Candidates to evaluate."""

    @abstractmethod
    def tell(
        self,
        key: Key[Array, ""],
        state: Any,
        candidates: Float[Array, "candidate gene"],
        evaluation: Evaluation,
    ) -> Any:
        """The state after candidates were evaluated; the key decides ties."""

    def update(self, key: Key[Array, ""], state: Any) -> tuple[Any, Metrics]:
        """One generation; returns the next state and its `metrics`."""
        for_offspring, for_ties = jax.random.split(key)
        candidates = self.ask(for_offspring, state)
        state = self.tell(for_ties, state, candidates, self.evaluate(key, candidates))
        return state, self.metrics(state)

    def policy(self, state: Any, *, explore: bool = False) -> Policy:
        """How the best individual acts; exploring is done by variation, never in a world.

        Raises:
            EthogramError: the fitness makes no policy of a genome.

        """
        del explore
        return genome_policy(self.fitness, best(state)[0])

    def evaluate(self, key: Key[Array, ""], genomes: Float[Array, "candidate gene"]) -> Evaluation:
        """The fitness of candidates, with the worst for those that diverged.

        Raises:
            InvalidSettings: the fitness gives something else than an `Evaluation` of all of them.

        """
        found = self.fitness(jax.random.fold_in(key, _EVALUATION), genomes)
        shapes = [
            getattr(getattr(found, name, None), "shape", None) for name in ("fitness", "diverged")
        ]
        if shapes != [genomes.shape[:1]] * 2:
            raise InvalidSettings(
                f"fitness {type(self.fitness).__name__} gives arrays of the shapes {shapes}; "
                f"allowed: an Evaluation whose fitness and diverged have the shape "
                f"{genomes.shape[:1]}, a number for each candidate."
            )
        return with_worst(found)


def best(state: Any) -> tuple[Float[Array, "gene"], Float[Array, ""]]:
    """Genome and fitness of the fittest: the best ever where a state keeps it, else who is alive.

    Args:
        state: of any evolutionary learner.

    """
    ever = getattr(state, "best_ever", None)
    if ever is not None:
        return ever.genome, ever.fitness
    fittest = state.fitness.argmax()
    return state.genome[fittest], state.fitness[fittest]


def best_first(key: Key[Array, ""], fitness: Float[Array, "candidate"]) -> Int[Array, "candidate"]:
    """The numbers of candidates from the fittest to the least fit, at random where they tie."""
    return jnp.lexsort((jax.random.uniform(key, fitness.shape), -fitness))


def require_fitness(fitness: Any) -> None:
    """Refuse what does not say whether it is deterministic.

    Raises:
        InvalidSettings: it does not.

    """
    if not isinstance(getattr(fitness, "deterministic", None), bool):
        raise InvalidSettings(
            f"fitness = {fitness!r} does not say whether it is deterministic; allowed: a function "
            "of a key and genomes with an attribute `deterministic`, True or False."
        )


def with_worst(evaluation: Evaluation) -> Evaluation:
    """The worst fitness for candidates that diverged, or whose fitness is not finite."""
    diverged = evaluation.diverged | ~jnp.isfinite(evaluation.fitness)
    return dataclasses.replace(
        evaluation,
        fitness=jnp.where(diverged, WORST_FITNESS, evaluation.fitness),
        diverged=diverged,
    )


def mean_fitness(fitness: Float[Array, "individual"]) -> Float[Array, ""]:
    """The mean of those that did not diverge; 0 where all did."""
    is_sound = fitness > WORST_FITNESS
    total = jnp.where(is_sound, fitness, 0.0).sum()
    return total / jnp.maximum(is_sound.sum(), 1)


def fitness_metrics(
    best: Float[Array, ""], fitness: Float[Array, "individual"]
) -> dict[str, Array]:
    """The best fitness, also as `episode_return`, and the mean of those that did not diverge."""
    return {"best": best, "episode_return": best, "mean": mean_fitness(fitness)}


def genome_policy(fitness: Fitness, genome: Float[Array, "gene"]) -> Policy:
    """How to act by a genome, which its fitness knows.

    Raises:
        EthogramError: it does not.

    """
    make = getattr(fitness, "policy", None)
    if make is None:
        raise EthogramError(
            f"The fitness {type(fitness).__name__} makes no policy of a genome; allowed: one with "
            "a method `policy(genome)`."
        )
    found: Policy = make(genome)
    return found
