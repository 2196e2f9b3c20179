"""A stochastic policy and the critic that judges it."""

from collections.abc import Mapping
from math import sqrt
from types import MappingProxyType
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Key

from ethogram.core.spaces import Space
from ethogram.learners.action_distributions import deviation_count
from ethogram.learners.networks import (
    MLP,
    Activation,
    DrawWeights,
    feature_count,
    glorot_uniform,
    orthogonal,
    used_features,
)


class Initialization(NamedTuple):
    """How first weights are drawn, and the gains of the layers."""

    draw: DrawWeights
    hidden: float
    actor: float  # of its last layer
    critic: float  # of its last layer


INITIALIZATIONS: Mapping[str, Initialization] = MappingProxyType(
    {
        "glorot_uniform": Initialization(glorot_uniform, 1.0, 1.0, 1.0),
        "orthogonal": Initialization(orthogonal, sqrt(2), 0.01, 1.0),
    }
)


class Architecture(NamedTuple):
    """The form of a policy's networks, and of their first weights."""

    hidden: tuple[int, ...]  # widths
    activation: Activation
    initialization: Initialization
    shared_trunk: bool  # one set of hidden layers for actor and critic


class PolicyNetwork(eqx.Module):
    """Actor and critic, on a trunk that they share or each with hidden layers of its own."""

    trunk: MLP | None
    actor: MLP
    critic: MLP
    log_std: Float[Array, "number"]  # of actions that are made of numbers

    @classmethod
    def init(
        cls,
        key: Key[Array, ""],
        observation: Bool[Array, "feature"],
        judged: Bool[Array, "input"],
        action: Space,
        architecture: Architecture,
    ) -> "PolicyNetwork":
        """A policy that has learned nothing; the deviations of its actions are 1.

        Args:
            key: consumed.
            observation: which inputs of the actor are used.
            judged: which inputs of the critic are used; with a shared trunk it has the actor's.
            action: the space of actions.
            architecture: the form of the networks.

        """
        hidden, activation, initial, shared_trunk = architecture

        def draw(
            key: Key[Array, ""],
            inputs: Bool[Array, "in"],
            outputs: Bool[Array, "out"],
            gain: float,
            hidden: tuple[int, ...],
        ) -> MLP:
            return MLP.init(
                key,
                inputs,
                hidden,
                outputs,
                activation=activation,
                draw=initial.draw,
                hidden_gain=initial.hidden,
                gain=gain,
            )

        for_trunk, for_actor, for_critic = jax.random.split(key, 3)
        trunk, own = None, hidden
        if shared_trunk:
            features, own = jnp.ones(hidden[-1], bool), ()
            trunk = draw(for_trunk, observation, features, initial.hidden, hidden[:-1])
            observation = judged = features
        return cls(
            trunk,
            draw(for_actor, observation, used_features(action), initial.actor, own),
            draw(for_critic, judged, jnp.ones(1, bool), initial.critic, own),
            jnp.zeros(deviation_count(action)),
        )

    @staticmethod
    def numbers(inputs: int, judged: int, action: Space, architecture: Architecture) -> int:
        """How many numbers a network has with so many inputs of its actor and of its critic."""
        hidden, outputs = architecture.hidden, feature_count(action)
        count = MLP.numbers(inputs, hidden, outputs) + deviation_count(action)
        if architecture.shared_trunk:
            return count + MLP.numbers(hidden[-1], (), 1)
        return count + MLP.numbers(judged, hidden, 1)

    def __call__(
        self, observation: Float[Array, "*batch feature"], judged: Float[Array, "*batch input"]
    ) -> tuple[Float[Array, "*batch output"], Float[Array, "*batch"]]:
        """What distributions of actions are made of, and the value.

        Args:
            observation: encoded, what the actor reads.
            judged: what the critic reads; with a shared trunk it reads what the actor does.

        """
        if self.trunk is not None:
            observation = judged = self.trunk.activation(self.trunk(observation))
        return self.actor(observation), self.critic(judged)[..., 0]
