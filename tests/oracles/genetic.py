"""The genetic algorithm of the thesis (section 6.4.1) for one run: lists, loops and NumPy.

Random numbers are drawn as the learner draws them; what is done with them is written anew.
"""

from typing import NamedTuple

import jax
import numpy as np


class Individual(NamedTuple):
    genome: np.ndarray
    fitness: float


def first(key, evaluate, space, size):
    """A random population."""
    genomes = np.asarray(space.sample(key, size))
    return [Individual(genome, float(evaluate(genome))) for genome in genomes]


def next_generation(key, population, evaluate, space, children, tournament, crossover, scale):
    """Children are born to winners of tournaments, and the best of all stay, the fittest first."""
    for_offspring, for_ties = jax.random.split(key)
    for_parents, for_choice, for_genes, for_change = jax.random.split(for_offspring, 4)
    genes = len(population[0].genome)
    drawn = jax.random.randint(for_parents, (2 * children, tournament), 0, len(population))
    winners = [
        max((population[i] for i in entrants), key=lambda one: one.fitness)
        for entrants in np.asarray(drawn).tolist()
    ]
    is_crossover = np.asarray(jax.random.bernoulli(for_choice, crossover, (children, 1)))
    is_fathers = np.asarray(jax.random.bernoulli(for_genes, 0.5, (children, genes)))
    change = np.asarray(jax.random.normal(for_change, (children, genes)))
    born = []
    for number in range(children):
        mother, father = winners[number].genome, winners[children + number].genome
        child = mother.copy()
        for gene in range(genes):
            if not is_crossover[number, 0]:
                child[gene] += scale * change[number, gene]
            elif is_fathers[number, gene]:
                child[gene] = father[gene]
            child[gene] = min(max(child[gene], space.lower[gene]), space.upper[gene])
        born.append(Individual(child, float(evaluate(child))))
    everyone = [*population, *born]
    chance = np.asarray(jax.random.uniform(for_ties, (len(everyone),))).tolist()
    order = sorted(range(len(everyone)), key=lambda i: (-everyone[i].fitness, chance[i]))
    return [everyone[i] for i in order[: len(population)]]
