"""MAP-Elites (Mouret and Clune, 2015) for one run: a dict of cells, lists, loops and NumPy.

Random numbers are drawn as the learner draws them; what is done with them is written anew.
"""

import jax
import numpy as np


class Archive:
    def __init__(self, space, cells):
        self.space, self.cells = space, cells
        self.elites = {}  # by cell, a tuple of places: genome, fitness and descriptor

    def numbered(self):
        """The cells that are filled in the order of their numbers."""
        return sorted(self.elites)

    def add(self, key, genomes, evaluate):
        """Each candidate enters its cell if it is fitter than who is there, the fittest first."""
        found = [evaluate(genome) for genome in genomes]
        chance = np.asarray(jax.random.uniform(key, (len(genomes),))).tolist()
        for i in sorted(range(len(genomes)), key=lambda i: (-found[i][0], chance[i])):
            fitness, descriptor = found[i]
            cell = tuple(
                min(max(int(np.floor(number * self.cells)), 0), self.cells - 1)
                for number in np.asarray(descriptor)
            )
            if cell not in self.elites or fitness > self.elites[cell][1]:
                self.elites[cell] = genomes[i], fitness, descriptor

    def children(self, key, number, iso, line):
        """Children of elites drawn at random, each moved, and along the line to another elite."""
        for_parents, for_change, for_line, _ = jax.random.split(key, 4)
        filled = self.numbered()
        drawn = np.asarray(jax.random.randint(for_parents, (2 * number,), 0, len(filled)))
        genomes = [self.elites[filled[i]][0] for i in drawn]
        change = np.asarray(jax.random.normal(for_change, (number, self.space.size)))
        along = np.asarray(jax.random.normal(for_line, (number, 1)))
        born = []
        for i in range(number):
            parent, other = genomes[i], genomes[number + i]
            child = parent + iso * change[i] + line * along[i] * (other - parent)
            born.append(np.clip(child, self.space.lower, self.space.upper))
        return np.asarray(born, np.float32)
