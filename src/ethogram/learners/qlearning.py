"""Independent tabular Q-learning (Watkins & Dayan 1992; thesis, section 3.3.3).

Every agent of every role keeps its own table Q(o, a), starts it at zero, picks actions
epsilon-greedily (eq. 3.12) and after each step moves Q(o, a) by

    rate x (r + discount max_b Q(o', b) - Q(o, a))                                 (eq. 3.13)

where nothing follows a termination, but the last step before a time limit does bootstrap.
Observations and actions are those of a world whose spaces are `Discrete`; the tables have a row
per observation that can occur, which is what the thesis calls sparse.

With `shared`, all agents of a role learn one table.  In a step several of them may have taken the
same action on the same row: n updates one after the other, towards the mean of their n targets,
move the entry by 1 - (1 - rate)^n of the way, and that is what is done.

Trials are an axis of the learner rather than a `vmap` over it: the tables of all trials and
agents stand in one array, so that a step is one gather and one scatter in place.

Deviations from the print: epsilon-greedy explores with probability epsilon (eq. 3.12 prints the
opposite); ties in the argmax are broken at random (a table of zeros with first-index ties would
coordinate everyone on resource 1); probabilities are multiples of 2^-16.
"""

from typing import Annotated, Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float, Int, Key
from pydantic import Field

from ethogram.core.errors import EthogramError, TooLarge
from ethogram.core.keys import counter_bits, fold_in
from ethogram.core.memory import readable_bytes, readable_count, require_memory
from ethogram.core.module import Module
from ethogram.core.rollout import Policy
from ethogram.core.settings import Number, setting
from ethogram.core.spaces import LARGEST_INDEX, Discrete, Space
from ethogram.core.world import PerRole, World
from ethogram.learners.exploration import ExponentialDecay, Schedule, epsilon_greedy
from ethogram.learners.returns import one_step


class Learned(eqx.Module):
    """The tables, and how many episodes they have seen."""

    table: PerRole  # Float[trials x tables x rows, actions] per role
    episode: Int[Array, ""]


class _Step(eqx.Module):
    """What one step of an episode hands to the next."""

    table: PerRole
    world: Any  # state, with a leading axis of trials
    cell: PerRole  # Int[trials, agents]: the table row that each agent stands on
    values: PerRole  # Float[actions, trials x agents]: what stands in it
    active: PerRole  # Bool[trials, agents]: whether its episode still runs
    return_: PerRole  # Float[trials, agents]: reward so far


class QLearning(Module):
    """Tabular Q-learners, independent of each other, in a world given by the caller.

    `init() -> learned`, `update(keys, learned) -> (learned, metrics)` plays and learns from one
    episode per trial, `policy(learned, trial)` acts in one trial's world.
    """

    world: World
    epsilon: Schedule = ExponentialDecay()
    rate: Number = setting(0.1, Annotated[float, Field(ge=0, le=1)])
    discount: Number = setting(0.9, Annotated[float, Field(ge=0, le=1)])
    trials: int = eqx.field(static=True, default=1)
    shared: bool = eqx.field(static=True, default=False)  # one table for all agents of a role

    def init(self) -> Learned:
        """Tables of zeros.

        Raises:
            EthogramError: a role's observations or actions are not `Discrete`.
            TooLarge: the tables would not fit in memory; the message names the size.

        """
        require_memory(f"Q-learning with {self.size}", self.table_bytes)
        table = {}
        for role in self.world.roles:
            tables, rows, actions = self._sizes(role)
            cells = self.trials * tables * rows
            if cells > LARGEST_INDEX:
                raise TooLarge(
                    f"Q-learning with {self.size} ({readable_bytes(self.table_bytes)}) has "
                    f"more rows than 32 bits can number; run fewer trials in one case."
                )
            table[role] = jnp.zeros((cells, actions))
        return Learned(table, jnp.int32(0))

    @property
    def table_bytes(self) -> int:
        """Memory that the tables of all trials need."""
        sizes = [self._sizes(role) for role in self.world.roles]
        return 4 * self.trials * sum(tables * rows * actions for tables, rows, actions in sizes)

    def update(
        self, keys: Key[Array, "trials"], learned: Learned
    ) -> tuple[Learned, dict[str, PerRole]]:
        """Play one episode in every trial and learn from each step.

        Args:
            keys: one per trial, consumed.
            learned: tables and episode number; donate them (`ethogram.learners.train` does).

        Returns:
            The state after, and metrics: `return`, Float[trials, agents] per role.

        """
        epsilon = self.epsilon(learned.episode)
        for_start, for_choices, for_world = (fold_in(keys, use) for use in range(3))
        state, observation = jax.vmap(self.world.reset)(for_start)
        cell = {role: self._cells(role, seen) for role, seen in observation.items()}
        start = _Step(
            table=learned.table,
            world=state,
            cell=cell,
            values={role: _look_up(learned.table[role], at) for role, at in cell.items()},
            active={role: jnp.ones(at.shape, bool) for role, at in cell.items()},
            return_={role: jnp.zeros(at.shape) for role, at in cell.items()},
        )

        def advance(at: _Step, time: Int[Array, ""]) -> tuple[_Step, None]:
            return self._advance(for_choices, fold_in(for_world, time), epsilon, at, time), None

        end, _ = lax.scan(advance, start, jnp.arange(self.world.horizon))
        return Learned(end.table, learned.episode + 1), {"return": end.return_}

    def policy(
        self, learned: Learned, trial: Int[Array, ""] | int = 0, epsilon: Number = 0.0
    ) -> Policy:
        """Act by one trial's tables: greedy, ties at random, exploring with chance epsilon."""

        def act(key: Key[Array, ""], observation: PerRole) -> PerRole:
            action = {}
            for number, (role, seen) in enumerate(observation.items()):
                tables, rows, _ = self._sizes(role)
                cell = (trial * tables + jnp.arange(len(seen)) % tables) * rows + seen
                bits = jax.random.bits(jax.random.fold_in(key, number), seen.shape)
                action[role] = epsilon_greedy(_look_up(learned.table[role], cell), bits, epsilon)
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
        table, cell, values, active, return_ = {}, {}, {}, {}, {}
        for role in at.cell:
            reward, terminated = outcome.reward[role], outcome.terminated[role]
            cell[role] = self._cells(role, outcome.observation[role])
            # read before writing: the target is made of the values of this moment
            ahead = _look_up(at.table[role], cell[role])
            future = ahead.max(0)
            target = one_step(reward.reshape(-1), terminated.reshape(-1), future, self.discount)
            if self.shared:
                table[role] = self._pool(at, role, action[role], target)
                values[role] = _look_up(table[role], cell[role])
            else:
                learned = self._learn(at, role, action[role], target)
                table[role] = _write(at.table[role], at.cell[role], learned)
                stays = cell[role].reshape(-1) == at.cell[role].reshape(-1)
                values[role] = jnp.where(stays, learned, ahead)
            active[role] = at.active[role] & ~terminated & ~outcome.truncated[role]
            return_[role] = at.return_[role] + jnp.where(at.active[role], reward, 0.0)
        return _Step(table, world, cell, values, active, return_)

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
    ) -> Float[Array, "actions agent"]:
        """The row's values after learning: eq. 3.13 in the entry of the action taken."""
        values = at.values[role]
        taken = jnp.arange(len(values))[:, None] == action.reshape(-1)
        counts = taken & at.active[role].reshape(-1)
        return jnp.where(counts, values + self.rate * (target - values), values)

    def _pool(
        self,
        at: _Step,
        role: str,
        action: Int[Array, "trials agents"],
        target: Float[Array, "agent"],
    ) -> Float[Array, "cells actions"]:
        """The shared tables after learning from all agents."""
        entry = at.cell[role].reshape(-1), action.reshape(-1)
        counts = at.active[role].reshape(-1).astype(float)
        nothing = jnp.zeros_like(at.table[role])
        agents = nothing.at[entry].add(counts)[entry]
        mean = nothing.at[entry].add(counts * target)[entry] / jnp.maximum(agents, 1.0)
        before = at.table[role][entry]
        way = 1 - (1 - self.rate) ** agents
        return at.table[role].at[entry].set(before + way * (mean - before))  # the same for each

    def _cells(
        self, role: str, observation: Int[Array, "trials agents"]
    ) -> Int[Array, "trials agents"]:
        """Where each agent's row stands in the one table."""
        tables, rows, _ = self._sizes(role)
        own = jnp.arange(self.trials * tables, dtype=jnp.int32).reshape(self.trials, tables)
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
                f"{space}."
            )
        return space.n

    @property
    def size(self) -> str:
        """The tables in words."""
        sizes = {role: self._sizes(role) for role in self.world.roles}
        tables = ", ".join(
            f"{tables} {role} tables of {readable_count(rows)} x {actions}"
            for role, (tables, rows, actions) in sizes.items()
        )
        return f"{self.trials} trials x {tables}"


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
