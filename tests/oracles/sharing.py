"""The sharing world and its learners as the thesis writes them: lists of agents, dictionaries."""

from dataclasses import dataclass, field

import numpy as np

NONE = 0


@dataclass
class Group:
    agents: int
    resources: int
    scenario: str
    communication: str
    observe_filling: bool
    literal: bool = False
    states: list = field(default_factory=list)  # U: (place, preference) per agent
    words: list = field(default_factory=list)  # W: the same, or None

    def __post_init__(self):
        self.states = [(NONE, NONE)] * self.agents
        self.words = [None] * self.agents

    def step(self, actions):
        for i, action in enumerate(actions):
            if self.communication == "optional":
                wish, speaks = action // 2 + 1, action % 2 == 1
            else:
                wish, speaks = action + 1, self.communication == "always"
            place, preference = self.states[i]
            self.states[i] = (wish if wish == preference else place, wish)
            self.words[i] = self.states[i] if speaks else None

    def filling(self):
        return [sum(place == j for place, _ in self.states) for j in range(1, self.resources + 1)]

    def heard(self):
        totals = []
        for j in range(1, self.resources + 1):
            v = 0
            for word in self.words:
                if word is not None and word[1] == j:
                    v += self.agents + 1 if word[0] == j else 1
            totals.append(v)
        return totals

    def observations(self):
        rho = self.filling() if self.observe_filling else []
        return [(*rho, *state, *self.heard()) for state in self.states]

    def rewards(self):
        return [self._reward(place) for place, _ in self.states]

    def _reward(self, place):
        if place == NONE:
            return 0.0
        rho = self.filling()[place - 1]
        capacity = self.agents / self.resources
        if self.scenario == "cooperative":
            return rho / (self.agents * self.resources if self.literal else self.agents)
        if self.scenario == "competitive":
            return max(0.0, (capacity + 1 - rho) / capacity)
        if rho <= capacity:
            return rho / (self.agents * self.resources if self.literal else capacity)
        return max(0.0, capacity - rho + 1)


class Learner:
    """One agent's sparse table."""

    def __init__(self, actions, rate, discount):
        self.table = {}
        self.actions, self.rate, self.discount = actions, rate, discount

    def values(self, observation):
        return self.table.setdefault(observation, np.zeros(self.actions))

    def learn(self, observation, action, reward, after, terminated):
        future = 0.0 if terminated else self.values(after).max()
        error = reward + self.discount * future - self.values(observation)[action]
        self.values(observation)[action] += self.rate * error
