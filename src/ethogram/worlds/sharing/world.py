"""Agents choosing among resources, with a word to say about it (thesis, section 3.3).

Each of n_a agents stands on one of n_r resources, or on none, and prefers one.  An action names
the resource to prefer and whether to say one's state aloud.  An agent that confirms its
preference moves there; the preference always follows the action (eqs. 3.3, 3.4).  Everyone
hears everyone: what is heard of resource j is v_j = (n_a + 1) x speakers that are on j and want
j + speakers that want j from elsewhere (eq. 3.2).  A place pays by how many share it
(`ethogram.worlds.sharing.reward`); an agent on no resource earns 0.

Observation: filling rho (agents per resource; hidden on request), own state (resource,
preference), words heard V.  `encoding="index"` gives it as one number, the row of a compact
table (`ethogram.worlds.sharing.rows`); `encoding="vector"` as the integers
(rho_1.., resource, preference, v_1..), for any number of agents and resources.  Action, with
optional communication: 2 (j - 1) + bit for resource j; otherwise j - 1.

Units: time in steps; reward and filling have none.  0 stands for "none" wherever a resource
1..n_r is named.

Deviations from the printed text, each for the reason given: in eqs. 3.3 and 3.4 the printed a''
is read as a', the only computable form; in eq. 3.5 the word is the new state; the rewards are
scaled as Table 3.2 needs (`reward="literal"` undoes it); without a choice to communicate the
bit is no part of the action; the end of an episode is a time limit, hence truncation
(`terminal=True` makes it a termination).
"""

from typing import Annotated, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Int, Key
from pydantic import Field

from ethogram.core.errors import InvalidSettings, TooLarge, UnknownName, shown
from ethogram.core.memory import readable_count
from ethogram.core.rollout import first_episode
from ethogram.core.scene import Scene
from ethogram.core.settings import setting
from ethogram.core.spaces import LARGEST_INDEX, Discrete, MultiDiscrete
from ethogram.core.world import Outcome, PerRole, Role, Transition, World
from ethogram.worlds.sharing.reward import (
    REWARDS,
    Reading,
    Reward,
    Scenario,
    reward_of_filling,
)
from ethogram.worlds.sharing.rows import Communication, Group, joint_rows, ranking
from ethogram.worlds.sharing.scene import record
from ethogram.worlds.sharing.state import State

Agents = Annotated[int, Field(ge=1, le=10_000)]
Resources = Annotated[int, Field(ge=1, le=100)]
Steps = Annotated[int, Field(ge=1, le=1_000_000)]


class Census(eqx.Module):
    """The state as everyone sees and hears it: agents counted per resource."""

    filling: Int[Array, "resource"]  # rho: agents on it
    settled: Int[Array, "resource"]  # c: speakers on it that want it
    coming: Int[Array, "resource"]  # d: speakers elsewhere that want it


def scenario_code(scenario: str | Int[Array, "..."] | Reward) -> Int[Array, "..."] | Reward:
    """The number of a scenario, so that scenarios share one compiled program; or a function."""
    if callable(scenario):
        return scenario
    if isinstance(scenario, str):
        if scenario not in REWARDS:
            raise UnknownName("scenario", scenario, REWARDS)
        return jnp.int32(list(REWARDS).index(scenario))
    code = jnp.asarray(scenario)
    known = jnp.issubdtype(code.dtype, jnp.integer)
    if not isinstance(code, jax.core.Tracer):
        known = known and bool(((code >= 0) & (code < len(REWARDS))).all())
    if not known:
        raise InvalidSettings(
            f"Sharing: scenario = {shown(scenario)}; allowed: a function, one of "
            f"{', '.join(REWARDS)}, or their numbers from 0 to {len(REWARDS) - 1}."
        )
    return code.astype(jnp.int32)


class Sharing(World):
    """Agents choosing among shared resources, with optional broadcast; one role, `agent`.

    Action: 2 (j - 1) + b prefers resource j, from 1, and says so aloud if b is 1; without
    `communication="optional"` it is j - 1.  Observation, with 0 for "none" and entry by entry where
    `encoding` is "vector":

    - agents on each resource, if `observe_filling`;
    - the resource that the agent is on, and the one that it prefers;
    - of each resource, what is heard: (agents + 1) times the speakers that are on it and prefer it,
      and one for each speaker that prefers it from elsewhere (eq. 3.2).

    As an "index" it is one number, the row of a table of all that can be observed; 0 is the start.

    Attributes:
        scenario: what a resource pays by how many share it: "cooperative", "competitive" or
            "mixed" (eqs. 3.6 to 3.8); its number from 0; or a function of the agents on each
            resource, the number of agents and the number of resources.
        agents: n_a, from 1 to 10 000.
        resources: n_r, from 1 to 100.
        steps: of an episode, from 1 to 1 000 000.
        communication: "always", "none", or "optional", where agents choose.
        observe_filling: whether agents see how many are on each resource.
        reward: "scaled", so that a step pays 1 at most, or "literal", divided as printed.
        terminal: whether an episode's end is a termination; else it is a truncation.
        encoding: of observations: "index" or "vector".

    """

    scenario: Int[Array, "..."] | Reward = setting(
        "cooperative", Scenario, converter=scenario_code, names=tuple(REWARDS)
    )
    agents: int = setting(10, Agents, static=True)
    resources: int = setting(2, Resources, static=True)
    steps: int = setting(100, Steps, static=True)
    communication: Communication = setting("optional", Communication, static=True)
    observe_filling: bool = setting(True, bool, static=True)
    reward: Reading = setting("scaled", Reading, static=True)
    terminal: bool = setting(False, bool, static=True)
    encoding: Literal["index", "vector"] = setting("index", Literal["index", "vector"], static=True)

    @property
    def horizon(self) -> int:
        """Every episode lasts `steps` steps."""
        return self.steps

    @property
    def roles(self) -> dict[str, Role]:
        """One role, `agent`."""
        action = Discrete(self.resources * (2 if self.communication == "optional" else 1))
        if self.encoding == "index":
            return {"agent": Role(self.agents, Discrete(self.rows), action)}
        filling = (self.agents + 1,) * self.resources * self.observe_filling
        own = (self.resources + 1,) * 2
        heard = (self.agents * (self.agents + 1) + 1,) * self.resources
        return {"agent": Role(self.agents, MultiDiscrete((*filling, *own, *heard)), action)}

    @property
    def rows(self) -> int:
        """How many observations there are: own state x what all see and hear, and the start."""
        return 1 + joint_rows(self._group) * (self.resources + 1) * self.resources

    @property
    def _group(self) -> Group:
        return Group(self.agents, self.resources, self.communication, self.observe_filling)

    def reset(self, key: Key[Array, ""]) -> tuple[State, PerRole]:
        """Everyone inactive, without preference, silent."""
        del key  # every episode starts alike
        nobody = jnp.zeros(self.agents, jnp.int32)
        state = State(nobody, nobody, jnp.zeros(self.agents, bool), jnp.int32(0))
        return state, self.observe(state)

    def observe(self, state: State) -> PerRole:
        """The row of the table, or the vector of counts."""
        counted = census(state, self.resources)
        if self.encoding == "vector":
            return {"agent": self._vector(state, counted)}
        started = state.preference > 0  # without preferences it is the first row
        return {"agent": jnp.where(started, self._row(state, counted), 0)}

    def step(self, key: Key[Array, ""], state: State, action: PerRole) -> tuple[State, Outcome]:
        """Prefer, move on confirmation, speak; then observe and earn in the state reached."""
        del key  # the world is deterministic
        after = move(state, action["agent"], self.communication)
        counted = census(after, self.resources)
        observe = self._row if self.encoding == "index" else self._vector
        over = jnp.broadcast_to(after.time >= self.steps, self.agents)
        never = jnp.zeros(self.agents, bool)
        return after, Outcome(
            observation={"agent": observe(after, counted)},
            reward={"agent": self._earn(after, counted)},
            terminated={"agent": over if self.terminal else never},
            truncated={"agent": never if self.terminal else over},
            metrics={"filling": counted.filling},
        )

    def scene(self, trajectory: Transition) -> Scene:
        """The states that the first episode reached, one per step."""
        episode = first_episode(self, trajectory)
        reward = np.asarray(episode.outcome.reward["agent"])
        return record(episode.next_state, reward, self.resources, title="Sharing: one episode")

    def _earn(self, state: State, counted: Census) -> Float[Array, "agent"]:
        pays = reward_of_filling(
            counted.filling,
            self.scenario,
            self.agents,
            self.resources,
            literal=self.reward == "literal",
        )
        on = state.resource == jnp.arange(1, self.resources + 1)[:, None]
        return jnp.where(on, pays[:, None], 0.0).sum(0)

    def _row(self, state: State, counted: Census) -> Int[Array, "agent"]:
        if self.rows > LARGEST_INDEX:
            raise TooLarge(
                f"{self.agents} agents on {self.resources} resources can observe "
                f"{readable_count(self.rows)} different things, too many to number in 32 bits; "
                'use encoding="vector".'
            )
        counts = (counted.settled, counted.filling - counted.settled, counted.coming)
        joint = ranking(self._group)(jnp.concatenate(counts))
        own = state.resource * self.resources + state.preference - 1
        return 1 + joint * (self.resources + 1) * self.resources + own

    def _vector(self, state: State, counted: Census) -> Int[Array, "agent feature"]:
        heard = (self.agents + 1) * counted.settled + counted.coming  # eq. 3.2
        filling = counted.filling[: self.resources * self.observe_filling]
        alike = [jnp.broadcast_to(part, (self.agents, part.size)) for part in (filling, heard)]
        own = jnp.stack([state.resource, state.preference], -1)
        return jnp.concatenate([alike[0], own, alike[1]], -1)


def move(state: State, action: Int[Array, "agent"], communication: Communication) -> State:
    """Preference, place and word after the action (eqs. 3.3 to 3.5)."""
    if communication == "optional":
        preference, spoke = action // 2 + 1, action % 2 == 1
    else:
        preference, spoke = action + 1, jnp.full(action.shape, communication == "always")
    resource = jnp.where(preference == state.preference, preference, state.resource)
    return State(resource, preference, spoke, state.time + 1)


def census(state: State, resources: int) -> Census:
    """Count the agents on each resource, and the speakers that want it from there or elsewhere."""
    settled = state.resource == state.preference
    said = jnp.where(state.spoke, state.preference, 0)
    entries = jnp.stack(
        [
            state.resource,
            jnp.where((said > 0) & settled, said + resources, 0),
            jnp.where((said > 0) & ~settled, said + 2 * resources, 0),
        ]
    )
    filling, here, elsewhere = tally(entries, 3 * resources).reshape(3, resources)
    return Census(filling, here, elsewhere)


def tally(entries: Int[Array, "kind agent"], size: int) -> Int[Array, "size"]:
    """Count the entries 1 to `size`, each at most once per agent; 0 counts nowhere.

    Several counts share a 32-bit word, so that one sum over the agents makes them all.
    """
    width = entries.shape[-1].bit_length()  # bits that hold a count of all agents
    per_word = max(1, 32 // width)
    field = entries - 1
    words = jnp.arange(-(-size // per_word))[:, None, None]
    ones = jnp.uint32(1) << (field % per_word * width).astype(jnp.uint32)
    packed = jnp.where((entries > 0) & (field // per_word == words), ones, 0).sum((1, 2))
    shifts = (jnp.arange(size) % per_word * width).astype(jnp.uint32)
    counts = packed[jnp.arange(size) // per_word] >> shifts
    return (counts & jnp.uint32((1 << width) - 1)).astype(jnp.int32)
