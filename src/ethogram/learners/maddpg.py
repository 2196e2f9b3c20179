"""Multi-agent deep deterministic policy gradient, MADDPG (Lowe et al., NeurIPS 2017).

Every agent has an actor, which reads what the agent observes, and a critic, which reads what all
agents observe and do.  For agent i, minibatch D, critic Q, actor mu and targets Q', mu':

    y      = r_i + gamma Q'_i(o', mu'_1(o'_1), ..., mu'_n(o'_n))
    critic:  minimise E_D (Q_i(o, a_1, ..., a_n) - y)^2
    actor:   minimise E_D -Q_i(o, a_1, ..., mu_i(o_i), ..., a_n) + penalty x mean squared logit
    targets: (Q', mu') <- (1 - tau) (Q', mu') + tau (Q, mu)

Choices are made differentiable by the Gumbel-softmax, and are all that explores; actors of `Box`
actions are deterministic and explore by Gaussian noise (`ethogram.learners.action_heads`).  A world
with `Simplex` actions gets weights of choices, one with `Discrete` actions the heaviest choice.

`PRESETS["thesis"]`, the default, is Table 2.1 of the thesis and, where that is silent, what the
paper's authors published: agents learn after every 100 steps, once the replay buffer holds 25
minibatches; in order, each with a minibatch of its own; targets with first weights of their own;
every array's gradient clipped to norm 0.5.  `PRESETS["tuned"]` says beside each setting what it
changes.

Deviations from the original program, and why:

- The policy is fixed between updates, so the episodes played there run side by side.  This changes
  nothing but the order of random draws; it asks that learning comes after whole episodes.
- The replay buffer keeps states and computes the rest again, where that takes less memory.
- Where actions are `Discrete`, critics read what was done, as one-hot vectors, and the gradient
  passes straight through; the original shows them the weights that the world never saw.
- Learning begins one play later: an update begins by playing.
- Adam adds its epsilon after the correction of bias, as its paper does, TensorFlow's before.
- A choice or an input that is padding (`ethogram.core.spaces`) has no part in anything.
- Minibatches have 512 transitions (Table 2.1), the program's 1024.
- `final_learning_rate`, temperatures, `annealing_updates`, `updates_per_iteration`, `copy_targets`
  and `straight_through` exist, for `tuned`; in the preset `thesis` they do what the program does.

Agents are unrolled.  As an array axis of one role's networks (a `vmap`, or a `scan` with one agent
at a time) they are as fast on one core: gradients of 2 agents take 598 against 553 us, of 4 agents
1419 against 1527 us, at 512 transitions.  But XLA then rounds Adam's moments otherwise (7e-8 after
two updates), and no run would be the one that was published.

An episode ends for all agents at once: what follows an agent's own end is not known here, unless
the world says that it is not `acting`, of which nothing is learned.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float, Int, Key
from pydantic import Field

from ethogram.core.batching import in_any_copy
from ethogram.core.errors import InvalidSettings
from ethogram.core.memory import readable_bytes, require_memory
from ethogram.core.module import Module
from ethogram.core.rollout import Policy
from ethogram.core.settings import Count, Fraction, Number, Positive, setting
from ethogram.core.spaces import Box, Space
from ethogram.core.specs import role_specs
from ethogram.core.world import PerRole, World
from ethogram.learners.action_heads import (
    HEADS,
    decoded_action,
    encoded_action,
    outputs_of_actors,
    require_head,
    with_noise,
)
from ethogram.learners.actor_critic import (
    Agent,
    Agents,
    UpdateRule,
    agent_bytes,
    minibatch,
    new_agents,
    update_agent,
)
from ethogram.learners.base import Metrics, Spaces
from ethogram.learners.critic_input import encode_observations, network_sizes, own_action
from ethogram.learners.episodes import episode_returns, play_episodes, role_keys
from ethogram.learners.replay_buffer import Experience, ReplayBuffer, TransitionLayout
from ethogram.learners.schedules import Linear

PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "thesis": {},
        "tuned": {
            "discount": 0.85,  # an effect is felt within a few steps: less noise to learn from
            "copy_targets": True,
            "batch_size": 256,  # smaller,
            "updates_per_iteration": 4,  # and many more of them
            "learning_rate": 5e-3,  # and falls on the way
            "final_learning_rate": 3e-4,
            "annealing_updates": 20_000.0,  # all updates of 20 000 episodes
        },
    }
)


class MADDPGState(eqx.Module):
    """The agents of each role, and the replay buffer they share."""

    agents: Agents
    replay_buffer: ReplayBuffer
    updates: Int[Array, ""]  # of each agent's networks so far


class MADDPG(Module):
    """MADDPG in a world given by the caller, whose actions are `Discrete`, `Simplex` or `Box`.

    Roles that are not to learn are given a policy by `ethogram.core.wrappers.GivenPolicies`.

    Attributes:
        world: where it learns.
        discount: gamma, from 0 to 1.
        learning_rate: of Adam, at first; above 0.
        final_learning_rate: after `annealing_updates`; above 0.
        temperature: of the Gumbel-softmax, at first; above 0.
        final_temperature: after `annealing_updates`; above 0.
        annealing_updates: from first to final values, in equal steps; above 0.
        tau: by what share target networks move in an update, from 0 to 1.
        max_gradient_norm: to which the gradient of each array is scaled down; above 0.
        logit_penalty: lambda, of the mean square of an actor's outputs; 0 or more.
        exploration_noise: standard deviation of noise on `Box` actions, in halves of the distance
            of their bounds; 0 or more.
        batch_size: transitions in a minibatch, from 1 to 1 000 000.
        buffer_size: transitions kept, those of one play or more, up to 2^30.
        learning_starts: transitions played before anything is learned, 0 or more; `buffer_size` if
            that is less.
        episodes_per_update: played before agents learn, from 1 to 100 000.
        updates_per_iteration: of each agent's networks after that, from 1 to 10 000.
        hidden_size: units in each of the two hidden layers, from 1 to 100 000.
        copy_targets: whether target networks begin as copies; else with first weights of their own.
        straight_through: whether `Simplex` actions, too, are pure choices with the gradient of the
            weights.

    """

    spaces: ClassVar[Spaces] = Spaces(action=HEADS)
    undefined_metrics: ClassVar[frozenset[str]] = frozenset({"critic_loss", "actor_loss"})

    world: World
    discount: Number = setting(0.95, Fraction)
    learning_rate: Number = setting(1e-2, Positive)  # at first
    final_learning_rate: Number = setting(1e-2, Positive)
    temperature: Number = setting(1.0, Positive)  # of the Gumbel-softmax, at first
    final_temperature: Number = setting(1.0, Positive)
    annealing_updates: Number = setting(1.0, Positive)  # from first to final values
    tau: Number = setting(0.01, Fraction)
    max_gradient_norm: Number = setting(0.5, Positive)  # of an array's gradient
    logit_penalty: Number = setting(1e-3, Annotated[float, Field(ge=0)])  # of the mean square
    exploration_noise: Number = setting(0.1, Annotated[float, Field(ge=0)])  # of boxes, see there
    batch_size: int = setting(512, Count, static=True)
    buffer_size: int = setting(1_000_000, Annotated[int, Field(ge=1, le=2**30)], static=True)
    learning_starts: int = setting(12_800, Annotated[int, Field(ge=0)], static=True)  # transitions
    episodes_per_update: int = setting(4, Annotated[int, Field(ge=1, le=100_000)], static=True)
    updates_per_iteration: int = setting(1, Annotated[int, Field(ge=1, le=10_000)], static=True)
    hidden_size: int = setting(64, Annotated[int, Field(ge=1, le=100_000)], static=True)  # of 2
    copy_targets: bool = setting(False, bool, static=True)
    straight_through: bool = setting(False, bool, static=True)

    def __check_init__(self) -> None:
        """Refuse a buffer too small, and a world that the learner cannot act in.

        Raises:
            InvalidSettings: one play would not fit in the buffer.
            EthogramError: a role's actions are no choices and no bounded box.

        """
        played = self.episodes_per_update * self.world.horizon
        if self.buffer_size < played:
            raise InvalidSettings(
                f"MADDPG: buffer_size = {self.buffer_size} has no room for the {played} "
                f"transitions of episodes_per_update = {self.episodes_per_update} of "
                f"{self.world.horizon} steps."
            )
        for name, role in self.world.roles.items():
            require_head("MADDPG", name, role.action)

    @property
    def replay_bytes(self) -> int:
        """Memory that the transitions kept need."""
        return 4 * self._layout.row_width * self.buffer_size

    @property
    def network_bytes(self) -> int:
        """Memory that the agents need: all networks, their targets, and what Adam remembers."""
        roles = role_specs(self.world)
        return sum(
            role.agents * agent_bytes(*network_sizes(roles, name, self._hidden))
            for name, role in roles.items()
        )

    def init(self, key: Key[Array, ""]) -> MADDPGState:
        """New agents, and an empty replay buffer.

        Raises:
            TooLarge: networks and replay buffer would not fit in memory; the message names the
                sizes.

        """
        require_memory(
            f"MADDPG with {readable_bytes(self.network_bytes)} of networks and a replay buffer of "
            f"{self.buffer_size:,} transitions ({readable_bytes(self.replay_bytes)})",
            self.network_bytes + self.replay_bytes,
        )
        replay_buffer = ReplayBuffer.empty(self._layout.row_width, self.buffer_size)
        agents = new_agents(key, self.world.roles, self._hidden, copy_targets=self.copy_targets)
        return MADDPGState(agents, replay_buffer, jnp.int32(0))

    def update(self, key: Key[Array, ""], state: MADDPGState) -> tuple[MADDPGState, Metrics]:
        """Play some episodes, then learn, once the replay buffer holds enough transitions.

        Args:
            key: consumed.
            state: agents and replay buffer; donate them (`ethogram.learners.train` does).

        Returns:
            The state after, and metrics: `episode_return` of the `episodes_per_update` episodes,
            Float[episode, agent] per role, and the means over `updates_per_iteration` of
            `critic_loss` and `actor_loss`, Float[agent] per role, NaN as long as nothing is
            learned.  (A loss that is no number is given as infinite.)

        """
        enough = min(self.learning_starts, self.buffer_size)
        learns = in_any_copy(state.replay_buffer.added >= enough)
        for_play, for_learning = jax.random.split(key)
        for_play = jnp.where(learns, for_play, key)
        played = play_episodes(
            self.world, self.policy(state, explore=True), for_play, self.episodes_per_update
        )
        rows = self._layout.pack(played)
        replay_buffer = state.replay_buffer.add(rows.reshape(-1, rows.shape[-1]))
        agents, updates, losses = lax.cond(
            learns,
            lambda *at: self._learn(for_learning, *at),
            self._wait,
            *(state.agents, replay_buffer, state.updates),
        )
        metrics = {"episode_return": episode_returns(played), **losses}
        return MADDPGState(agents, replay_buffer, updates), metrics

    def policy(self, state: MADDPGState, *, explore: bool = False) -> Policy:
        """How the agents act in one world.

        Exploring, choices are drawn, and boxes have noise; otherwise weights are the softmax of the
        logits, choices those of the largest, and boxes without noise.
        """
        temperature = self._temperature(state.updates)

        def act(key: Key[Array, ""], observation: PerRole) -> PerRole:
            outputs = self.actor_outputs(state, observation)
            roles, action = self.world.roles, {}
            for name, for_role in role_keys(roles, key).items():
                space = roles[name].action
                drawn = for_role if explore else None
                encoded = self._encoded(space, drawn, outputs[name], temperature)
                if explore and isinstance(space, Box):
                    encoded = with_noise(space, for_role, encoded, self.exploration_noise)
                action[name] = decoded_action(space, encoded)
            return action

        return act

    def actor_outputs(self, state: MADDPGState, observation: PerRole) -> PerRole:
        """What each agent's actor makes of its observation: Float[agents, output] per role.

        The softmax of an agent's logits is the chance of each choice to be the heaviest.
        """
        encoded = encode_observations(self.world.roles, observation)
        return {
            role: outputs_of_actors(
                self.world.roles[role].action, [agent.actor for agent in agents], encoded[role]
            )
            for role, agents in state.agents.items()
        }

    @property
    def _layout(self) -> TransitionLayout:
        return TransitionLayout(self.world)

    @property
    def _hidden(self) -> tuple[int, int]:
        return self.hidden_size, self.hidden_size

    def _temperature(self, updates: Int[Array, ""]) -> Float[Array, ""]:
        return Linear(self.temperature, self.final_temperature, self.annealing_updates)(updates)

    def _encoded(
        self, space: Space, key: Key[Array, ""] | None, outputs: Array, temperature: Number
    ) -> Array:
        """Actions as critics read them."""
        return encoded_action(
            space, key, outputs, temperature, straight_through=self.straight_through
        )

    def _wait(
        self, agents: Agents, replay_buffer: ReplayBuffer, updates: Int[Array, ""]
    ) -> tuple[Agents, Int[Array, ""], Metrics]:
        """Learn nothing yet."""
        del replay_buffer
        undefined = {role: jnp.full(len(each), jnp.nan) for role, each in agents.items()}
        return agents, updates, {"critic_loss": undefined, "actor_loss": undefined}

    def _learn(
        self,
        key: Key[Array, ""],
        agents: Agents,
        replay_buffer: ReplayBuffer,
        updates: Int[Array, ""],
    ) -> tuple[Agents, Int[Array, ""], Metrics]:
        """Update all agents `updates_per_iteration` times."""

        def learn(
            at: tuple[Agents, Int[Array, ""]], key: Key[Array, ""]
        ) -> tuple[tuple[Agents, Int[Array, ""]], Metrics]:
            agents, losses = self._update_agents(key, at[0], replay_buffer, at[1])
            return (agents, at[1] + 1), losses

        keys = jax.random.split(key, self.updates_per_iteration)
        (agents, updates), losses = lax.scan(learn, (agents, updates), keys)
        losses = jax.tree.map(lambda loss: _infinite_if_nan(loss.mean(0)), losses)
        return agents, updates, losses

    def _update_agents(
        self,
        key: Key[Array, ""],
        agents: Agents,
        replay_buffer: ReplayBuffer,
        updates: Int[Array, ""],
    ) -> tuple[Agents, Metrics]:
        """One update of each agent, in order: each sees the targets of those before it."""
        now = {name: list(ones) for name, ones in agents.items()}
        losses: dict[str, dict[str, list[Array]]] = {"critic_loss": {}, "actor_loss": {}}
        roles, temperature, rule = self.world.roles, self._temperature(updates), self._rule(updates)
        for name, for_role in role_keys(roles, key).items():
            space = roles[name].action
            for i, agent in enumerate(now[name]):
                for_batch, for_actor = jax.random.split(jax.random.fold_in(for_role, i))
                drawn, next_action = self._draw(for_batch, replay_buffer, now, temperature)
                batch = minibatch(roles, drawn, next_action, name, i)
                choose = partial(self._encoded, space, for_actor, temperature=temperature)
                own = own_action(roles, name, i)
                now[name][i], lost = update_agent(agent, batch, space, own, choose, rule)
                for kind, loss in lost.items():
                    losses[kind].setdefault(name, []).append(loss)
        return {name: tuple(ones) for name, ones in now.items()}, {
            kind: {name: jnp.stack(each) for name, each in per_role.items()}
            for kind, per_role in losses.items()
        }

    def _rule(self, updates: Int[Array, ""]) -> UpdateRule:
        schedule = Linear(self.learning_rate, self.final_learning_rate, self.annealing_updates)
        return UpdateRule(
            learning_rate=schedule(updates),
            max_gradient_norm=self.max_gradient_norm,
            discount=self.discount,
            logit_penalty=self.logit_penalty,
            tau=self.tau,
        )

    def _draw(
        self,
        key: Key[Array, ""],
        replay_buffer: ReplayBuffer,
        agents: Mapping[str, Sequence[Agent]],
        temperature: Number,
    ) -> tuple[Experience, PerRole]:
        """Transitions from the replay buffer, and what the target actors would do after them."""
        for_rows, for_targets = jax.random.split(key)
        drawn = self._layout.unpack(replay_buffer.draw(for_rows, self.batch_size))
        roles, next_action = self.world.roles, {}
        next_observation = encode_observations(roles, drawn.next_observation)
        for name, for_role in role_keys(roles, for_targets).items():
            space, actors = roles[name].action, [agent.target_actor for agent in agents[name]]
            outputs = outputs_of_actors(space, actors, next_observation[name])
            next_action[name] = self._encoded(space, for_role, outputs, temperature)
        return drawn, next_action


def _infinite_if_nan(loss: Float[Array, "agent"]) -> Float[Array, "agent"]:
    """Losses, where NaN stands for nothing learned."""
    return jnp.where(jnp.isnan(loss), jnp.inf, loss)
