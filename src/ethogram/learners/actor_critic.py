"""An agent with an actor, a critic, and slow copies of both; how a minibatch improves them."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jax import Array
from jaxtyping import Bool, Float, Key

from ethogram.core.settings import Number
from ethogram.core.spaces import Space
from ethogram.core.world import PerRole
from ethogram.learners.action_heads import outputs_of_actors
from ethogram.learners.critic_input import (
    Roles,
    critic_input,
    encode_actions,
    encode_observations,
    used_inputs,
    value_with_action,
)
from ethogram.learners.episodes import role_keys
from ethogram.learners.losses import critic_loss, deterministic_policy_loss
from ethogram.learners.networks import MLP, used_features
from ethogram.learners.optimisation import Moments, clip_each_norm, descend, no_moments
from ethogram.learners.replay_buffer import Experience
from ethogram.learners.returns import td_target

Losses = dict[str, Array]  # by name


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


Agents = dict[str, tuple[Agent, ...]]  # per role


def agent_bytes(actor: int, critic: int) -> int:
    """Memory of an agent whose networks have so many numbers: each, its target, two moments."""
    return 4 * 4 * (actor + critic)


def new_agents(
    key: Key[Array, ""], roles: Roles, hidden: Sequence[int], *, copy_targets: bool
) -> Agents:
    """Agents that have learned nothing, per role.

    Args:
        key: consumed.
        roles: of the world.
        hidden: widths of the hidden layers of all networks.
        copy_targets: whether targets begin as copies, instead of with weights of their own.

    """
    judged, agents = used_inputs(roles), {}
    for name, for_role in role_keys(roles, key).items():
        role = roles[name]
        used = used_features(role.observation), used_features(role.action), judged
        agents[name] = tuple(
            Agent.init(each, *used, hidden, copy_targets=copy_targets)
            for each in jax.random.split(for_role, role.agents)
        )
    return agents


class Minibatch(eqx.Module):
    """Transitions as the networks of one agent read them."""

    observation: Float[Array, "batch feature"]  # the agent's own
    critic_input: Float[Array, "batch input"]  # what all observed and did
    reward: Float[Array, "batch"]
    terminated: Bool[Array, "batch"]
    acting: Bool[Array, "batch"]
    next_critic_input: Float[Array, "batch input"]  # with what the target actors would do


def minibatch(
    roles: Roles, drawn: Experience, next_action: PerRole, name: str, number: int
) -> Minibatch:
    """What one agent learns from.

    Args:
        roles: of the world.
        drawn: transitions, as the world gave and took them.
        next_action: encoded, what the target actors would do after them.
        name: the agent's role.
        number: the agent's, within its role.

    """
    observation = encode_observations(roles, drawn.observation)
    next_observation = encode_observations(roles, drawn.next_observation)
    return Minibatch(
        observation=observation[name][:, number],
        critic_input=critic_input(observation, encode_actions(roles, drawn.action)),
        reward=drawn.reward[name][:, number],
        terminated=drawn.terminated[name][:, number],
        acting=drawn.acting[name][:, number],
        next_critic_input=critic_input(next_observation, next_action),
    )


class UpdateRule(NamedTuple):
    """By what an agent's networks move in an update."""

    learning_rate: Number  # of Adam
    max_gradient_norm: Number  # of an array's gradient
    discount: Number  # gamma
    logit_penalty: Number  # lambda
    tau: Number  # of the target networks


def update_agent(
    agent: Agent,
    batch: Minibatch,
    space: Space,
    own: slice,
    choose: Callable[[Array], Array],
    rule: UpdateRule,
) -> tuple[Agent, Losses]:
    """Update an agent's critic, then its actor by the new critic, then its targets.

    Args:
        agent: before.
        batch: what it learns from.
        space: of its actions.
        own: where its action stands in the critic's input.
        choose: from the actor's outputs to actions as critics read them, differentiable.
        rule: how far networks move.

    Returns:
        The agent after, and `critic_loss` and `actor_loss` before.

    """
    rate, largest = rule.learning_rate, rule.max_gradient_norm
    target = td_targets(agent.target_critic, batch, rule.discount)

    def loss_of_critic(critic: MLP) -> Float[Array, ""]:
        return critic_loss(critic(batch.critic_input)[:, 0], target, batch.acting)

    critic_lost, gradient = jax.value_and_grad(loss_of_critic)(agent.critic)
    gradient = clip_each_norm(gradient, largest)
    critic, critic_moments = descend(agent.critic, gradient, agent.critic_moments, rate)

    def loss_of_actor(actor: MLP) -> Float[Array, ""]:
        outputs = outputs_of_actors(space, [actor], batch.observation[:, None])[:, 0]
        value = value_with_action(critic, batch.critic_input, own, choose(outputs))
        used = used_features(space)
        return deterministic_policy_loss(value, outputs, batch.acting, used, rule.logit_penalty)

    actor_lost, gradient = jax.value_and_grad(loss_of_actor)(agent.actor)
    gradient = clip_each_norm(gradient, largest)
    actor, actor_moments = descend(agent.actor, gradient, agent.actor_moments, rate)
    return Agent(
        actor=actor,
        critic=critic,
        target_actor=optax.incremental_update(actor, agent.target_actor, rule.tau),
        target_critic=optax.incremental_update(critic, agent.target_critic, rule.tau),
        actor_moments=actor_moments,
        critic_moments=critic_moments,
    ), {"critic_loss": critic_lost, "actor_loss": actor_lost}


def td_targets(critic: MLP, batch: Minibatch, discount: Number) -> Float[Array, "batch"]:
    """What a critic should say of a minibatch: y = r + gamma Q'(o', mu'(o')).

    Args:
        critic: the target network Q'.
        batch: with what the target actors mu' would do next.
        discount: gamma.

    """
    next_value = critic(batch.next_critic_input)[:, 0]
    return td_target(batch.reward, batch.terminated, next_value, discount)  # Lowe et al., eq. 6
