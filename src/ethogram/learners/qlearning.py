"""Independent tabular Q-learning (Watkins & Dayan 1992; thesis, section 3.3.3).

Every agent of every role keeps its own table Q(o, a), starts it at zero, picks actions
epsilon-greedily (eq. 3.12) and after each step moves Q(o, a) by

    alpha (r + gamma max_b Q(o', b) - Q(o, a))                                     (eq. 3.13)

where nothing follows a termination, but the last step before a time limit does bootstrap.
Observations and actions are those of a world whose spaces are `Discrete`; the tables have a row
per observation that can occur, which is what the thesis calls sparse.

With `shared`, all agents of a role learn one table.  In a step several of them may have taken the
same action on the same row: n updates one after the other, towards the mean of their n targets,
move the entry by 1 - (1 - alpha)^n of the way, and that is what is done.

An array of keys in place of a key means as many trials side by side, in `init` and in `update`; the
trials are then the leading axis of states and metrics.  It gives the same numbers as a `vmap`
(`ethogram.learners.base.Trials`) and is faster: the tables of all trials and agents stand in one
array, so that a step is one gather and one scatter in place.

Deviations from the print: epsilon-greedy explores with probability epsilon (eq. 3.12 prints the
opposite); ties in the argmax are broken at random (a table of zeros with first-index ties would
coordinate everyone on resource 1); probabilities are multiples of 2^-16.
"""

from typing import Annotated, Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float, Int, Key
from pydantic import Field

from ethogram.core.batching import take
from ethogram.core.errors import EthogramError, TooLarge
from ethogram.core.keys import counter_bits, fold_in, require_key
from ethogram.core.memory import readable_bytes, readable_count, require_memory
from ethogram.core.module import Module
from ethogram.core.rollout import Policy
from ethogram.core.settings import Number, setting
from ethogram.core.spaces import LARGEST_INDEX, Discrete, Space
from ethogram.core.world import PerRole, World
from ethogram.learners.base import Metrics, Spaces
from ethogram.learners.distributions import epsilon_greedy
from ethogram.learners.episodes import role_keys
from ethogram.learners.returns import td_target
from ethogram.learners.schedules import ExponentialDecay, Schedule, schedule_of


class QLearningState(eqx.Module):
    """The tables, and how many episodes they have seen."""

    table: PerRole  # Float[*trial, table, row, action] per role
    episode: Int[Array, "*trial"]  # the same in all trials side by side


class _Step(eqx.Module):
    """What one step of an episode hands to the next."""

    table: PerRole  # Float[trials x tables x rows, actions] per role
    world: Any  # state, with a leading axis of trials
    cell: PerRole  # Int[trials, agents]: the table row that each agent stands on
    values: PerRole  # Float[actions, trials x agents]: what stands in it
    running: PerRole  # Bool[trials, agents]: whether its episode still is
    return_: PerRole  # Float[trials, agents]: reward so far


class QLearning(Module):
    """Tabular Q-learners, independent of each other, in a world given by the caller.

    An update plays and learns from one episode.

    Attributes:
        world: one whose observations and actions are `Discrete`.
        epsilon: chance to explore, a schedule over episodes (`ethogram.learners.schedules`); by
            default it decays from 1 to 0.01 by 0.9995 an episode.
        learning_rate: alpha, from 0 to 1.
        discount: gamma, from 0 to 1.
        shared: whether all agents of a role learn one table; else each has its own.

    """

    spaces: ClassVar[Spaces] = Spaces((Discrete,), (Discrete,))

    world: World
    epsilon: Schedule = eqx.field(default=ExponentialDecay(), converter=schedule_of)
    learning_rate: Number = setting(0.1, Annotated[float, Field(ge=0, le=1)])
    discount: Number = setting(0.9, Annotated[float, Field(ge=0, le=1)])
    shared: bool = eqx.field(static=True, default=False)  # one table for all agents of a role

    def init(self, key: Key[Array, "*trial"]) -> QLearningState:
        """Tables of zeros.

        Args:
            key: nothing is left to chance; its shape says how many trials there are.

        Raises:
            EthogramError: a role's observations or actions are not `Discrete`.
            TooLarge: the tables would not fit in memory; the message names the size.

        """
        require_key("QLearning.init", key)
        size, needed = self.size(key.size), self.table_bytes(key.size)
        require_memory(f"Q-learning with {size}", needed)
        table = {}
        for role in self.world.roles:
            tables, rows, actions = self._sizes(role)
            if key.size * tables * rows > LARGEST_INDEX:
                raise TooLarge(
                    f"Q-learning with {size} ({readable_bytes(needed)}) has more rows than 32 "
                    "bits can number; run fewer trials in one case."
                )
            table[role] = jnp.zeros((*key.shape, tables, rows, actions))
        return QLearningState(table, jnp.zeros(key.shape, jnp.int32))

    def table_bytes(self, trials: int = 1) -> int:
        """Memory that the tables of some trials need."""
        sizes = [self._sizes(role) for role in self.world.roles]
        return 4 * trials * sum(tables * rows * actions for tables, rows, actions in sizes)

    def update(
        self, key: Key[Array, "*trial"], state: QLearningState
    ) -> tuple[QLearningState, Metrics]:
        """Play one episode in every trial and learn from each step.

        Args:
            key: one per trial, consumed.
            state: tables and episode number; donate them (`ethogram.learners.train` does).

        Returns:
            The state after, and metrics: `episode_return`, Float[*trial, 1, agent] per role.

        """
        epsilon = self.epsilon(state.episode.reshape(-1)[0])
        for_start, for_choices, for_world = (fold_in(key.reshape(-1), use) for use in range(3))
        world, observation = jax.vmap(self.world.reset)(for_start)
        table = {role: each.reshape(-1, each.shape[-1]) for role, each in state.table.items()}
        cell = {role: self._cells(role, seen) for role, seen in observation.items()}
        start = _Step(
            table=table,
            world=world,
            cell=cell,
            values={role: _look_up(table[role], at) for role, at in cell.items()},
            running={role: jnp.ones(at.shape, bool) for role, at in cell.items()},
            return_={role: jnp.zeros(at.shape) for role, at in cell.items()},
        )

        def advance(at: _Step, time: Int[Array, ""]) -> tuple[_Step, None]:
            return self._advance(for_choices, fold_in(for_world, time), epsilon, at, time), None

        end, _ = lax.scan(advance, start, jnp.arange(self.world.horizon))
        after = {role: end.table[role].reshape(each.shape) for role, each in state.table.items()}
        earned = {role: each.reshape(*key.shape, 1, -1) for role, each in end.return_.items()}
        return QLearningState(after, state.episode + 1), {"episode_return": earned}

    def policy(self, state: QLearningState, *, explore: bool = False) -> Policy:
        """Act by the tables of one trial: greedily, ties at random, or exploring as in training.

        Raises:
            EthogramError: the state is of several trials.

        """
        if state.episode.ndim:
            raise EthogramError(
                f"QLearning.policy: a state of {state.episode.size} trials; allowed: of one, such "
                "as jax.tree.map(lambda part: part[0], state)."
            )
        epsilon = self.epsilon(state.episode) if explore else 0.0

        def act(key: Key[Array, ""], observation: PerRole) -> PerRole:
            action = {}
            for role, for_role in role_keys(self.world.roles, key).items():
                tables, rows, actions = self._sizes(role)
                agents = len(observation[role])
                cell = jnp.arange(agents) % tables * rows + observation[role]
                values = take(state.table[role].reshape(-1, actions), cell).T
                bits = jax.random.bits(for_role, (agents,))
                action[role] = epsilon_greedy(values, bits, epsilon)
            return action

        return act

    def _advance(
        self,
        for_choices: Key[Array, "trials"],
        for_world: Key[Array, "trials"],
        epsilon: Float[Array, ""],
        at: _Step,
        time: Int[Array, ""],
    ) -> _Step:
        """One step of all trials: act, let the world move, learn."""
        action = {role: self._act(for_choices, epsilon, at, role, time) for role in at.cell}
        world, outcome = jax.vmap(self.world.step)(for_world, at.world, action)
        table, cell, values, running, return_ = {}, {}, {}, {}, {}
        for role in at.cell:
            reward, terminated = outcome.reward[role], outcome.terminated[role]
            cell[role] = self._cells(role, outcome.observation[role])
            # read before writing: the target is made of the values of this moment
            ahead = _look_up(at.table[role], cell[role])
            target = td_target(
                reward.reshape(-1), terminated.reshape(-1), ahead.max(0), self.discount
            )
            counts = (at.running[role] & outcome.acting[role]).reshape(-1)
            if self.shared:
                table[role] = self._pool(at, role, action[role], target, counts)
                values[role] = _look_up(table[role], cell[role])
            else:
                learned = self._learn(at, role, action[role], target, counts)
                table[role] = _write(at.table[role], at.cell[role], learned)
                stays = cell[role].reshape(-1) == at.cell[role].reshape(-1)
                values[role] = jnp.where(stays, learned, ahead)
            running[role] = at.running[role] & ~terminated & ~outcome.truncated[role]
            return_[role] = at.return_[role] + jnp.where(at.running[role], reward, 0.0)
        return _Step(table, world, cell, values, running, return_)

    def _act(
        self,
        keys: Key[Array, "trials"],
        epsilon: Float[Array, ""],
        at: _Step,
        role: str,
        time: Int[Array, ""],
    ) -> Int[Array, "trials agents"]:
        shape = at.cell[role].shape
        offset = sum(self.world.roles[other].agents for other in sorted(at.cell) if other < role)
        everyone = sum(each.agents for each in self.world.roles.values())
        counter = time * everyone + offset + jnp.arange(shape[1])
        bits = jax.vmap(counter_bits, (0, None))(keys, counter)
        return epsilon_greedy(at.values[role], bits.reshape(-1), epsilon).reshape(shape)

    def _learn(
        self,
        at: _Step,
        role: str,
        action: Int[Array, "trials agents"],
        target: Float[Array, "agent"],
        counts: Bool[Array, "agent"],
    ) -> Float[Array, "actions agent"]:
        """The row's values after learning: eq. 3.13 in the entry of the action taken."""
        values = at.values[role]
        taken = jnp.arange(len(values))[:, None] == action.reshape(-1)
        return jnp.where(taken & counts, values + self.learning_rate * (target - values), values)

    def _pool(
        self,
        at: _Step,
        role: str,
        action: Int[Array, "trials agents"],
        target: Float[Array, "agent"],
        counts: Bool[Array, "agent"],
    ) -> Float[Array, "cells actions"]:
        """The shared tables after learning from all agents."""
        entry = at.cell[role].reshape(-1), action.reshape(-1)
        counted = counts.astype(float)
        nothing = jnp.zeros_like(at.table[role])
        agents = nothing.at[entry].add(counted)[entry]
        mean = nothing.at[entry].add(counted * target)[entry] / jnp.maximum(agents, 1.0)
        before = at.table[role][entry]
        way = 1 - (1 - self.learning_rate) ** agents
        return at.table[role].at[entry].set(before + way * (mean - before))  # the same for each

    def _cells(
        self, role: str, observation: Int[Array, "trials agents"]
    ) -> Int[Array, "trials agents"]:
        """Where each agent's row stands in the one table."""
        tables, rows, _ = self._sizes(role)
        trials = len(observation)
        own = jnp.arange(trials * tables, dtype=jnp.int32).reshape(trials, tables)
        return own * rows + observation

    def _sizes(self, role: str) -> tuple[int, int, int]:
        """Number of a role's tables in a trial, and their rows and actions."""
        played = self.world.roles[role]
        return (
            1 if self.shared else played.agents,
            self._count(role, played.observation),
            self._count(role, played.action),
        )

    def _count(self, role: str, space: Space) -> int:
        if not isinstance(space, Discrete):
            raise EthogramError(
                f"Q-learning needs discrete spaces; {role!r} of {type(self.world).__name__} has "
                f"{space}. ethogram.wrap_for puts a world in wrappers that change its spaces."
            )
        return space.n

    def size(self, trials: int) -> str:
        """The tables of some trials in words."""
        sizes = {role: self._sizes(role) for role in self.world.roles}
        tables = ", ".join(
            f"{tables} {role} tables of {readable_count(rows)} x {actions}"
            for role, (tables, rows, actions) in sizes.items()
        )
        return f"{trials} trials x {tables}"


def _look_up(
    table: Float[Array, "cells actions"], cell: Int[Array, "*at"]
) -> Float[Array, "actions agent"]:
    """Rows of the table, actions first: short axes outside, so that the arithmetic vectorises."""
    return table.at[cell.reshape(-1)].get(mode="promise_in_bounds").T


def _write(
    table: Float[Array, "cells actions"],
    cell: Int[Array, "*at"],
    values: Float[Array, "actions agent"],
) -> Float[Array, "cells actions"]:
    """The table with these rows replaced, in place where the table is donated."""
    return table.at[cell.reshape(-1)].set(values.T, mode="promise_in_bounds", unique_indices=True)
