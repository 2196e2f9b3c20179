"""A genetic algorithm on real genomes: tournaments, crossover, mutation, overlapping generations.

Every generation n_children children are born.  The parents of each win a tournament of n_tourn
individuals, drawn with replacement; the child is the uniform crossover of two winners, or else a
mutant of one, in which a number from N(0, sigma) is added to every gene.  Of parents and children
together the n_pop best remain (thesis, section 6.4.1, with the numbers of Table 6.1; overlapping
generations are De Jong's n + m model, "Evolutionary Computation", 2006).

Readings.  The thesis prints one probability of mutation, p_mut = 0.01; here 0.01 is the scale of a
mutation that moves all genes, and how often there is a crossover instead, 0.8, is a setting.  Both
parents may be the same individual.  In a tournament that ties the first that was drawn wins.
Individuals that stay are evaluated again where fitness is not deterministic; the best ever is then
a lucky one.
"""

from typing import Annotated

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Int, Key
from pydantic import Field

from ethogram.core.batching import take
from ethogram.core.memory import require_memory
from ethogram.core.settings import Fraction, Number, setting
from ethogram.learners.base import Metrics
from ethogram.learners.evolution.base import (
    BestEver,
    Evaluation,
    EvolutionaryLearner,
    best_first,
    fitness_metrics,
    with_worst,
)


class GeneticState(eqx.Module):
    """The individuals that are alive, the fittest first, and the best that ever was."""

    genome: Float[Array, "individual gene"]
    fitness: Float[Array, "individual"]
    best_ever: BestEver
    diverged: Int[Array, ""]  # of the candidates that were evaluated last


class Genetic(EvolutionaryLearner):
    """A genetic algorithm for any fitness function.

    Candidates that diverge, or whose fitness is not finite, get the worst fitness, are counted, and
    stay out of means.

    Attributes:
        search_space: where genes are drawn, and within what they stay.
        fitness: of all candidates in one call (see `ethogram.learners.evolution.base.Fitness`).
        population_size: n_pop, individuals, from 1 to 100 000.
        children: of a generation, from 1 to 100 000.
        tournament_size: n_tourn, from 1 to 100 000; 1 is no selection of parents.
        crossover_probability: of each child, from 0 to 1; the others are mutants.
        mutation_scale: sigma, the standard deviation of a change, in units of the gene; 0 or more.

    """

    population_size: int = setting(1000, Annotated[int, Field(ge=1, le=100_000)], static=True)
    children: int = setting(1000, Annotated[int, Field(ge=1, le=100_000)], static=True)
    tournament_size: int = setting(10, Annotated[int, Field(ge=1, le=100_000)], static=True)
    crossover_probability: Number = setting(0.8, Fraction)
    mutation_scale: Number = setting(0.01, Annotated[float, Field(ge=0)])

    def init(self, key: Key[Array, ""]) -> GeneticState:
        """A random population; its metrics are those of `metrics`.

        Raises:
            TooLarge: a generation would not fit in memory; the message names the size.

        """
        size, genes = self.population_size, self.search_space.size
        require_memory(
            f"Evolution of {size:,} individuals and {self.children:,} children of {genes} genes",
            generation_bytes(size, self.children, self.tournament_size, genes),
        )
        genome = self.search_space.sample(key, size)
        found = self.evaluate(key, genome)
        nobody = BestEver(genome[0], found.fitness[0])
        ever = nobody.after(genome, found.fitness)
        return GeneticState(genome, found.fitness, ever, found.diverged.sum())

    def metrics(self, state: GeneticState) -> Metrics:
        """The numbers of a generation.

        The `best` fitness ever, also as `episode_return`; the `mean` of those alive that did not
        diverge (0 if all did); how many of the candidates evaluated last have `diverged`.
        """
        found = fitness_metrics(state.best_ever.fitness, state.fitness)
        return found | {"diverged": state.diverged}

    def ask(self, key: Key[Array, ""], state: GeneticState) -> Float[Array, "candidate gene"]:
        """Children; those who are there already follow where fitness is not deterministic."""
        for_parents, for_choice, for_genes, for_change = jax.random.split(key, 4)
        winners = tournaments(for_parents, state.fitness, 2 * self.children, self.tournament_size)
        mother, father = take(state.genome, winners).reshape(2, self.children, -1)
        is_crossover = jax.random.bernoulli(
            for_choice, self.crossover_probability, (self.children, 1)
        )
        is_fathers = jax.random.bernoulli(for_genes, 0.5, mother.shape)
        change = self.mutation_scale * jax.random.normal(for_change, mother.shape)
        child = jnp.where(is_crossover, jnp.where(is_fathers, father, mother), mother + change)
        again = [] if self.fitness.deterministic else [state.genome]
        return jnp.concatenate([self.search_space.clip(child), *again])

    def tell(
        self,
        key: Key[Array, ""],
        state: GeneticState,
        candidates: Float[Array, "candidate gene"],
        evaluation: Evaluation,
    ) -> GeneticState:
        """The best of parents and children, the fittest first; the key decides ties."""
        evaluation = with_worst(evaluation)
        ever = state.best_ever.after(candidates, evaluation.fitness)
        born, again = evaluation.fitness[: self.children], evaluation.fitness[self.children :]
        genome = jnp.concatenate([state.genome, candidates[: self.children]])
        fitness = jnp.concatenate([state.fitness if self.fitness.deterministic else again, born])
        kept = best_first(key, fitness)[: self.population_size]
        return GeneticState(
            take(genome, kept), take(fitness, kept), ever, evaluation.diverged.sum()
        )


def tournaments(
    key: Key[Array, ""], fitness: Float[Array, "individual"], number: int, size: int
) -> Int[Array, "number"]:
    """Who wins each of so many tournaments: the fittest of those drawn with replacement.

    Args:
        key: consumed.
        fitness: of the individuals.
        number: of tournaments.
        size: how many are drawn for each.

    """
    drawn = jax.random.randint(key, (number, size), 0, fitness.size)
    first = take(fitness, drawn).argmax(-1, keepdims=True)
    return jnp.take_along_axis(drawn, first, -1)[:, 0]


def generation_bytes(population_size: int, children: int, tournament_size: int, genes: int) -> int:
    """Memory of a generation: genomes of old and new, parents, draws, and who meets whom.

    What the fitness function needs is not among it.
    """
    return 4 * (genes * (2 * population_size + 6 * children) + 4 * children * tournament_size)
