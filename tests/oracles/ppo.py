"""PPO as its papers state it, step by step in plain NumPy; gradients by finite differences."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

STEP = 1e-6  # of a finite difference


class Steps(NamedTuple):
    """What is learned from, in double precision."""

    observation: np.ndarray
    judged: np.ndarray  # what the critic reads
    drawn: np.ndarray
    outputs: np.ndarray  # of the actor that drew it
    value: np.ndarray  # what the critic said then
    advantage: np.ndarray
    target: np.ndarray
    counted: np.ndarray


@dataclass
class Networks:
    """Dense layers with tanh between them: `arrays` are those of the trunk, actor and critic."""

    trunk: list  # of (weights, bias), with tanh after the last, too; none if there is no trunk
    actor: list
    critic: list
    log_std: np.ndarray

    @classmethod
    def of(cls, network):
        """Those of a `PolicyNetwork`, in double precision."""

        def layers(mlp):
            if mlp is None:
                return []
            pairs = zip(mlp.weights, mlp.biases, strict=True)
            return [(np.array(w, float), np.array(b, float)) for w, b in pairs]

        return cls(
            layers(network.trunk),
            layers(network.actor),
            layers(network.critic),
            np.array(network.log_std, float),
        )

    def arrays(self):
        parts = self.trunk, self.actor, self.critic
        layers = [array for part in parts for layer in part for array in layer]
        return [*layers, self.log_std]

    def __call__(self, observation, judged):
        for weight, bias in self.trunk:
            observation = judged = np.tanh(observation @ weight + bias)
        return feed(self.actor, observation), feed(self.critic, judged)[..., 0]


def feed(layers, x):
    for number, (weight, bias) in enumerate(layers):
        x = (np.tanh(x) if number else x) @ weight + bias
    return x


def log_softmax(x):
    x = x - x.max(-1, keepdims=True)
    return x - np.log(np.exp(x).sum(-1, keepdims=True))


def choices(sizes, outputs):
    return [log_softmax(part) for part in np.split(outputs, np.cumsum(sizes)[:-1], -1)]


def log_prob(sizes, outputs, log_std, drawn):
    """Of choices of these sizes; of Gaussian numbers, if there are no sizes."""
    if sizes is None:
        z = (drawn - outputs) / np.exp(log_std)
        return (-(z**2) / 2 - log_std - np.log(2 * np.pi) / 2).sum(-1)
    rows = np.arange(len(drawn))
    return sum(p[rows, drawn[:, i]] for i, p in enumerate(choices(sizes, outputs)))


def entropy(sizes, outputs, log_std):
    if sizes is None:
        return np.full(len(outputs), (log_std + np.log(2 * np.pi * np.e) / 2).sum())
    return -sum((np.exp(p) * p).sum(-1) for p in choices(sizes, outputs))


def kl(sizes, old, old_log_std, new, log_std):
    if sizes is None:
        ratio = np.exp(2 * (old_log_std - log_std)) + ((old - new) / np.exp(log_std)) ** 2
        return (log_std - old_log_std + (ratio - 1) / 2).sum(-1)
    pairs = zip(choices(sizes, old), choices(sizes, new), strict=True)
    return sum((np.exp(p) * (p - q)).sum(-1) for p, q in pairs)


def loss(networks, batch, old_log_std, sizes, objective):
    """Of the steps of a minibatch."""
    total, count = 0.0, batch.counted.sum()
    outputs, value = networks(batch.observation, batch.judged)
    new = log_prob(sizes, outputs, networks.log_std, batch.drawn)
    old = log_prob(sizes, batch.outputs, old_log_std, batch.drawn)
    spread = entropy(sizes, outputs, networks.log_std)
    moved = kl(sizes, batch.outputs, old_log_std, outputs, networks.log_std)
    for i in np.flatnonzero(batch.counted):
        ratio, advantage = np.exp(new[i] - old[i]), batch.advantage[i]
        kept = min(max(ratio, 1 - objective.clip), 1 + objective.clip)
        total -= min(ratio * advantage, kept * advantage)
        error = (value[i] - batch.target[i]) ** 2
        if objective.value_clip:
            change = np.clip(value[i] - batch.value[i], -objective.value_clip, objective.value_clip)
            error = max(error, (batch.value[i] + change - batch.target[i]) ** 2)
        total += objective.value_coefficient * error
        total -= objective.entropy_coefficient * spread[i]
        total += objective.kl_coefficient * moved[i]
    return total / count


def gradient(networks, *rest):
    """Of the loss, for every array of the networks."""
    found = []
    for array in networks.arrays():
        slope = np.zeros_like(array)
        for place in np.ndindex(array.shape):
            start, ends = array[place], []
            for move in (STEP, -STEP):
                array[place] = start + move
                ends.append(loss(networks, *rest))
            array[place] = start
            slope[place] = (ends[0] - ends[1]) / (2 * STEP)
        found.append(slope)
    return found


def advantages(reward, value, next_value, terminated, cut, acting, discount, gae_lambda):
    """Of one agent, each as a sum over the steps that follow in which it acts, forward in time."""
    steps = len(reward)
    found = np.zeros(steps)
    for first in np.flatnonzero(acting):
        at, weight = first, 1.0
        while at is not None:
            earned, factor, step = 0.0, 1.0, at
            while True:  # until it acts again, or all is over
                earned += factor * reward[step]
                factor *= discount
                if terminated[step]:
                    future, after = 0.0, None
                elif cut[step] or step == steps - 1:
                    future, after = next_value[step], None
                elif acting[step + 1]:
                    future, after = value[step + 1], step + 1
                else:
                    step += 1
                    continue
                break
            found[first] += weight * (earned + factor * future - value[at])
            weight *= factor * gae_lambda
            at = after
    return found
