"""Fitness: what evolution knows of its problem, and what is said of it generation by generation."""

from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Key

from ethogram.core.errors import EthogramError, InvalidSettings
from ethogram.core.rollout import Policy

WORST_FITNESS = -1e30  # of candidates that diverged: finite, and below any other


class Evaluation(eqx.Module):
    """Fitness of candidates."""

    fitness: Float[Array, "candidate"]  # larger is better
    diverged: Bool[Array, "candidate"]  # whose fitness counts for nothing


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
    return Evaluation(jnp.where(diverged, WORST_FITNESS, evaluation.fitness), diverged)


def fitness_metrics(fitness: Float[Array, "individual"]) -> dict[str, Array]:
    """The best fitness, also as `episode_return`, and the mean of those that did not diverge.

    The mean is 0 where all did.
    """
    is_sound = fitness > WORST_FITNESS
    total = jnp.where(is_sound, fitness, 0.0).sum()
    best = fitness.max()
    return {"best": best, "episode_return": best, "mean": total / jnp.maximum(is_sound.sum(), 1)}


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
