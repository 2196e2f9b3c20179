"""The learners, by name; other packages add theirs under the entry point `ethogram.learners`."""

from ethogram.core.registry import Registry

LEARNERS: Registry[type] = Registry(
    "learner",
    "ethogram.learners",
    {
        "age_fitness": "ethogram.learners.evolution:AgeFitness",
        "cmaes": "ethogram.learners.evolution:CMAES",
        "genetic": "ethogram.learners.evolution:Genetic",
        "maddpg": "ethogram.learners.maddpg:MADDPG",
        "map_elites": "ethogram.learners.evolution:MAPElites",
        "monte_carlo": "ethogram.learners.dynamic_programming:MonteCarloControl",
        "ppo": "ethogram.learners.ppo:PPO",
        "qlearning": "ethogram.learners.qlearning:QLearning",
    },
)
