"""Evolution: learners that know a fitness function and nothing else."""

from ethogram.learners.evolution.age_fitness import AgeFitness, Population
from ethogram.learners.evolution.base import (
    WORST_FITNESS,
    BestEver,
    Evaluation,
    EvolutionaryLearner,
    Fitness,
    best,
)
from ethogram.learners.evolution.cmaes import CMAES, CMAESState
from ethogram.learners.evolution.genetic import Genetic, GeneticState

__all__ = [
    "CMAES",
    "WORST_FITNESS",
    "AgeFitness",
    "BestEver",
    "CMAESState",
    "Evaluation",
    "EvolutionaryLearner",
    "Fitness",
    "Genetic",
    "GeneticState",
    "Population",
    "best",
]
