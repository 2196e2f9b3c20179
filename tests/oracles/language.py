"""The unknown-target game as the thesis writes it: one robot after the other, with loops."""

from dataclasses import dataclass, field

import numpy as np

#         none    up      right   down     left
CHANGES = [(0, 0), (0, 1), (1, 0), (0, -1), (-1, 0)]


@dataclass
class Game:
    positions: list  # x_r, per robot
    targets: list  # x_t, per target
    guides: list  # tau_r: whom each robot guides
    goals: list  # own target of each robot
    words: int  # |W| + 1
    dynamics: str
    execution: str
    delta: float = 0.05
    observe_velocity: bool = False
    velocities: list = field(default_factory=list)
    said: list = field(default_factory=list)

    def __post_init__(self):
        self.positions = [np.array(x, float) for x in self.positions]
        self.targets = [np.array(x, float) for x in self.targets]
        self.velocities = [np.zeros(2) for _ in self.positions]
        self.said = [one_hot(0, self.words) for _ in self.positions]

    def step(self, moves, words):
        if self.execution == "hard":
            moves = [one_hot(np.argmax(move), len(CHANGES)) for move in moves]
            words = [one_hot(np.argmax(word), self.words) for word in words]
        for i, move in enumerate(moves):
            push = sum(
                weight * np.array(change) for weight, change in zip(move, CHANGES, strict=True)
            )
            if self.dynamics == "damped":
                self.velocities[i] = 0.75 * self.velocities[i] + 0.05 * push
                self.positions[i] = self.positions[i] + self.velocities[i]
            else:
                self.positions[i] = self.positions[i] + self.velocities[i]
                self.velocities[i] = self.velocities[i] + self.delta * push
        self.said = [np.array(word) for word in words]

    def mover_observations(self):  # eq. 2.2
        rows = []
        for position, velocity in zip(self.positions, self.velocities, strict=True):
            offsets = [target - position for target in self.targets]
            own = [velocity] if self.observe_velocity else []
            rows.append(np.concatenate([*offsets, *own, *self.said]))
        return rows

    def talker_observations(self):  # eq. 2.3
        return [
            np.concatenate(
                [
                    one_hot(guided, len(self.positions)),
                    one_hot(self.goals[guided], len(self.targets)),
                ]
            )
            for guided in self.guides
        ]

    def mover_rewards(self):  # eqs. 2.4, 2.5
        rewards = []
        for i, position in enumerate(self.positions):
            reward = 0.0
            for guided in self.guides:
                if guided == i:
                    reward -= manhattan(position, self.targets[self.goals[guided]])
            rewards.append(reward)
        return rewards

    def talker_rewards(self):  # eq. 2.6
        return [
            -manhattan(self.positions[guided], self.targets[self.goals[guided]])
            for guided in self.guides
        ]


def one_hot(number, size):
    return [1.0 if i == number else 0.0 for i in range(size)]


def manhattan(a, b):
    return abs(a[0] - b[0]) + abs(a[1] - b[1])
