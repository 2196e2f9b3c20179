"""Algorithm 2 of the thesis for one run, one individual at a time: lists, loops and NumPy.

Random numbers are drawn as the learner draws them; what is done with them is written anew.
"""

from typing import NamedTuple

import jax
import numpy as np


class Individual(NamedTuple):
    genome: np.ndarray
    age: int
    fitness: float


def first(key, evaluate, low, high, size):
    """A random population."""
    genomes = np.asarray(jax.random.uniform(key, (size, len(low)), minval=low, maxval=high))
    return [Individual(genome, 0, fitness(evaluate, genome)) for genome in genomes]


def next_generation(key, population, evaluate, low, high, lower, upper):
    """Everyone ages and has a mutant child, a newcomer joins, and the best stay."""
    for_offspring, for_ties = jax.random.split(key)
    for_choice, for_change, for_newcomer = jax.random.split(for_offspring, 3)
    shape = len(population), len(low)
    chosen = np.asarray(jax.random.bernoulli(for_choice, 1 / len(low), shape))
    change = np.asarray(jax.random.normal(for_change, shape))
    parents = [parent._replace(age=parent.age + 1) for parent in population]
    children = []
    for number, parent in enumerate(parents):
        genome = parent.genome.copy()
        for gene in range(len(low)):
            if chosen[number, gene]:
                mutated = genome[gene] + change[number, gene]
                genome[gene] = min(max(mutated, lower[gene]), upper[gene])
        children.append(Individual(genome, parent.age, fitness(evaluate, genome)))
    (newcomer,) = first(for_newcomer, evaluate, low, high, 1)
    everyone = [*parents, *children, newcomer]
    chance = np.asarray(jax.random.uniform(for_ties, (len(everyone),))).tolist()
    kept = []
    for front in fronts(everyone):
        best_first = sorted(front, key=lambda i: (-everyone[i].fitness, chance[i]))
        kept += best_first[: len(population) - len(kept)]
    return [everyone[i] for i in kept]


def fronts(everyone):
    """The numbers of those that nobody dominates, then of those that only these dominate, ..."""
    left = list(range(len(everyone)))
    while left:
        front = [
            i for i in left if not any(dominates(everyone[j], everyone[i]) for j in left if j != i)
        ]
        yield front
        left = [i for i in left if i not in front]


def dominates(one, other):
    """Better in fitness or age, and worse in neither."""
    no_worse = one.fitness >= other.fitness and one.age <= other.age
    return no_worse and (one.fitness > other.fitness or one.age < other.age)


def fitness(evaluate, genome):
    return float(evaluate(genome))
