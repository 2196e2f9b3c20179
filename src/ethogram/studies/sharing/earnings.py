"""What agents can earn in a scenario, exactly: at the optimum, and by choosing at random.

Both follow from what a place pays by how many share it (figure 3.1).  Nobody is active in the first
step, and agents that act at random step on a resource when they happen to confirm their preference,
with chance 1 / n_r in every step after it.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.stats import binom

Payoff = Float[np.ndarray, "filling"]  # of each agent on a place that 1 to n_a share

SETTLED = 1e-12  # chance of a random agent to be inactive still, from which on it never is


class Earnings(NamedTuple):
    """Return of an agent in an episode, averaged over agents (J)."""

    optimum: float
    random: float

    @property
    def range(self) -> float:
        """From random choices to the optimum."""
        return self.optimum - self.random


def earnings(payoff: Payoff, resources: int, steps: int) -> Earnings:
    """The best and the expected random J of episodes of some steps."""
    return Earnings(
        (steps - 1) * best_reward(payoff, resources), random_return(payoff, resources, steps)
    )


def best_reward(payoff: Payoff, resources: int) -> float:
    """The highest mean reward in a step in which every agent is active, over all ways to share."""
    agents = len(payoff)
    welfare = np.arange(agents + 1) * np.append(0.0, payoff)  # of one resource, by its filling
    best, doubled, left = np.where(np.arange(agents + 1) == 0, 0.0, -np.inf), welfare, resources
    while True:
        if left % 2:
            best = _shared(best, doubled)
        left //= 2
        if not left:
            return float(best[agents]) / agents
        doubled = _shared(doubled, doubled)


def random_return(payoff: Payoff, resources: int, steps: int) -> float:
    """Expected J of agents that choose every action at random: they are independent, and alike."""
    others, total = len(payoff) - 1, 0.0
    inactive, reward = 1.0, 0.0
    for step in range(2, steps + 1):
        if inactive > SETTLED:
            inactive = (1 - 1 / resources) ** (step - 1)
            company = binom.pmf(np.arange(others + 1), others, (1 - inactive) / resources)
            reward = (1 - inactive) * float(company @ payoff)
        total += reward
    return total


def _shared(
    one: Float[np.ndarray, "agents"], other: Float[np.ndarray, "agents"]
) -> Float[np.ndarray, "agents"]:
    """The best of two groups of resources together, for every number of agents on both."""
    return np.array([(one[: n + 1] + other[n::-1]).max() for n in range(len(one))])
