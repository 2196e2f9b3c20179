"""An agent with an actor, a critic, and slow copies of both."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Key

from ethogram.learners.networks import MLP
from ethogram.learners.optimisation import Moments, no_moments


class Agent(eqx.Module):
    """What one agent has learned."""

    actor: MLP
    critic: MLP
    target_actor: MLP
    target_critic: MLP
    actor_moments: Moments
    critic_moments: Moments

    @classmethod
    def init(
        cls,
        key: Key[Array, ""],
        observation: Bool[Array, "feature"],
        choices: Bool[Array, "choice"],
        judged: Bool[Array, "input"],
        hidden: Sequence[int],
        *,
        copy_targets: bool,
    ) -> "Agent":
        """An agent that has learned nothing.

        Args:
            key: consumed.
            observation: which inputs of the actor are used.
            choices: which outputs of the actor are used.
            judged: which inputs of the critic are used.
            hidden: widths of the hidden layers of all networks.
            copy_targets: whether targets begin as copies, instead of with weights of their own.

        """
        value = jnp.ones(1, bool)
        keys = jax.random.split(key, 4)
        actor = MLP.init(keys[0], observation, hidden, choices)
        critic = MLP.init(keys[1], judged, hidden, value)
        if copy_targets:  # in buffers of their own, since none can be donated twice
            target_actor, target_critic = jax.tree.map(jnp.copy, (actor, critic))
        else:
            target_actor = MLP.init(keys[2], observation, hidden, choices)
            target_critic = MLP.init(keys[3], judged, hidden, value)
        moments = no_moments(actor), no_moments(critic)
        return cls(actor, critic, target_actor, target_critic, *moments)


def agent_bytes(actor: int, critic: int) -> int:
    """Memory of an agent whose networks have so many numbers: each, its target, two moments."""
    return 4 * 4 * (actor + critic)
