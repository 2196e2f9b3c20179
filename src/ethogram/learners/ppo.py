"""Proximal policy optimisation, PPO (Schulman et al., 2017), for one agent or many.

An update plays some episodes with the policy as it is, estimates the advantages of what was done
(`ethogram.learners.returns.generalized_advantage`), and then, epoch after epoch and minibatch by
minibatch, descends by Adam on

    E_D -min(r A, clip(r, 1 - epsilon, 1 + epsilon) A)     eq. 7, r the ratio of new to old chance
        + beta KL(old || new)                              eq. 8, beta adapted to a target
        + c1 (V - target)^2 - c2 entropy                   eq. 9, target = A + old V

Agents of a role have one policy (`shared`) or one each.  A critic reads what its agent observes,
or with `central_critic`, beside it, what all agents of all roles do (MAPPO, Yu et al., 2022).
How actions of each kind of space are drawn says `ethogram.learners.action_distributions`.

Presets, and where they differ from their sources:

- `modern`, the default: what implementations have come to agree on (Huang et al., 2022, "The 37
  implementation details of PPO").  Differences: Adam's epsilon is 1e-8, not 1e-5; the value's error
  is not halved and not clipped; nothing is annealed, unless a schedule says so.
- `rllib08`: the default configuration of RLlib 0.8, which the thesis names, with the networks that
  its section on drivers describes (2 x 256 tanh, Xavier's first weights, one trunk for actor and
  critic; RLlib's own default has two trunks and weights of another distribution), and gamma 0.999.
  A batch is 8 episodes; of 500 steps with 40 drivers these are 160 000 samples and 37 500 steps of
  Adam: meant for a GPU.  Differences: batches begin with new episodes, where RLlib's workers go on
  with theirs; an episode that is `truncated` is worth what the critic says of its end, where RLlib
  takes every end for a termination; deviations of `Box` actions are parameters, not outputs, and
  the actions are in halves of the box.
- `thesis`: the same objective where two cores have to do.  Differences from `rllib08`: a batch is
  1 episode (20 000 samples of 40 drivers in 500 steps), a minibatch 1000 samples, 10 epochs (200
  steps of Adam an update), a learning rate ten times as high (5e-4) for so many fewer steps,
  networks of 2 x 64, and rewards divided by the deviation of returns (`normalize_returns`): without
  it the error of values, in the hundreds, drives the units that actor and critic share into
  saturation within some ten updates, and the policy depends on nothing that is observed.

Deviations from the paper:

- Whole horizons are played side by side; an agent's episode that ends before is followed by
  another, and the last one is cut.  `fragment_steps` cuts advantages more often.
- Advantages are standardised, over the batch or the minibatch.
- beta is adapted by factors of 1.5 and 0.5 when the divergence is over twice or below half the
  target (RLlib), the paper's are 2 and 0.5 at 1.5 times and its inverse.
- Of steps in which an agent is not `acting`, or that come after its own end, nothing is learned;
  advantages reach over a time in which it does not act.
- With `normalize_observations` what `Box` observations are scaled by is that of earlier updates, so
  that a policy does not change between acting and learning; in the first update they are as they
  are.  With `normalize_returns` rewards are divided by the deviation of discounted returns so far.
- The last minibatch of an epoch may be smaller; one in which no step counts changes nothing.
"""

import dataclasses
from collections.abc import Mapping
from functools import partial
from math import prod
from types import MappingProxyType
from typing import Annotated, Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Int, Key
from pydantic import Field

from ethogram.core.errors import InvalidSettings, UnknownName
from ethogram.core.memory import readable_bytes, require_memory
from ethogram.core.module import Module
from ethogram.core.rollout import Policy
from ethogram.core.settings import Count, Fraction, Number, Positive, setting
from ethogram.core.specs import role_specs
from ethogram.core.world import PerRole, Transition, World
from ethogram.learners.action_distributions import action_distribution, action_of
from ethogram.learners.base import Metrics
from ethogram.learners.critic_input import Roles
from ethogram.learners.episodes import (
    acting_steps,
    episode_returns,
    episode_sums,
    play_episodes,
    role_keys,
)
from ethogram.learners.experience import (
    Choice,
    Estimation,
    Experience,
    experience,
    returns_so_far,
    rows,
)
from ethogram.learners.losses import adapted_kl_coefficient
from ethogram.learners.networks import ACTIVATIONS, feature_count
from ethogram.learners.policy_group import Learned, PolicyGroup
from ethogram.learners.policy_network import INITIALIZATIONS, Architecture
from ethogram.learners.ppo_update import Descent, Minibatch, Objective, learn, standardized
from ethogram.learners.running_statistics import RunningStatistics
from ethogram.learners.schedules import Constant, Schedule, schedule_of

METRICS = ("policy_loss", "value_loss", "entropy", "clip_fraction", "kl", "kl_coefficient")

_RLLIB_08 = {
    "discount": 0.999,
    "gae_lambda": 1.0,
    "learning_rate": 5e-5,
    "clip": 0.3,
    "value_clip": 10.0,
    "value_coefficient": 1.0,
    "kl_coefficient": 0.2,
    "kl_target": 0.01,
    "max_gradient_norm": 0.0,
    "minibatch_size": 128,
    "epochs": 30,
    "episodes_per_update": 8,
    "fragment_steps": 200,
    "hidden_size": 256,
    "initialization": "glorot_uniform",
    "advantages": "batch",
    "shared_trunk": True,
}

PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "modern": {},
        "rllib08": _RLLIB_08,
        "thesis": {
            **_RLLIB_08,
            "learning_rate": 5e-4,
            "minibatch_size": 1000,
            "epochs": 10,
            "episodes_per_update": 1,
            "hidden_size": 64,
            "normalize_returns": True,
        },
    }
)

NonNegative = Annotated[float, Field(ge=0)]


class PPOState(eqx.Module):
    """What the policies of each role have learned, and after how many updates."""

    roles: dict[str, Learned]
    updates: Int[Array, ""]


class PPO(Module):
    """PPO in a world given by the caller, with actions and observations of any kind.

    Attributes:
        world: where it learns.
        learning_rate: of Adam, a number or a schedule over updates
            (`ethogram.learners.schedules`).
        entropy_coefficient: c2, a number or a schedule over updates.
        discount: gamma, from 0 to 1.
        gae_lambda: lambda of the advantages, from 0 to 1.
        clip: epsilon, of ratios of probabilities; above 0.
        value_clip: by how much values may move in an update; 0 for no limit.
        value_coefficient: c1; 0 or more.
        kl_coefficient: beta at first; 0 for none.
        kl_target: divergence of the policy in an update, to which beta is adapted; above 0.
        max_gradient_norm: to which the gradient as a whole is scaled down; 0 for no limit.
        minibatch_size: samples, one of an agent in a step, from 1 to 1 000 000.
        epochs: how often an update goes through its samples, from 1 to 10 000.
        episodes_per_update: side by side, each of `horizon` steps, from 1 to 100 000.
        fragment_steps: after so many, advantages go on with what the critic says; 0 for never.
        hidden_size: units in each of the two hidden layers, from 1 to 100 000.
        activation: between layers, `tanh` or `relu`.
        initialization: of weights, `orthogonal` or `glorot_uniform`.
        advantages: over what they are standardised, `minibatch` or `batch`.
        shared: whether all agents of a role have one policy; else each has its own.
        shared_trunk: whether actor and critic share their hidden layers.
        central_critic: whether critics also read what all agents observe.
        normalize_observations: whether `Box` observations are scaled by running statistics.
        normalize_returns: whether rewards are scaled by the running deviation of returns.
        squash: whether `Box` actions are squashed by tanh; else they are clipped.
        track: names of the world's metrics whose sums over an episode are metrics, too.

    """

    world: World
    learning_rate: Schedule = eqx.field(default=Constant(3e-4), converter=schedule_of)
    entropy_coefficient: Schedule = eqx.field(default=Constant(0.0), converter=schedule_of)
    discount: Number = setting(0.99, Fraction)
    gae_lambda: Number = setting(0.95, Fraction)
    clip: Number = setting(0.2, Positive)
    value_clip: Number = setting(0.0, NonNegative)
    value_coefficient: Number = setting(0.5, NonNegative)
    kl_coefficient: Number = setting(0.0, NonNegative)
    kl_target: Number = setting(0.01, Positive)
    max_gradient_norm: Number = setting(0.5, NonNegative)
    minibatch_size: int = setting(256, Count, static=True)
    epochs: int = setting(10, Annotated[int, Field(ge=1, le=10_000)], static=True)
    episodes_per_update: int = setting(8, Annotated[int, Field(ge=1, le=100_000)], static=True)
    fragment_steps: int = setting(0, Annotated[int, Field(ge=0)], static=True)
    hidden_size: int = setting(64, Annotated[int, Field(ge=1, le=100_000)], static=True)
    activation: str = setting("tanh", Literal["tanh", "relu"], static=True)
    initialization: str = setting(
        "orthogonal", Literal["orthogonal", "glorot_uniform"], static=True
    )
    advantages: str = setting("minibatch", Literal["minibatch", "batch"], static=True)
    shared: bool = setting(True, bool, static=True)
    shared_trunk: bool = setting(False, bool, static=True)
    central_critic: bool = setting(False, bool, static=True)
    normalize_observations: bool = setting(False, bool, static=True)
    normalize_returns: bool = setting(False, bool, static=True)
    squash: bool = setting(False, bool, static=True)
    track: tuple[str, ...] = eqx.field(default=(), static=True)

    def __check_init__(self) -> None:
        """Refuse a trunk for two that read different things.

        Raises:
            InvalidSettings: actor and critic are to share it, and the critic is central.

        """
        if self.shared_trunk and self.central_critic:
            raise InvalidSettings(
                "PPO: shared_trunk = True with central_critic = True; allowed: one of them, since "
                "a central critic reads what its actor must not."
            )

    @property
    def network_bytes(self) -> int:
        """Memory that networks need, with Adam's two moments of each number."""
        roles = role_specs(self.world)
        group = self._group(roles)
        return 4 * 3 * sum(group.numbers(role, self._architecture) for role in roles)

    @property
    def batch_bytes(self) -> int:
        """Memory that what an update plays needs."""
        roles = role_specs(self.world).values()
        words = [
            role.agents * (prod(role.observation.shape) + 2 * feature_count(role.action) + 8)
            for role in roles
        ]
        return 4 * self.episodes_per_update * self.world.horizon * sum(words)

    def init(self, key: Key[Array, ""]) -> PPOState:
        """Policies that have learned nothing.

        Raises:
            TooLarge: networks and what an update plays would not fit in memory; the message names
                the sizes.

        """
        require_memory(
            f"PPO with {readable_bytes(self.network_bytes)} of networks and batches of "
            f"{readable_bytes(self.batch_bytes)}",
            self.network_bytes + self.batch_bytes,
        )
        group, roles = self._group(self.world.roles), {}
        for name, for_role in role_keys(self.world.roles, key).items():
            policies = group.policies(name)
            roles[name] = Learned(
                *group.init(for_role, name, self._architecture),
                jnp.full(policies, self.kl_coefficient, jnp.float32),
                group.no_statistics(name) if self.normalize_observations else None,
                RunningStatistics.of_nothing(policies) if self.normalize_returns else None,
            )
        return PPOState(roles, jnp.int32(0))

    def update(self, key: Key[Array, ""], state: PPOState) -> tuple[PPOState, Metrics]:
        """Play `episodes_per_update` times the world's horizon, and learn from it.

        Args:
            key: consumed.
            state: donate it (`ethogram.learners.train` does).

        Returns:
            The state after, and metrics: `episode_return` of the first episode of each of those
            side by side, Float[episode, agent] per role; and per role, a number of each or, without
            `shared`, Float[agent]: means over the update `policy_loss`, `value_loss`, `entropy` and
            `clip_fraction`, the mean over its last epoch `kl`, and `kl_coefficient` after it.
            Of what it tracks, in `episode_sums`, by name, Num[episode, ...] of the same episodes.

        Raises:
            UnknownName: a metric to track is none of the world's.

        """
        for_play, for_learning = jax.random.split(key)
        group, act = self._group(self.world.roles), partial(self._act, state)
        played = play_episodes(
            self.world, act, for_play, self.episodes_per_update, keep=partial(self._kept, state)
        )
        acting = acting_steps(played)
        observation = jax.tree.map(rows, played.observation)
        roles, metrics = {}, {}
        for name, for_role in role_keys(self.world.roles, for_learning).items():
            learned = state.roles[name]
            if learned.running_return is not None:
                returns = returns_so_far(name, played, self.discount)
                learned = group.with_returns(learned, returns, rows(acting[name]))
            found = experience(name, learned.running_return, played, acting[name], self._estimation)
            if self.advantages == "batch":
                whole = standardized if self.shared else jax.vmap(standardized, 1, 1)
                found = found._replace(advantage=whole(found.advantage, found.counted))
            learned, metrics[name] = self._learn(for_role, name, learned, state, observation, found)
            seen = group.statistics_after(learned, name, observation[name], found.counted)
            roles[name] = dataclasses.replace(learned, observation=seen)
        per_role = {
            metric: {name: found[metric] for name, found in metrics.items()} for metric in METRICS
        }
        after = PPOState(roles, state.updates + 1)
        tracked = {"episode_sums": episode_sums(played)} if self.track else {}
        return after, {"episode_return": episode_returns(played), **tracked, **per_role}

    def policy(self, state: PPOState, *, explore: bool = False) -> Policy:
        """How the agents act in one world.

        Exploring, actions are drawn; otherwise they are the most probable ones.
        """

        def act(key: Key[Array, ""], observation: PerRole) -> PerRole:
            return self._act(state, key, observation, explore=explore)[0]

        return act

    def _group(self, roles: Roles) -> PolicyGroup:
        return PolicyGroup(roles, self.shared, self.central_critic)

    @property
    def _estimation(self) -> Estimation:
        return Estimation(self.discount, self.gae_lambda, self.fragment_steps)

    @property
    def _architecture(self) -> Architecture:
        return Architecture(
            (self.hidden_size, self.hidden_size),
            ACTIVATIONS[self.activation],
            INITIALIZATIONS[self.initialization],
            self.shared_trunk,
        )

    def _act(
        self, state: PPOState, key: Key[Array, ""], observation: PerRole, *, explore: bool = True
    ) -> tuple[PerRole, Choice]:
        """Actions, and what there is to know of them."""
        roles = self.world.roles
        outputs, value = self._group(roles).judge(state.roles, observation)
        drawn, action = {}, {}
        for name, for_role in role_keys(roles, key).items():
            space, log_std = roles[name].action, state.roles[name].network.log_std
            distribution = action_distribution(space, outputs[name], log_std)
            drawn[name] = distribution.sample(for_role) if explore else distribution.mode()
            action[name] = action_of(space, drawn[name], squash=self.squash)
        return action, Choice(drawn, outputs, value)

    def _kept(self, state: PPOState, transition: Transition) -> Transition:
        """Of a transition what is learned from, with the value of what was reached."""
        outcome = transition.outcome
        for name in self.track:
            if name not in outcome.metrics:
                raise UnknownName("metric", name, outcome.metrics)
        tracked = {name: outcome.metrics[name] for name in self.track}
        _, next_value = self._group(self.world.roles).judge(state.roles, outcome.observation)
        return dataclasses.replace(
            transition,
            state=None,
            next_state=None,
            action={},
            outcome=dataclasses.replace(outcome, observation={}, metrics=tracked),
            extras=transition.extras._replace(next_value=next_value),
        )

    def _learn(
        self,
        key: Key[Array, ""],
        name: str,
        learned: Learned,
        state: PPOState,
        observation: PerRole,
        experience: Experience,
    ) -> tuple[Learned, Metrics]:
        """Improve the policies of a role."""
        role = self.world.roles[name]
        group, (steps, agents) = self._group(self.world.roles), experience.counted.shape
        descent = Descent(
            self.minibatch_size,
            self.epochs,
            self.learning_rate(state.updates),
            self.max_gradient_norm,
        )

        def improve(
            key: Key[Array, ""], policy: Array, network: Any, moments: Any, kl_coefficient: Array
        ) -> Any:
            def gather(sample: Array, is_any: Array) -> Minibatch:
                row, agent = divmod(sample, agents) if self.shared else (sample, policy)
                read = group.read(state.roles, name, policy, observation, row, agent)
                drawn, outputs, value, advantage, target, counted = (
                    part[row, agent] for part in experience
                )
                counted &= is_any
                if self.advantages == "minibatch":
                    advantage = standardized(advantage, counted)
                return Minibatch(*read, drawn, outputs, value, advantage, target, counted)

            objective = Objective(
                self.clip,
                self.value_clip,
                self.value_coefficient,
                self.entropy_coefficient(state.updates),
                kl_coefficient,
            )
            samples = steps * agents if self.shared else steps
            return learn(key, network, moments, gather, samples, role.action, objective, descent)

        policies = group.policies(name)
        network, moments, found = jax.vmap(improve)(
            jax.random.split(key, policies),
            jnp.arange(policies),
            learned.network,
            learned.moments,
            learned.kl_coefficient,
        )
        kl = found["kl"][:, -1]
        coefficient = adapted_kl_coefficient(learned.kl_coefficient, kl, self.kl_target)
        metrics = {metric: values.mean(1) for metric, values in found.items()}
        metrics |= {"kl": kl, "kl_coefficient": coefficient}
        if self.shared:
            metrics = {metric: values[0] for metric, values in metrics.items()}
        return dataclasses.replace(
            learned, network=network, moments=moments, kl_coefficient=coefficient
        ), metrics
