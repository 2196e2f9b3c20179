"""Age-fitness Pareto evolution, which protects the young (thesis, Algorithm 2).

Schmidt and Lipson, "Age-fitness pareto optimization" (2011), as the thesis uses it (section 5.3.4):
every generation each individual has one mutant child, one random newcomer joins, and of these
2 n + 1 the n best are kept, front after front of those that no other surpasses in both fitness
and age.

Readings.  A mutant is as old as its parent has become: the age counts how long a lineage has been
evolving.  Every gene changes with probability 1 / |theta|, so that a mutant may be its parent
again; it is evaluated all the same.  The last front that does not fit whole is cut by fitness, and
at random where fitness ties.  The best individual is the fittest, the first of those that tie.
Individuals that stay are evaluated again where fitness is not deterministic.

A learner is one run.  Runs side by side are `ethogram.learners.base.Trials` of it.
"""

from typing import Annotated

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Int, Key
from pydantic import Field

from ethogram.core.memory import require_memory
from ethogram.core.settings import Number, setting
from ethogram.learners.base import Metrics
from ethogram.learners.evolution.base import (
    Evaluation,
    EvolutionaryLearner,
    fitness_metrics,
    with_worst,
)
from ethogram.learners.evolution.pareto import dominance, fronts


class Population(eqx.Module):
    """The individuals that are alive."""

    genome: Float[Array, "individual gene"]
    age: Int[Array, "individual"]  # generations since its first ancestor was drawn
    fitness: Float[Array, "individual"]
    diverged: Int[Array, ""]  # of the candidates that were evaluated last


class AgeFitness(EvolutionaryLearner):
    """Algorithm 2 for any fitness function.

    Candidates that diverge, or whose fitness is not finite, get the worst fitness, are counted, and
    stay out of means.

    Attributes:
        search_space: where genes are drawn, and within what they stay.
        fitness: of all candidates in one call (see `ethogram.learners.evolution.base.Fitness`).
        population_size: n, individuals, from 1 to 100 000.
        mutation_probability: of each gene, from 0 to 1; None is 1 / |theta|.
        mutation_scale: sigma_mut, the standard deviation of a change, in units of the gene; 0 or
            more.

    """

    population_size: int = setting(30, Annotated[int, Field(ge=1, le=100_000)], static=True)
    mutation_probability: Number | None = setting(None, Annotated[float, Field(ge=0, le=1)] | None)
    mutation_scale: Number = setting(1.0, Annotated[float, Field(ge=0)])

    def init(self, key: Key[Array, ""]) -> Population:
        """A random population of age 0; its metrics are those of `metrics`.

        Raises:
            TooLarge: a generation would not fit in memory; the message names the size.

        """
        size, genes = self.population_size, self.search_space.size
        require_memory(
            f"Evolution of {size:,} individuals of {genes} genes", generation_bytes(size, genes)
        )
        genome = self.search_space.sample(key, size)
        evaluation = self.evaluate(key, genome)
        return Population(
            genome, jnp.zeros(size, jnp.int32), evaluation.fitness, evaluation.diverged.sum()
        )

    def metrics(self, state: Population) -> Metrics:
        """The numbers of a generation.

        The `best` fitness, also as `episode_return`; the `mean` of those that did not diverge (0 if
        all did); the `age` of the best; how many of the candidates evaluated last have `diverged`.
        """
        return fitness_metrics(state.fitness.max(), state.fitness) | {
            "age": state.age[state.fitness.argmax()],
            "diverged": state.diverged,
        }

    def ask(self, key: Key[Array, ""], state: Population) -> Float[Array, "candidate gene"]:
        """Candidates: a mutant of each individual, then a newcomer.

        Those who are there already follow where fitness is not deterministic.
        """
        for_choice, for_change, for_newcomer = jax.random.split(key, 3)
        genome, rate = state.genome, self.mutation_probability
        chosen = jax.random.bernoulli(
            for_choice, 1 / self.search_space.size if rate is None else rate, genome.shape
        )
        change = self.mutation_scale * jax.random.normal(for_change, genome.shape)
        mutants = self.search_space.clip(genome + jnp.where(chosen, change, 0.0))
        newcomer = self.search_space.sample(for_newcomer, 1)
        again = [] if self.fitness.deterministic else [genome]
        return jnp.concatenate([mutants, newcomer, *again])

    def tell(
        self,
        key: Key[Array, ""],
        state: Population,
        candidates: Float[Array, "candidate gene"],
        evaluation: Evaluation,
    ) -> Population:
        """The best of old and new, all a generation older; the key decides ties."""
        evaluation = with_worst(evaluation)
        new = self.population_size + 1
        again = evaluation.fitness[new:]
        older = state.age + 1
        age = jnp.concatenate([older, older, jnp.zeros_like(older[:1])])
        fitness = jnp.concatenate(
            [state.fitness if self.fitness.deterministic else again, evaluation.fitness[:new]]
        )
        genome = jnp.concatenate([state.genome, candidates[:new]])
        front = fronts(dominance(fitness, age))
        chance = jax.random.uniform(key, front.shape)
        kept = jnp.lexsort((chance, -fitness, front))[: self.population_size]
        return Population(genome[kept], age[kept], fitness[kept], evaluation.diverged.sum())


def generation_bytes(population_size: int, genes: int) -> int:
    """Memory of a generation: old and new genomes, twice, and who surpasses whom.

    What the fitness function needs is not among it.
    """
    candidates = 2 * population_size + 1
    return candidates * (2 * 4 * genes + 2 * candidates)
