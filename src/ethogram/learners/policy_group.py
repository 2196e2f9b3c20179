"""The policies of all roles of a world: one for all agents of a role, or one for each.

Networks of a role are stacked: the leading axis of what a role has learned counts its policies.
"""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Key, Shaped

from ethogram.core.spaces import Box
from ethogram.core.world import PerRole
from ethogram.learners.critic_input import (
    Roles,
    encode_observations,
    joint_observation,
    used_joint_observation,
)
from ethogram.learners.networks import feature_count, features, used_features
from ethogram.learners.optimisation import Moments, no_moments
from ethogram.learners.policy_network import Architecture, PolicyNetwork
from ethogram.learners.running_statistics import RunningStatistics

LARGEST_FEATURE = 10.0  # of a normalised observation


class Learned(eqx.Module):
    """What the policies of a role have learned; the leading axis counts them."""

    network: PolicyNetwork
    moments: Moments
    kl_coefficient: Float[Array, "policy"]  # beta
    observation: RunningStatistics | None  # of each feature, where they are normalised
    running_return: RunningStatistics | None  # where returns are normalised


class PolicyGroup(NamedTuple):
    """Who decides, and what critics read."""

    roles: Roles
    shared: bool  # one policy for all agents of a role
    central_critic: bool

    def policies(self, role: str) -> int:
        """How many policies a role has."""
        return 1 if self.shared else self.roles[role].agents

    def init(
        self,
        key: Key[Array, ""],
        role: str,
        architecture: Architecture,
    ) -> tuple[PolicyNetwork, Moments]:
        """Stacked networks that have learned nothing, and the moments of each."""
        space = self.roles[role].action
        observation = used_features(self.roles[role].observation)
        judged = [observation]
        if self.central_critic:
            judged.append(used_joint_observation(self.roles))

        def one(key: Key[Array, ""]) -> tuple[PolicyNetwork, Moments]:
            network = PolicyNetwork.init(
                key, observation, jnp.concatenate(judged), space, architecture
            )
            return network, no_moments(network)

        return jax.vmap(one)(jax.random.split(key, self.policies(role)))

    def numbers(self, role: str, architecture: Architecture) -> int:
        """How many numbers the networks of a role have together."""
        own = feature_count(self.roles[role].observation)
        everyone = sum(
            each.agents * feature_count(each.observation) for each in self.roles.values()
        )
        judged = own + everyone if self.central_critic else own
        action = self.roles[role].action
        return self.policies(role) * PolicyNetwork.numbers(own, judged, action, architecture)

    def judge(self, learned: dict[str, Learned], observation: PerRole) -> tuple[PerRole, PerRole]:
        """Outputs of the actors, Float[agent, output], and values, Float[agent], per role."""
        encoded = self._encoded(learned, observation)
        outputs, value = {}, {}
        for name, own in encoded.items():
            judged = own
            if self.central_critic:
                joint = joint_observation(encoded)
                joint = jnp.broadcast_to(joint, (len(own), joint.size))
                judged = jnp.concatenate([own, joint], -1)
            axis = 0 if self.shared else 1
            read = [jnp.expand_dims(part, axis) for part in (own, judged)]
            found = jax.vmap(lambda network, *read: network(*read))(learned[name].network, *read)
            outputs[name], value[name] = (part.squeeze(axis) for part in found)
        return outputs, value

    def read(
        self,
        learned: dict[str, Learned],
        role: str,
        policy: Array,
        observation: PerRole,
        row: Array,
        agent: Array,
    ) -> tuple[Float[Array, "batch feature"], Float[Array, "batch input"]]:
        """What an actor of a role, and its critic, read in some steps.

        Args:
            learned: of all roles.
            role: whose.
            policy: its number in the role.
            observation: per role, with axes of rows and agents.
            row: of each step.
            agent: of each step.

        """
        own = features(self.roles[role].observation, observation[role][row, agent])
        statistics = learned[role].observation
        if statistics is not None:
            one = jax.tree.map(lambda part: part[policy], statistics)
            own = one.normalized(own, LARGEST_FEATURE)
        if not self.central_critic:
            return own, own
        everyone = {name: each[row] for name, each in observation.items()}
        joint = joint_observation(self._encoded(learned, everyone))
        return own, jnp.concatenate([own, joint], -1)

    def by_policy(
        self, values: Shaped[Array, "row agent *each"]
    ) -> Shaped[Array, "sample policy *each"]:
        """What each policy has to learn from."""
        return values.reshape(-1, 1, *values.shape[2:]) if self.shared else values

    def with_returns(
        self,
        learned: Learned,
        returns: Float[Array, "row agent"],
        acting: Bool[Array, "row agent"],
    ) -> Learned:
        """With running statistics that have seen the returns of an update, too."""
        assert learned.running_return is not None
        seen = learned.running_return.after(self.by_policy(returns), self.by_policy(acting))
        return dataclasses.replace(learned, running_return=seen)

    def statistics_after(
        self, learned: Learned, role: str, observation: Array, counted: Bool[Array, "row agent"]
    ) -> RunningStatistics | None:
        """The statistics of a role's observations that have seen those of an update, too."""
        if learned.observation is None:
            return None
        seen = self.by_policy(features(self.roles[role].observation, observation))
        counts = self.by_policy(counted)[..., None]
        return learned.observation.after(seen, jnp.broadcast_to(counts, seen.shape))

    def no_statistics(self, role: str) -> RunningStatistics | None:
        """Statistics of observations of which none was seen; none, unless they are boxes."""
        space = self.roles[role].observation
        if not isinstance(space, Box):
            return None
        return RunningStatistics.of_nothing(self.policies(role), feature_count(space))

    def _encoded(self, learned: dict[str, Learned], observation: PerRole) -> PerRole:
        """Observations as networks read them: Float[*batch, agent, feature] per role."""
        encoded = encode_observations(self.roles, observation)
        for name, own in encoded.items():
            statistics = learned[name].observation
            if statistics is not None:
                encoded[name] = statistics.normalized(own, LARGEST_FEATURE)
        return encoded
