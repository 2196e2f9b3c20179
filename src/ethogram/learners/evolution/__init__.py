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
from ethogram.learners.evolution.map_elites import Archive, MAPElites

__all__ = [
    "CMAES",
    "WORST_FITNESS",
    "AgeFitness",
    "Archive",
    "BestEver",
    "CMAESState",
    "Evaluation",
    "EvolutionaryLearner",
    "Fitness",
    "Genetic",
    "GeneticState",
    "MAPElites",
    "Population",
    "best",
]
