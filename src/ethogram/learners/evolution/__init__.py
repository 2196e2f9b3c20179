"""Evolution: learners that know a fitness function and nothing else."""

from ethogram.learners.evolution.age_fitness import AgeFitness, Population, best
from ethogram.learners.evolution.base import WORST_FITNESS, Evaluation, Fitness

__all__ = ["WORST_FITNESS", "AgeFitness", "Evaluation", "Fitness", "Population", "best"]
