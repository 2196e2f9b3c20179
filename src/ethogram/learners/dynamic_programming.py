"""The optimum of a known, finite world, and Monte Carlo's way to it without the model.

Thesis, section 1.1; the algorithms are those of Sutton & Barto (2018), sections 4.4 and 5.4.

Value iteration sweeps over all states (eq. 1.7)

    V(s) <- max_a sum_s' p(s' | s, a) [r(s, a, s') + gamma V(s')]

until V stops changing; the optimal policy takes the action with the largest bracket (eq. 1.8),
whose expectation is Q*(s, a) (eq. 1.9).  Monte Carlo control knows no p: it plays whole episodes
with an epsilon-greedy policy and averages the returns that followed each pair of state and
action (eq. 1.10), acting by the averages so far (eq. 1.11).  It is on-policy, so with epsilon
fixed it tends to the best of the epsilon-soft policies, not of all; `value_iteration` finds that
optimum too, which is how the two are tested against each other.

Deviations from the print: the value of the next state is discounted by gamma wherever it occurs;
eq. 1.8 prints it without.  The averages are of every visit (the thesis leaves open which), and
over all episodes from the first, in which the policy was worse.
"""

from typing import Annotated, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float, Int, Key
from pydantic import Field

from ethogram.core.errors import InvalidSettings
from ethogram.core.memory import require_memory
from ethogram.core.module import Module
from ethogram.core.rollout import Policy
from ethogram.core.settings import Fraction, Number, setting
from ethogram.core.spaces import Discrete
from ethogram.core.world import Outcome, PerRole, Role, World
from ethogram.learners.base import Metrics, Spaces
from ethogram.learners.distributions import epsilon_greedy
from ethogram.learners.episodes import (
    episode_returns,
    in_first_episode,
    play_episodes,
    role_keys,
)
from ethogram.learners.schedules import Constant, Schedule
from ethogram.learners.tables import blank_tables, rows, table_bytes


class Place(eqx.Module):
    """Where the agent of a decision process stands."""

    state: Int[Array, ""]
    time: Int[Array, ""]  # steps taken in this episode


class DecisionProcess(World):
    """A finite Markov decision process, given as tables: a world for one agent that sees all.

    Terminal states keep their rows in the tables, which nothing reads.
    """

    transition: Float[Array, "s a s_next"]  # p(s' | s, a); each row adds up to 1
    reward: Float[Array, "s a s_next"]  # expected reward of that transition
    terminal: Bool[Array, "s"]  # an episode ends on reaching one
    start: Float[Array, "s"]  # chance of starting in a state
    steps: int = setting(100, Annotated[int, Field(ge=1)], static=True)  # the time limit

    def __check_init__(self) -> None:
        """Refuse tables that hold no probabilities; tables inside a `jit` pass as they are.

        Raises:
            InvalidSettings: negative chances, or chances that do not add up to 1.

        """
        for name in ("transition", "start"):
            chances = getattr(self, name)
            if isinstance(chances, jax.core.Tracer):
                continue
            adds_up = jnp.abs(chances.sum(-1) - 1.0) < 1e-5
            if not (adds_up.all() and (chances >= 0).all()):
                raise InvalidSettings(
                    f"DecisionProcess: {name} needs chances that are not negative and add up "
                    f"to 1 along its last axis; they add up to {chances.sum(-1)}."
                )

    @property
    def horizon(self) -> int:
        """An episode that reaches no terminal state is cut after `steps` steps."""
        return self.steps

    @property
    def roles(self) -> dict[str, Role]:
        """One agent; it observes the number of the state."""
        states, actions, _ = self.transition.shape
        return {"agent": Role(1, Discrete(states), Discrete(actions))}

    def reset(self, key: Key[Array, ""]) -> tuple[Place, PerRole]:
        """Draw a state from `start`."""
        state = jax.random.categorical(key, jnp.log(self.start))
        place = Place(state, jnp.int32(0))
        return place, self.observe(place)

    def observe(self, state: Place) -> PerRole:
        """The number of the state."""
        return {"agent": state.state[None]}

    def step(self, key: Key[Array, ""], state: Place, action: PerRole) -> tuple[Place, Outcome]:
        """Draw the next state and earn the reward of the transition."""
        (chosen,) = action["agent"]
        reached = jax.random.categorical(key, jnp.log(self.transition[state.state, chosen]))
        after = Place(reached, state.time + 1)
        ends = self.terminal[reached]
        return after, Outcome(
            observation=self.observe(after),
            reward={"agent": self.reward[state.state, chosen, reached][None]},
            terminated={"agent": ends[None]},
            truncated={"agent": (~ends & (after.time >= self.steps))[None]},
        )


class Optimum(eqx.Module):
    """What value iteration found, and how far its last sweep still moved."""

    value: Float[Array, "s"]  # V*(s), reward discounted from s on; 0 in terminal states
    action_value: Float[Array, "s a"]  # Q*(s, a)
    policy: Int[Array, "s"]  # the best action, the first of equals
    sweeps: Int[Array, ""]
    residual: Float[Array, ""]  # largest change in the last sweep; NaN where the values diverge


def value_iteration(
    process: DecisionProcess,
    discount: Number,
    *,
    epsilon: Number = 0.0,
    tolerance: float = 1e-6,
    sweeps: int = 10_000,
) -> Optimum:
    """Solve a known process (eqs. 1.7 to 1.9).

    Args:
        process: the model; its time limit is not part of the problem.
        discount: gamma, from 0 to 1; 1 only where every policy terminates.
        epsilon: 0 for the optimum; else the optimum among the policies that explore with this
            probability, as Monte Carlo control does.
        tolerance: sweeps end once no value changes by more than this share of the largest one.
        sweeps: or after this many; `residual` then shows what is missing.

    """

    def sweep(at: Optimum) -> Optimum:
        action_value = expected_returns(process, at.value, discount)
        value = (1 - epsilon) * action_value.max(-1) + epsilon * action_value.mean(-1)
        residual = jnp.abs(value - at.value).max()
        return Optimum(value, action_value, action_value.argmax(-1), at.sweeps + 1, residual)

    def unsettled(at: Optimum) -> Bool[Array, ""]:
        scale = jnp.maximum(1.0, jnp.abs(at.value).max())
        return (at.residual > tolerance * scale) & (at.sweeps < sweeps)

    states, actions, _ = process.transition.shape
    guess = Optimum(
        value=jnp.zeros(states),
        action_value=jnp.zeros((states, actions)),
        policy=jnp.zeros(states, jnp.int32),
        sweeps=jnp.int32(0),
        residual=jnp.float32(jnp.inf),
    )
    return lax.while_loop(unsettled, sweep, guess)


def expected_returns(
    process: DecisionProcess, value: Float[Array, "s"], discount: Number
) -> Float[Array, "s a"]:
    """Reward now plus the discounted value of what follows: the sum in eqs. 1.7 to 1.9.

    Nothing follows a terminal state, so all of its entries are 0, as its `value` should be.
    """
    expected = (process.transition * (process.reward + discount * value)).sum(-1)
    return jnp.where(process.terminal[:, None], 0.0, expected)


class MonteCarloState(eqx.Module):
    """Mean return after each observation and action, and of how many visits it is the mean."""

    value: PerRole  # Float[agents, rows, actions] per role
    visits: PerRole  # Float[agents, rows, actions] per role
    episode: Int[Array, ""]


class MonteCarloControl(Module):
    """On-policy, every-visit Monte Carlo control, in a world given by the caller.

    Every agent of every role learns alone.  An episode that is cut by a time limit counts as
    complete, so let it be long against 1 / (1 - discount).

    Attributes:
        world: one whose observations and actions are `Discrete`.
        epsilon: chance to explore, a schedule over episodes; 0.1 by default.
        discount: gamma, from 0 to 1.

    """

    spaces: ClassVar[Spaces] = Spaces((Discrete,), (Discrete,))

    world: World
    epsilon: Schedule = Constant(0.1)
    discount: Number = setting(0.9, Fraction)

    def init(self, key: Key[Array, ""]) -> MonteCarloState:
        """No visit yet, values of zero.

        Args:
            key: nothing is left to chance.

        Raises:
            EthogramError: a role's observations or actions are not `Discrete`.
            TooLarge: the tables would not fit in memory; the message names the size.

        """
        del key
        name = "Monte Carlo control"
        require_memory(name, 2 * table_bytes(self.world, name))
        value, visits = (blank_tables(self.world, name) for _ in range(2))  # each is donated
        return MonteCarloState(value, visits, jnp.int32(0))

    def update(
        self, key: Key[Array, ""], state: MonteCarloState
    ) -> tuple[MonteCarloState, Metrics]:
        """Play one episode and average its returns into the table (eq. 1.10).

        Returns:
            The state after, and metrics: `episode_return`, Float[1, agent] per role.

        """
        played = play_episodes(self.world, self.policy(state, explore=True), key, 1)
        taken, counted = jax.tree.map(lambda part: part[0], (played, in_first_episode(played)))
        value, visits = {}, {}
        for role in state.value:
            reward = jnp.where(counted[role], taken.outcome.reward[role], 0.0)
            agents = jnp.arange(reward.shape[1])
            cell = (agents, taken.observation[role], taken.action[role])
            visited = counted[role] & taken.outcome.acting[role]
            visits[role] = state.visits[role].at[cell].add(visited)
            error = discounted_returns(reward, self.discount) - state.value[role][cell]
            share = jnp.where(visited, error, 0.0) / jnp.maximum(visits[role][cell], 1.0)
            value[role] = state.value[role].at[cell].add(share)
        after = MonteCarloState(value, visits, state.episode + 1)
        return after, {"episode_return": episode_returns(played)}

    def policy(self, state: MonteCarloState, *, explore: bool = False) -> Policy:
        """Greedy with random ties (eq. 1.11), or exploring with probability epsilon."""
        epsilon = self.epsilon(state.episode) if explore else 0.0

        def act(key: Key[Array, ""], observation: PerRole) -> PerRole:
            action, values = {}, rows(state.value, observation)
            for role, for_role in role_keys(self.world.roles, key).items():
                bits = jax.random.bits(for_role, observation[role].shape)
                action[role] = epsilon_greedy(values[role].T, bits, epsilon)
            return action

        return act


def discounted_returns(
    reward: Float[Array, "step agent"], discount: Number
) -> Float[Array, "step agent"]:
    """G_t = R_{t+1} + gamma G_{t+1}, from the episode's last step backwards."""

    def extend(later: Float[Array, "agent"], now: Float[Array, "agent"]) -> tuple[Array, Array]:
        return_ = now + discount * later
        return return_, return_

    return lax.scan(extend, jnp.zeros_like(reward[0]), reward, reverse=True)[1]
