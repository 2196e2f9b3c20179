"""Evolution that protects the young: Pareto selection on fitness and age (thesis, Algorithm 2).

Schmidt and Lipson, "Age-fitness pareto optimization" (2011), as the thesis uses it (section 5.3.4):
every generation each individual has one mutant child, one random newcomer joins, and of these
2 n + 1 the n best are kept, front after front of those that no other surpasses in both fitness
and age.

Readings.  A mutant is as old as its parent has become: the age counts how long a lineage has been
evolving.  Every gene changes with probability 1 / |theta|, so that a mutant may be its parent
again; it is evaluated all the same.  The last front that does not fit whole is cut by fitness, and
at random where fitness ties.  The best individual is the fittest, the first of those that tie.
Fitness is deterministic: who stays is not evaluated again.

Independent runs are the leading axis of every array: all runs' candidates are evaluated by one
call, and a run's numbers depend on its own key alone, as far as the evaluation's do.
"""

from collections.abc import Callable
from typing import Annotated, Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int, Key
from pydantic import Field

from ethogram.core.memory import require_memory
from ethogram.core.module import Module
from ethogram.core.settings import Number, check_settings, setting
from ethogram.learners.evolution.genes import Genes
from ethogram.learners.evolution.pareto import dominance, fronts

WORST = -1e30  # fitness of who broke: finite, and below any other


class Evaluated(eqx.Module):
    """What became of the candidates."""

    fitness: Float[Array, "run candidate"]  # larger is better
    broken: Bool[Array, "run candidate"]  # whose fitness counts for nothing


Evaluate = Callable[[Float[Array, "run candidate gene"]], Evaluated]


class Population(eqx.Module):
    """Who is alive in each run."""

    genome: Float[Array, "run individual gene"]
    age: Int[Array, "run individual"]  # generations since its first ancestor was drawn
    fitness: Float[Array, "run individual"]


class AgeFitness(Module):
    """Algorithm 2 for any fitness function.

    `evaluate` takes genomes to fitness, of all candidates of all runs at once.  Candidates that
    break, or whose fitness is not finite, get the worst fitness, are counted, and stay out of
    means.
    """

    genes: Genes
    evaluate: Evaluate
    population: int = setting(30, Annotated[int, Field(ge=1, le=100_000)], static=True)
    mutation_probability: Number | None = setting(
        None, Annotated[float, Field(ge=0, le=1)] | None
    )  # per gene; None is 1 / |theta|
    mutation_scale: Number = setting(1.0, Annotated[float, Field(ge=0)])  # sigma_mut

    def __check_init__(self) -> None:
        """Refuse settings out of range."""
        check_settings(self)

    def init(self, key: Key[Array, "run"]) -> tuple[Population, Any]:
        """Random populations of age 0, and their metrics (see `update`).

        Raises:
            TooLarge: a generation would not fit in memory; the message names the size.

        """
        runs, individuals = key.shape[0], self.population
        require_memory(
            f"Evolution in {runs:,} runs of {individuals:,} individuals of {len(self.genes)} genes",
            generation_bytes(runs, individuals, len(self.genes)),
        )
        genome = jax.vmap(lambda one: self.genes.random(one, self.population))(key)
        evaluated = _with_worst(self.evaluate(genome))
        age = jnp.zeros(evaluated.fitness.shape, jnp.int32)
        population = Population(genome, age, evaluated.fitness)
        return population, _metrics(population, evaluated.broken)

    def ask(
        self, key: Key[Array, "run"], population: Population
    ) -> Float[Array, "run candidate gene"]:
        """A mutant of each individual, then a newcomer."""
        return jax.vmap(self._offspring)(key, population.genome)

    def tell(
        self,
        key: Key[Array, "run"],
        population: Population,
        candidates: Float[Array, "run candidate gene"],
        evaluated: Evaluated,
    ) -> Population:
        """Let all grow older, and keep the best of old and new; the key decides ties."""
        older = population.age + 1
        newcomer = jnp.zeros_like(older[:, :1])
        everyone = Population(
            genome=jnp.concatenate([population.genome, candidates], 1),
            age=jnp.concatenate([older, older, newcomer], 1),
            fitness=jnp.concatenate([population.fitness, _with_worst(evaluated).fitness], 1),
        )
        return jax.vmap(self._survivors)(key, everyone)

    def update(self, key: Key[Array, "run"], population: Population) -> tuple[Population, Any]:
        """One generation.

        Returns:
            The next population, and per run its `best` fitness, the `mean` of those that did not
            break (0 if all did), the `age` of the best, and how many candidates were `broken`.

        """
        for_offspring, for_ties = jnp.moveaxis(jax.vmap(jax.random.split)(key), 1, 0)
        candidates = self.ask(for_offspring, population)
        evaluated = _with_worst(self.evaluate(candidates))
        population = self.tell(for_ties, population, candidates, evaluated)
        return population, _metrics(population, evaluated.broken)

    def _offspring(
        self, key: Key[Array, ""], genome: Float[Array, "individual gene"]
    ) -> Float[Array, "candidate gene"]:
        for_choice, for_change, for_newcomer = jax.random.split(key, 3)
        rate = self.mutation_probability
        chosen = jax.random.bernoulli(
            for_choice, 1 / len(self.genes) if rate is None else rate, genome.shape
        )
        change = self.mutation_scale * jax.random.normal(for_change, genome.shape)
        newcomer = self.genes.random(for_newcomer, 1)
        return jnp.concatenate([self.genes.mutate(genome, chosen, change), newcomer])

    def _survivors(self, key: Key[Array, ""], everyone: Any) -> Any:
        """The best of one run: by front, then by fitness, then at random."""
        front = fronts(dominance(everyone.fitness, everyone.age))
        chance = jax.random.uniform(key, front.shape)
        kept = jnp.lexsort((chance, -everyone.fitness, front))[: self.population]
        return jax.tree.map(lambda of_all: of_all[kept], everyone)


def generation_bytes(runs: int, population: int, genes: int) -> int:
    """Memory of a generation: old and new genomes, twice, and who surpasses whom.

    What the fitness function needs is not among it.
    """
    candidates = 2 * population + 1
    return runs * candidates * (2 * 4 * genes + 2 * candidates)


def best(
    population: Population,
) -> tuple[Float[Array, "run gene"], Float[Array, "run"]]:
    """Genome and fitness of the fittest individual of each run."""
    first = population.fitness.argmax(1)
    run = jnp.arange(len(first))
    return population.genome[run, first], population.fitness[run, first]


def _with_worst(evaluated: Evaluated) -> Evaluated:
    broken = evaluated.broken | ~jnp.isfinite(evaluated.fitness)
    return Evaluated(jnp.where(broken, WORST, evaluated.fitness), broken)


def _metrics(population: Population, broken: Bool[Array, "run candidate"]) -> dict[str, Array]:
    sound = population.fitness > WORST
    total = jnp.where(sound, population.fitness, 0.0).sum(1)
    fittest = population.fitness.argmax(1)
    return {
        "best": population.fitness.max(1),
        "mean": total / jnp.maximum(sound.sum(1), 1),
        "age": jnp.take_along_axis(population.age, fittest[:, None], 1)[:, 0],
        "broken": broken.sum(1),
    }
