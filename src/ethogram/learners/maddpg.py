"""Multi-agent deep deterministic policy gradient, MADDPG (Lowe et al., NeurIPS 2017).

Every agent has an actor, which sees what the agent observes, and a critic, which sees what all
agents observe and do.  For agent i, minibatch D, critic Q, actor mu and targets Q', mu':

    y      = r_i + gamma Q'_i(o', mu'_1(o'_1), ..., mu'_n(o'_n))
    critic:  minimise E_D (Q_i(o, a_1, ..., a_n) - y)^2
    actor:   minimise E_D -Q_i(o, a_1, ..., mu_i(o_i), ..., a_n) + penalty x mean squared logit
    targets: (Q', mu') <- (1 - tau) (Q', mu') + tau (Q, mu)

Choices are made differentiable by the Gumbel-softmax (`ethogram.learners.exploration`): an action
is a vector of weights of choices.  A world with `Simplex` actions gets the weights, one with
`Discrete` actions the heaviest choice.

`PRESETS["thesis"]`, the default, is Table 2.1 of the thesis and, where that is silent, what the
paper's authors published: a round of updates after every 100 steps, once the memory holds 25
minibatches; agents in order, each with a minibatch of its own; targets with first weights of
their own; every array's gradient clipped to norm 0.5.  `PRESETS["tuned"]` says beside each
setting what it changes.

Deviations from the original program, and why:

- The policy is fixed between rounds, so the episodes played there run side by side.  This changes
  nothing but the order of random draws; it asks that updates come after whole episodes.
- The memory keeps states and computes the rest again (`ethogram.learners.replay`).
- Where actions are `Discrete`, critics read what was done, as one-hot vectors, and the gradient
  passes straight through; the original shows them the weights that the world never saw.
- The first round comes one play later: an update begins by playing.
- Adam adds its epsilon after the correction of bias, as its paper does, TensorFlow's before.
- A choice or an input that is padding (`ethogram.core.spaces`) has no part in anything.
- Minibatches have 512 transitions (Table 2.1), the program's 1024.
- Roles may be scripted, as the thesis' baselines need: who does not learn has no critic.
- `final_rate`, temperatures, `anneal`, `rounds`, `copy_targets` and `straight_through` exist, for
  `tuned`; in the preset `thesis` they do what the program does.

An episode ends for all agents at once: what follows an agent's own end is not known here.
"""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Annotated, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jax import Array, lax
from jaxtyping import Float, Int, Key
from pydantic import Field

from ethogram.core.errors import EthogramError, InvalidSettings, UnknownName
from ethogram.core.memory import readable_bytes, require_memory
from ethogram.core.module import Module
from ethogram.core.rollout import rollout
from ethogram.core.settings import Number, check_settings, setting
from ethogram.core.spaces import Box, Discrete, Simplex
from ethogram.core.specs import array_spec, key_spec, role_specs, state_spec
from ethogram.core.world import PerRole, World
from ethogram.learners.actor_critic import Agent, agent_bytes
from ethogram.learners.exploration import Linear, gumbel_softmax
from ethogram.learners.joint import done, joint, joint_used, network_sizes, own_action, seen
from ethogram.learners.networks import MLP, features, used_features
from ethogram.learners.optimisation import descend
from ethogram.learners.replay import Layout, Replay
from ethogram.learners.returns import one_step

Script = Callable[[Key[Array, ""], Array], Array]  # (key, a role's observations) -> its actions
Positive = Annotated[float, Field(gt=0)]

OUT_OF_REACH = -1e9  # a logit that no noise lifts

PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "thesis": {},
        "tuned": {
            "discount": 0.85,  # an effect is felt within a few steps: less noise to learn from
            "copy_targets": True,
            "batch": 256,  # smaller,
            "rounds": 4,  # and many more of them
            "warm_up": 50,
            "rate": 5e-3,  # and falls on the way
            "final_rate": 3e-4,
            "anneal": 20_000.0,  # all rounds of 20 000 episodes
        },
    }
)


class Learned(eqx.Module):
    """The agents that learn, per role, and the memory they share."""

    agents: dict[str, tuple[Agent, ...]]
    replay: Replay
    rounds: Int[Array, ""]  # of updates so far


class Batch(eqx.Module):
    """Transitions as the networks read them: per role, Float[batch, agent, feature]."""

    observation: PerRole
    action: PerRole
    reward: PerRole  # Float[batch, agent]
    terminated: PerRole  # Bool[batch, agent]
    reached: PerRole  # what was observed after
    target_action: PerRole  # what the target actors would do there


class MADDPG(Module):
    """MADDPG in a world given by the caller, whose roles choose among `Discrete` or `Simplex`.

    `init(key) -> learned`; `update(key, learned) -> (learned, metrics)` plays some episodes and
    learns; `policy(learned)` acts.  A run begins with `first_plays` updates of `Playing(learner)`.
    Roles in `scripted` follow the function given there instead of learning.
    """

    world: World
    scripted: Mapping[str, Script] = eqx.field(default_factory=dict)
    discount: Number = setting(0.95, Annotated[float, Field(ge=0, le=1)])
    rate: Number = setting(1e-2, Positive)  # of learning, at first
    final_rate: Number = setting(1e-2, Positive)
    temperature: Number = setting(1.0, Positive)  # of the Gumbel-softmax, at first
    final_temperature: Number = setting(1.0, Positive)
    anneal: Number = setting(1.0, Positive)  # rounds of updates from first to final
    tau: Number = setting(0.01, Annotated[float, Field(ge=0, le=1)])
    clip: Number = setting(0.5, Positive)  # largest norm of an array's gradient
    penalty: Number = setting(1e-3, Annotated[float, Field(ge=0)])  # of the mean squared logit
    batch: int = setting(512, Annotated[int, Field(ge=1, le=1_000_000)], static=True)
    memory: int = setting(1_000_000, Annotated[int, Field(ge=1, le=2**30)], static=True)
    warm_up: int = setting(25, Annotated[int, Field(ge=0, le=1_000_000)], static=True)  # batches
    episodes: int = setting(4, Annotated[int, Field(ge=1, le=100_000)], static=True)  # played
    rounds: int = setting(1, Annotated[int, Field(ge=1, le=10_000)], static=True)  # after them
    hidden: int = setting(64, Annotated[int, Field(ge=1, le=100_000)], static=True)  # two layers
    copy_targets: bool = setting(False, bool, static=True)
    straight_through: bool = setting(False, bool, static=True)

    def __check_init__(self) -> None:
        """Refuse settings out of range, and a world that the learner cannot act in.

        Raises:
            InvalidSettings: naming every value out of bounds; or one play would not fit in memory.
            UnknownName: a role that is scripted is none of the world's.
            EthogramError: a role that learns has actions that are no choices.

        """
        check_settings(self)
        played = self.episodes * self.world.horizon
        if self.memory < played:
            raise InvalidSettings(
                f"MADDPG: memory = {self.memory} has no room for the {played} transitions of "
                f"episodes = {self.episodes} of {self.world.horizon} steps."
            )
        roles = role_specs(self.world)
        for name in self.scripted:
            if name not in roles:
                raise UnknownName("role", name, roles)
        for name, role in roles.items():
            space = role.action
            if name not in self.scripted and not isinstance(space, Discrete | Simplex):
                raise EthogramError(
                    f"MADDPG needs actions that are Discrete or Simplex; those of {name!r} are "
                    f"{type(space).__name__}."
                )

    @property
    def learning(self) -> tuple[str, ...]:
        """The roles that learn."""
        return tuple(role for role in role_specs(self.world) if role not in self.scripted)

    @property
    def first_plays(self) -> int:
        """How often to `play` before the first `update`, so that the memory holds `warm_up`."""
        return -(-self.warm_up * self.batch // (self.episodes * self.world.horizon))

    @property
    def replay_bytes(self) -> int:
        """Memory that the transitions kept need."""
        return 4 * self._layout.words * self.memory

    @property
    def network_bytes(self) -> int:
        """Memory that the agents need: all networks, their targets, and what Adam remembers."""
        roles, hidden = role_specs(self.world), (self.hidden, self.hidden)
        return sum(
            roles[name].agents * agent_bytes(*network_sizes(roles, name, hidden))
            for name in self.learning
        )

    def init(self, key: Key[Array, ""]) -> Learned:
        """New agents, and an empty memory.

        Raises:
            TooLarge: networks and memory for transitions would not fit; the message names the
                sizes.

        """
        require_memory(
            f"MADDPG with {readable_bytes(self.network_bytes)} of networks and a replay memory of "
            f"{self.memory:,} transitions ({readable_bytes(self.replay_bytes)})",
            self.network_bytes + self.replay_bytes,
        )
        replay = Replay.empty(self._layout, self.memory)
        return Learned(self.new_agents(key), replay, jnp.int32(0))

    def new_agents(self, key: Key[Array, ""]) -> dict[str, tuple[Agent, ...]]:
        """Agents that have learned nothing, per role that learns."""
        agents = {}
        for number, role in enumerate(self.learning):
            count = self.world.roles[role].agents
            keys = jax.random.split(jax.random.fold_in(key, number), count)
            agents[role] = tuple(self._new_agent(role, each) for each in keys)
        return agents

    def update(self, key: Key[Array, ""], learned: Learned) -> tuple[Learned, dict[str, PerRole]]:
        """Play `episodes` episodes, then learn `rounds` times.

        Args:
            key: consumed.
            learned: agents and memory; donate them (`ethogram.learners.train` does).

        Returns:
            The state after, and metrics: `reward` as of `play`, and the mean over the rounds of
            `critic_loss` and `actor_loss`, Float[agents] per role that learns.

        """
        for_play, for_rounds = jax.random.split(key)
        learned, played = self.play(for_play, learned)

        def learn(learned: Learned, key: Key[Array, ""]) -> tuple[Learned, dict[str, PerRole]]:
            return self._learn(key, learned)

        learned, losses = lax.scan(learn, learned, jax.random.split(for_rounds, self.rounds))
        return learned, played | jax.tree.map(lambda loss: loss.mean(0), losses)

    def play(self, key: Key[Array, ""], learned: Learned) -> tuple[Learned, dict[str, PerRole]]:
        """Play `episodes` episodes side by side and remember them.

        Each takes the world's `horizon` of steps; one that ends before is followed by another.

        Returns:
            The state after, and metrics: `reward`, what each agent earned in those steps,
            Float[episodes, agents] per role.

        """
        act = self.policy(learned)
        keys = jax.random.split(key, self.episodes)
        _, played = jax.vmap(lambda key: rollout(self.world, act, key, self.world.horizon))(keys)
        rows = self._layout.pack((played.state, played.action, played.key))
        replay = learned.replay.add(rows.reshape(-1, rows.shape[-1]))
        earned = {role: reward.sum(1) for role, reward in played.outcome.reward.items()}
        return Learned(learned.agents, replay, learned.rounds), {"reward": earned}

    def policy(
        self, learned: Learned, *, noise: bool = True
    ) -> Callable[[Key[Array, ""], PerRole], PerRole]:
        """How the agents act in one world; without noise, by the softmax of their logits."""
        temperature = self._temperature(learned.rounds)

        def act(key: Key[Array, ""], observation: PerRole) -> PerRole:
            logits = self.logits(learned, observation)
            action = {}
            for number, (name, role) in enumerate(self.world.roles.items()):
                for_role = jax.random.fold_in(key, number)
                if name in self.scripted:
                    action[name] = self.scripted[name](for_role, observation[name])
                    continue
                drawn = for_role if noise else None
                weights = self._weights(name, drawn, logits[name], temperature)
                is_index = isinstance(role.action, Discrete)
                action[name] = weights.argmax(-1) if is_index else weights
            return action

        return act

    def logits(self, learned: Learned, observation: PerRole) -> PerRole:
        """What each agent that learns makes of its choices: Float[agents, choice] per role.

        The softmax of an agent's logits is the chance of each choice to be the heaviest.
        """
        read = seen(self.world.roles, observation)
        return {
            role: self._logits(role, [agent.actor for agent in agents], read[role])
            for role, agents in learned.agents.items()
        }

    @property
    def _layout(self) -> Layout[Any]:
        """What is kept of a transition: the state left, the action, the key of chance."""
        action = {}
        for name, role in role_specs(self.world).items():
            kind = jnp.float32 if isinstance(role.action, Simplex | Box) else jnp.int32
            action[name] = array_spec((role.agents, *role.action.shape), kind)
        return Layout((state_spec(self.world), action, key_spec()))

    def _new_agent(self, role: str, key: Key[Array, ""]) -> Agent:
        roles = self.world.roles
        return Agent.init(
            key,
            used_features(roles[role].observation),
            used_features(roles[role].action),
            joint_used(roles),
            (self.hidden, self.hidden),
            copy_targets=self.copy_targets,
        )

    def _temperature(self, rounds: Int[Array, ""]) -> Float[Array, ""]:
        return Linear(self.temperature, self.final_temperature, self.anneal)(rounds)

    def _logits(
        self, role: str, actors: Sequence[MLP], read: Float[Array, "*batch agent feature"]
    ) -> Float[Array, "*batch agent choice"]:
        """Each actor's logits; those of choices that there are not are out of reach."""
        logits = jnp.stack([actor(read[..., i, :]) for i, actor in enumerate(actors)], -2)
        return jnp.where(used_features(self.world.roles[role].action), logits, OUT_OF_REACH)

    def _weights(
        self,
        role: str,
        key: Key[Array, ""] | None,
        logits: Float[Array, "*batch choice"],
        temperature: Number,
    ) -> Float[Array, "*batch choice"]:
        discrete = isinstance(self.world.roles[role].action, Discrete)
        hard = self.straight_through or discrete
        return gumbel_softmax(key, logits, temperature, straight_through=hard)

    def _learn(self, key: Key[Array, ""], learned: Learned) -> tuple[Learned, dict[str, PerRole]]:
        """One round of updates, agent by agent: each sees the targets of those before it."""
        agents = {role: list(ones) for role, ones in learned.agents.items()}
        losses: dict[str, dict[str, list[Array]]] = {"critic_loss": {}, "actor_loss": {}}
        for number, role in enumerate(self.learning):
            for_role = jax.random.fold_in(key, number)
            for i, agent in enumerate(agents[role]):
                for_batch, for_actor = jax.random.split(jax.random.fold_in(for_role, i))
                batch = self._draw(for_batch, learned, agents)
                agents[role][i], lost = self._improve(
                    for_actor, agent, role, i, batch, learned.rounds
                )
                for name, loss in lost.items():
                    losses[name].setdefault(role, []).append(loss)
        after = {role: tuple(ones) for role, ones in agents.items()}
        return Learned(after, learned.replay, learned.rounds + 1), {
            name: {role: jnp.stack(each) for role, each in per_role.items()}
            for name, per_role in losses.items()
        }

    def _draw(
        self, key: Key[Array, ""], learned: Learned, agents: Mapping[str, Sequence[Agent]]
    ) -> Batch:
        """A minibatch: rows from the memory, and all that follows from them."""
        for_rows, for_targets = jax.random.split(key)
        rows = learned.replay.draw(for_rows, self.batch)
        before, action, chance = self._layout.unpack(rows)
        _, outcome = jax.vmap(self.world.step)(chance, before, action)
        roles, temperature = self.world.roles, self._temperature(learned.rounds)
        reached = seen(roles, outcome.observation)
        target_action = {}
        for number, (name, role) in enumerate(roles.items()):
            for_role = jax.random.fold_in(for_targets, number)
            if name in self.scripted:
                keys = jax.random.split(for_role, self.batch)
                told = jax.vmap(self.scripted[name])(keys, outcome.observation[name])
                target_action[name] = features(role.action, told)
                continue
            actors = [agent.target_actor for agent in agents[name]]
            logits = self._logits(name, actors, reached[name])
            target_action[name] = self._weights(name, for_role, logits, temperature)
        return Batch(
            observation=seen(roles, jax.vmap(self.world.observe)(before)),
            action=done(roles, action),
            reward=outcome.reward,
            terminated=outcome.terminated,
            reached=reached,
            target_action=target_action,
        )

    def _improve(
        self,
        key: Key[Array, ""],
        agent: Agent,
        role: str,
        number: int,
        batch: Batch,
        rounds: Int[Array, ""],
    ) -> tuple[Agent, dict[str, Float[Array, ""]]]:
        """Update one agent: critic, then actor, then its targets."""
        rate = Linear(self.rate, self.final_rate, self.anneal)(rounds)
        future = agent.target_critic(joint(batch.reached, batch.target_action))[:, 0]
        reward, terminated = batch.reward[role][:, number], batch.terminated[role][:, number]
        target = one_step(reward, terminated, future, self.discount)
        row = joint(batch.observation, batch.action)

        def critic_loss(critic: MLP) -> Float[Array, ""]:
            return jnp.square(critic(row)[:, 0] - target).mean()

        lost, gradient = jax.value_and_grad(critic_loss)(agent.critic)
        critic, critic_moments = descend(
            agent.critic, gradient, agent.critic_moments, rate, self.clip
        )

        own, ours = own_action(self.world.roles, role, number), batch.observation[role][:, [number]]
        others = row @ critic.weights[0]  # the gradient needs only the part of the own action
        temperature, used = self._temperature(rounds), used_features(self.world.roles[role].action)

        def actor_loss(actor: MLP) -> Float[Array, ""]:
            logits = self._logits(role, [actor], ours)[:, 0]
            change = self._weights(role, key, logits, temperature) - row[:, own]
            value = critic.from_first(others + change @ critic.weights[0][own])
            return -value.mean() + self.penalty * jnp.square(logits).mean(where=used)

        actor_lost, gradient = jax.value_and_grad(actor_loss)(agent.actor)
        actor, actor_moments = descend(agent.actor, gradient, agent.actor_moments, rate, self.clip)
        return Agent(
            actor=actor,
            critic=critic,
            target_actor=optax.incremental_update(actor, agent.target_actor, self.tau),
            target_critic=optax.incremental_update(critic, agent.target_critic, self.tau),
            actor_moments=actor_moments,
            critic_moments=critic_moments,
        ), {"critic_loss": lost, "actor_loss": actor_lost}


class Playing(Module):
    """The learner at the beginning of a run: it plays, remembers, and learns nothing yet."""

    learner: MADDPG

    def update(self, key: Key[Array, ""], learned: Learned) -> tuple[Learned, dict[str, PerRole]]:
        """Play, as `MADDPG.play` does."""
        return self.learner.play(key, learned)
