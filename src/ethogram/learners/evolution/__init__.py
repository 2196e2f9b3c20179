"""Evolution: learners that know a fitness function and nothing else."""

from ethogram.learners.evolution.age_fitness import (
    WORST,
    AgeFitness,
    Evaluate,
    Evaluated,
    Population,
    best,
)
from ethogram.learners.evolution.genes import Genes

__all__ = ["WORST", "AgeFitness", "Evaluate", "Evaluated", "Genes", "Population", "best"]
