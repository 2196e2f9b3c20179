"""The publishing system as those see it who learn: how ambitious, or how selective, to be.

Thesis, section 7.3.4, "Learnable policies".  One role learns, the other follows a policy.  Each
learner has a level from 1 to n_bin, at first drawn uniformly, and raises, keeps or lowers it by one
in every step before anything else happens:

- an author's ambition is the bin of the journals, ranked by impact factor, to which the draft goes;
- an editor's selectivity b turns away what is below the quantile (b - 1) / n_bin of what the
  journal has published.

Observations are a table's rows: of authors, ambition x quality x rejections of the draft; of
editors, selectivity x impact factor x number of papers, each in n_bin bins.  Rewards are those of
the world, changes of the h-index or, at the end of a year, of the impact factor; `reward="level"`
pays h-index and impact factor themselves at the same moments.

Readings: rejections beyond n_bin - 1 count as so many, impact factors beyond `IMPACT_MAX` (I_max of
table 7.1) or undefined as the highest or the lowest; numbers of papers have logarithmic bins from
none to all that there can be.
"""

from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Int, Key

from ethogram.core.keys import branch
from ethogram.core.scene import Scene
from ethogram.core.spaces import Discrete
from ethogram.core.world import Outcome, PerRole, Role, Transition, World
from ethogram.core.wrappers import RolePolicy
from ethogram.worlds.publishing.policies import SHARES, Minded, Ranking, Scrutiny
from ethogram.worlds.publishing.state import State as Inner
from ethogram.worlds.publishing.world import Publishing

IMPACT_MAX = 20.0
MOVES = 3  # down, stay, up

Learning = Literal["author", "editor"]
Reward = Literal["change", "level"]


class State(eqx.Module):
    """The system, and how ambitious or selective each learner is."""

    system: Inner
    level: Int[Array, "agent"]  # from 0


class LearnablePublishing(World):
    """One role moves its ambition or selectivity; the other follows a policy of its own.

    The one role is the one that learns.  Action: 0 lowers the level by one, 1 keeps it, 2 raises
    it.  Observation: (level x bins + first) x bins + second, each from 0 to bins - 1; of an author,
    first and second are the draft's quality and its rejections, of an editor, the journal's impact
    factor and its number of papers.

    Attributes:
        system: authors, editors and journals.
        others: policy of the role that does not learn; None is the thesis' own: minded authors,
            mild scrutiny.
        learns: "author" or "editor".
        ranking: how many bins there are, and how journals are grouped into them.
        reward: "change" pays changes of the h-index or impact factor, "level" these themselves.

    """

    system: Publishing = eqx.field(default_factory=Publishing)
    others: RolePolicy | None = None
    learns: Learning = eqx.field(static=True, default="author")
    ranking: Ranking = eqx.field(default_factory=Ranking)
    reward: Reward = eqx.field(static=True, default="change")

    @property
    def horizon(self) -> int:
        """That of the system."""
        return self.system.horizon

    @property
    def roles(self) -> dict[str, Role]:
        """The one that learns: a row of its table, and one of three moves."""
        agents = self.system.roles[self.learns].agents
        return {self.learns: Role(agents, Discrete(self.ranking.bins**3), Discrete(MOVES))}

    def reset(self, key: Key[Array, ""]) -> tuple[State, PerRole]:
        """A fresh system, and levels drawn uniformly."""
        for_system, for_level = jax.random.split(key)
        system, _ = self.system.reset(for_system)
        agents = self.system.roles[self.learns].agents
        level = jax.random.randint(for_level, (agents,), 0, self.ranking.bins)
        state = State(system, level)
        return state, self.observe(state)

    def observe(self, state: State) -> PerRole:
        """See the module."""
        seen = self.system.observe(state.system)[self.learns]
        bins = self.ranking.bins
        if self.learns == "author":
            first, second = seen[:, 0] / self.system.quality_max, seen[:, 1] / bins
        else:
            papers = jnp.log1p(seen[:, 1]) / jnp.log1p(self.system.capacity)
            first, second = seen[:, 0] / IMPACT_MAX, papers
        row = (state.level * bins + self._bin(first)) * bins + self._bin(second)
        return {self.learns: row}

    def step(self, key: Key[Array, ""], state: State, action: PerRole) -> tuple[State, Outcome]:
        """Move the levels, let everybody act, and pay those who learn."""
        for_mine, for_others, for_system = (branch(key, use) for use in range(3))
        level = jnp.clip(state.level + action[self.learns] - 1, 0, self.ranking.bins - 1)
        seen = self.system.observe(state.system)
        act = {
            role: self._apply(for_mine, level, at)
            if role == self.learns
            else self._policy_of_others(for_others, at)
            for role, at in seen.items()
        }
        system, outcome = self.system.step(for_system, state.system, act)
        after = State(system, level)
        return after, Outcome(
            observation=self.observe(after),
            reward={self.learns: self._pay(system, outcome)},
            terminated={self.learns: outcome.terminated[self.learns]},
            truncated={self.learns: outcome.truncated[self.learns]},
            metrics=outcome.metrics,
        )

    def scene(self, trajectory: Transition) -> Scene:
        """That of the system; ambition and selectivity show in what is submitted and accepted."""
        systems = trajectory.state.system, trajectory.next_state.system
        return self.system.scene(
            eqx.tree_at(lambda step: (step.state, step.next_state), trajectory, systems)
        )

    def _policy_of_others(self, key: Key[Array, ""], seen: Array) -> Array:
        if self.others is not None:
            return self.others(key, seen)
        if self.learns == "author":
            return Scrutiny(SHARES["mild_scrutiny"])(key, seen)
        return Minded(self.system.quality_max, self.ranking)(key, seen)

    def _apply(self, key: Key[Array, ""], level: Int[Array, "agent"], seen: Any) -> Array:
        if self.learns == "author":
            return self.ranking.choose(key, level, seen[0, 2:])
        return level / self.ranking.bins

    def _pay(self, system: Inner, outcome: Outcome) -> Float[Array, "agent"]:
        if self.reward == "change":
            return outcome.reward[self.learns]
        if self.learns == "author":
            return system.citation_stats.h_index.astype(float)
        ended = system.time % self.system.steps_per_year == 0
        return jnp.where(ended, jnp.nan_to_num(system.impact), 0.0)

    def _bin(self, share: Float[Array, "agent"]) -> Int[Array, "agent"]:
        bins = self.ranking.bins
        return jnp.clip(jnp.floor(bins * share), 0, bins - 1).astype(jnp.int32)
