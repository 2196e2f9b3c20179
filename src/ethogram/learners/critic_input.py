"""The input of a central critic: what all agents of all roles observe, then what all of them do.

Roles come in alphabetical order, as trees of arrays keep them.
"""

from collections.abc import Mapping, Sequence

import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float

from ethogram.core.world import PerRole, Role
from ethogram.learners.networks import MLP, feature_count, features, used_features

Roles = Mapping[str, Role]


def encode_observations(roles: Roles, observation: PerRole) -> PerRole:
    """Observations as numbers for a network: Float[..., agents, feature] per role."""
    return {name: features(roles[name].observation, observation[name]) for name in sorted(roles)}


def encode_actions(roles: Roles, action: PerRole) -> PerRole:
    """Actions as numbers for a network: Float[..., agents, feature] per role."""
    return {name: features(roles[name].action, action[name]) for name in sorted(roles)}


def critic_input(observation: PerRole, action: PerRole) -> Float[Array, "batch input"]:
    """Encoded observations and actions of all agents next to each other."""
    parts = [part[name] for part in (observation, action) for name in sorted(part)]
    return jnp.concatenate([part.reshape(len(part), -1) for part in parts], -1)


def joint_observation(observation: PerRole) -> Float[Array, "*batch input"]:
    """Encoded observations of all agents, Float[*batch, agent, feature] per role, in one row."""
    parts = [observation[name] for name in sorted(observation)]
    return jnp.concatenate([part.reshape(*part.shape[:-2], -1) for part in parts], -1)


def used_joint_observation(roles: Roles) -> Bool[Array, "input"]:
    """Which entries of `joint_observation` can be other than zero."""
    ordered = [roles[name] for name in sorted(roles)]
    return jnp.concatenate(
        [jnp.tile(used_features(role.observation), role.agents) for role in ordered]
    )


def used_inputs(roles: Roles) -> Bool[Array, "input"]:
    """Which entries of `critic_input` can be other than zero."""
    ordered = [roles[name] for name in sorted(roles)]
    actions = [jnp.tile(used_features(role.action), role.agents) for role in ordered]
    return jnp.concatenate([used_joint_observation(roles), *actions])


def input_count(roles: Roles) -> int:
    """How many entries `critic_input` has."""
    return sum(
        role.agents * (feature_count(role.observation) + feature_count(role.action))
        for role in roles.values()
    )


def network_sizes(roles: Roles, role: str, hidden: Sequence[int]) -> tuple[int, int]:
    """How many numbers an actor of a role has, and its critic, with these hidden layers."""
    own = roles[role]
    actor = MLP.numbers(feature_count(own.observation), hidden, feature_count(own.action))
    return actor, MLP.numbers(input_count(roles), hidden, 1)


def own_action(roles: Roles, role: str, agent: int) -> slice:
    """Where an agent's action stands in `critic_input`."""
    before = sum(each.agents * feature_count(each.observation) for each in roles.values())
    before += sum(
        roles[name].agents * feature_count(roles[name].action)
        for name in sorted(roles)
        if name < role
    )
    width = feature_count(roles[role].action)
    return slice(before + agent * width, before + (agent + 1) * width)


def value_with_action(
    critic: MLP,
    row: Float[Array, "batch input"],
    own: slice,
    action: Float[Array, "batch feature"],
) -> Float[Array, "batch"]:
    """What a critic says of `critic_input` in which an agent's action is another.

    The gradient in the action goes through the columns of the own action only: the product of the
    rest with the first layer's weights does not depend on it.

    Args:
        critic: with one output.
        row: the input.
        own: where the agent's action stands in it (`own_action`).
        action: encoded, the other one.

    """
    change = action - row[:, own]
    return critic.from_first(row @ critic.weights[0] + change @ critic.weights[0][own])[:, 0]
