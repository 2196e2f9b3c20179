"""MADDPG as its paper states it, agent by agent in plain NumPy, with gradients worked by hand."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

BETAS, EPSILON = (0.9, 0.999), 1e-8  # of Adam


class Settings(NamedTuple):
    """What a round of updates depends on."""

    discount: float
    rate: float
    temperature: float
    tau: float
    clip: float
    penalty: float


class Network:
    """Dense layers, rectified but for the last: arrays are [weights, bias, weights, bias, ...]."""

    def __init__(self, weights, biases):
        pairs = zip(weights, biases, strict=True)
        self.arrays = [np.array(array, float) for pair in pairs for array in pair]
        self.means = [np.zeros_like(array) for array in self.arrays]  # Adam's
        self.squares = [np.zeros_like(array) for array in self.arrays]
        self.steps = 0

    def inputs(self, x):
        """What each layer reads, and then the output."""
        read = [x]
        for layer in range(0, len(self.arrays), 2):
            out = read[-1] @ self.arrays[layer] + self.arrays[layer + 1]
            read.append(out if layer == len(self.arrays) - 2 else np.maximum(out, 0))
        return read

    def __call__(self, x):
        return self.inputs(x)[-1]

    def gradients(self, x, slope):
        """Of a loss whose slope in the output is given: per array, and in x."""
        read, found = self.inputs(x), []
        for layer in reversed(range(0, len(self.arrays), 2)):
            into = read[layer // 2]
            found = [into.T @ slope, slope.sum(0), *found]
            slope = slope @ self.arrays[layer].T
            if layer > 0:
                slope = slope * (into > 0)
        return found, slope

    def descend(self, gradients, rate, clip):
        """Clip each array's gradient, then take Adam's step."""
        self.steps += 1
        for at, gradient in enumerate(gradients):
            norm = np.sqrt((gradient**2).sum())
            if norm > clip:
                gradient = gradient * clip / norm
            self.means[at] = BETAS[0] * self.means[at] + (1 - BETAS[0]) * gradient
            self.squares[at] = BETAS[1] * self.squares[at] + (1 - BETAS[1]) * gradient**2
            mean = self.means[at] / (1 - BETAS[0] ** self.steps)
            square = self.squares[at] / (1 - BETAS[1] ** self.steps)
            self.arrays[at] = self.arrays[at] - rate * mean / (np.sqrt(square) + EPSILON)

    def follow(self, other, tau):
        """Move by a share tau towards another network."""
        pairs = zip(self.arrays, other.arrays, strict=True)
        self.arrays = [(1 - tau) * own + tau * ahead for own, ahead in pairs]


@dataclass
class Agent:
    """An agent's networks, and what its choices are like."""

    actor: Network
    critic: Network
    target_actor: Network
    target_critic: Network
    used: np.ndarray  # choices that there are; the others always weigh 0
    hard: bool  # whether the heaviest choice is taken whole
    losses: dict = field(default_factory=dict)


class Step(NamedTuple):
    """A minibatch for one agent, and the noise it acts with: lists run over all agents."""

    observation: list  # [batch, feature]
    action: list  # [batch, choice]
    reward: np.ndarray  # [batch], the agent's own
    terminated: np.ndarray  # [batch], the agent's own
    reached: list  # [batch, feature], what was observed after
    target_noise: list  # [batch, choice]
    noise: np.ndarray  # [batch, choice], the agent's own


def update(agents, turns, settings):
    """One round: `turns` are pairs of an agent's number and its `Step`, in order."""
    for number, step in turns:
        _update_critic(agents, number, step, settings)
        _update_actor(agents[number], number, step, settings)
        agent = agents[number]
        agent.target_actor.follow(agent.actor, settings.tau)
        agent.target_critic.follow(agent.critic, settings.tau)


def _update_critic(agents, number, step, settings):
    agent, future_actions = agents[number], []
    for other, reached, noise in zip(agents, step.reached, step.target_noise, strict=True):
        taken, _ = _choose(other, other.target_actor(reached), noise, settings.temperature)
        future_actions.append(taken)
    future = agent.target_critic(np.concatenate([*step.reached, *future_actions], 1))[:, 0]
    goal = step.reward + settings.discount * np.where(step.terminated, 0, future)
    x = np.concatenate([*step.observation, *step.action], 1)
    error = agent.critic(x)[:, 0] - goal
    agent.losses["critic"] = (error**2).mean()
    gradients, _ = agent.critic.gradients(x, 2 * error[:, None] / len(error))
    agent.critic.descend(gradients, settings.rate, settings.clip)


def _update_actor(agent, number, step, settings):
    own, count = step.observation[number], len(step.noise)
    logits = agent.actor(own)
    taken, soft = _choose(agent, logits, step.noise, settings.temperature)
    actions = [*step.action[:number], taken, *step.action[number + 1 :]]
    x = np.concatenate([*step.observation, *actions], 1)
    squares = logits[:, agent.used] ** 2
    agent.losses["actor"] = -agent.critic(x).mean() + settings.penalty * squares.mean()

    _, slope = agent.critic.gradients(x, np.full((count, 1), -1 / count))
    start = sum(part.shape[1] for part in [*step.observation, *step.action[:number]])
    slope = slope[:, start : start + taken.shape[1]]
    slope = soft * (slope - (soft * slope).sum(1, keepdims=True)) / settings.temperature
    slope = slope + settings.penalty * 2 * logits * agent.used / squares.size
    gradients, _ = agent.actor.gradients(own, slope)
    agent.actor.descend(gradients, settings.rate, settings.clip)


def _choose(agent, logits, noise, temperature):
    """The weights shown to critics, and those of the Gumbel-softmax behind them."""
    heat = np.where(agent.used, (logits + noise) / temperature, -np.inf)
    soft = np.exp(heat - heat.max(1, keepdims=True))
    soft = soft / soft.sum(1, keepdims=True)
    return (np.eye(len(agent.used))[soft.argmax(1)] if agent.hard else soft), soft
