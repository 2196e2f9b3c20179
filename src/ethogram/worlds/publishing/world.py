"""The world of chapter 7: authors write and submit papers, editors accept or reject them.

A year has `steps_per_year` steps.  In each step every author writes anew or submits the draft at
hand to a journal; the journal's editor accepts it if its quality is at least a quantile, of the
editor's choice, of what the journal has published (an empty journal accepts).  An accepted paper is
published in the current year and its author begins another draft; a rejected one stays the author's
draft.  A draft has a quality, Normal(author's quality, sigma) within [0, q_max], and cites
`references` papers (`literature`).  Its citations count once it is published.

Authors are rewarded by the change of their h-index (eq. 7.1), editors by the change of their
journal's impact factor (eq. 7.3) at the end of a year.  Within a step everyone acts on what there
was at its start (`update="synchronous"`), or one author after the other in random order.

Readings, each a setting with its literal form: impact factors are of the union of the two years
before (`if_window`), known for the last complete year (`if_timing`), and undefined without papers
(`undefined_if`); qualities beyond their bounds are cut off, or not drawn (`quality_bounds`).
Deviation: qualities are rounded to one of 16 384 levels, a thousandth of the spread of an author's
papers apart; then sums and quantiles are exact.  An author publishes at most one paper a step, so
all papers that there can be fit in arrays made beforehand.
"""

from typing import Annotated, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Float, Int, Key
from pydantic import Field

from ethogram.core.errors import TooLarge
from ethogram.core.keys import branch, random_words
from ethogram.core.memory import readable_count, require_memory
from ethogram.core.rollout import first_episode
from ethogram.core.scene import Scene
from ethogram.core.settings import Number, function_of, named, of_shape, setting
from ethogram.core.spaces import LARGEST_INDEX, Box, Discrete
from ethogram.core.world import Outcome, PerRole, Role, Transition, World
from ethogram.worlds.publishing.editorial import pass_time, submit
from ethogram.worlds.publishing.impact_2018 import Sources
from ethogram.worlds.publishing.initial import ASSIGNMENTS, Assignment, initial_state
from ethogram.worlds.publishing.journals import IMPACT_FACTORS, ImpactFactor
from ethogram.worlds.publishing.literature import INITIAL_YEARS, LEVELS
from ethogram.worlds.publishing.quality import (
    DRAFT_QUALITIES,
    QUALITY_SCALES,
    DraftQuality,
    QualityScale,
    power_law,
)
from ethogram.worlds.publishing.scene import glimpse, record_steps
from ethogram.worlds.publishing.state import State

ACCEPT_ALL = -1.0  # an editor's action below 0: whatever the quality
TOP = LEVELS - 1


Size = Annotated[int, Field(ge=1, le=100_000)]


class Publishing(World):
    """Authors, editors and journals; the roles are `author` and `editor`, one editor a journal.

    Action of an author: 0, to write anew, or the journal to submit the draft to, from 1.  Of an
    editor: the share to turn away, from 0 to 1; what is below that quantile of what the journal has
    published is rejected; below 0 nothing is.  Observation of an author: quality of its draft,
    rejections of it so far, and the impact factor of each journal.  Of an editor: impact factor of
    its journal, and how many papers it has published.  An impact factor that is undefined is -1.

    Attributes:
        authors: from 1 to 100 000.
        journals: from 1 to 10 000.
        initial_papers: published in the years -2 to 0, from 1 to 100 000.
        years: of an episode, from 1 to 10 000.
        steps_per_year: from 1 to 1000.
        references: papers that a draft cites, from 0 to 100.
        quality_max: q_max, the largest quality, above 0.
        sigma: standard deviation of an author's papers' qualities, 0 or more.
        power_law_exponent: k of the qualities of authors and initial papers, 0 or more.
        power_law_max: theta, the upper bound of that law, whose lower one is 1; above 1.
        quality_scale: from that law to qualities: "linear", "none", or a function of the numbers
            drawn, `power_law_max` and `quality_max`.
        quality_bounds: of drafts: "clipped", "truncated", or a function of random words, authors'
            qualities, `sigma` and `quality_max`.
        init_assignment: of initial papers to journals: "two_phase", "online", "random", or a
            function (see `ethogram.worlds.publishing.initial`).
        init_sources: whose impact factors of 2018 it aims at: "journals" or "all" sources.
        if_window: of the two years before: "union", "intersection", or a function of citations
            received, papers and the value of undefined ones.
        if_timing: "complete", the impact factor of the last complete year, or "running".
        undefined_if: impact factor of a journal without papers in the window; None is no number.
        update: "synchronous", all at once, or "sequential", one author after the other.

    """

    authors: int = setting(100, Size, static=True)
    journals: int = setting(20, Annotated[int, Field(ge=1, le=10_000)], static=True)
    initial_papers: int = setting(1000, Annotated[int, Field(ge=1, le=100_000)], static=True)
    years: int = setting(20, Annotated[int, Field(ge=1, le=10_000)], static=True)
    steps_per_year: int = setting(10, Annotated[int, Field(ge=1, le=1000)], static=True)
    references: int = setting(10, Annotated[int, Field(ge=0, le=100)], static=True)
    quality_max: Number = setting(15.0, Annotated[float, Field(gt=0)])
    sigma: Number = setting(1.0, Annotated[float, Field(ge=0)])  # of an author's papers
    power_law_exponent: Number = setting(1.5, Annotated[float, Field(ge=0)])  # k
    power_law_max: Number = setting(5.0, Annotated[float, Field(gt=1)])  # theta
    quality_scale: str | QualityScale = named("linear", QUALITY_SCALES)
    quality_bounds: str | DraftQuality = named("clipped", DRAFT_QUALITIES)  # of papers
    init_assignment: str | Assignment = named("two_phase", ASSIGNMENTS)
    init_sources: Sources = setting("journals", Sources, static=True)  # of the aim
    if_window: str | ImpactFactor = named("union", IMPACT_FACTORS)
    if_timing: Literal["complete", "running"] = setting(
        "complete", Literal["complete", "running"], static=True
    )
    undefined_if: Number | None = setting(None, float | None)  # without papers; None: no number
    update: Literal["synchronous", "sequential"] = setting(
        "synchronous", Literal["synchronous", "sequential"], static=True
    )

    @property
    def horizon(self) -> int:
        """Steps of an episode."""
        return self.years * self.steps_per_year

    @property
    def capacity(self) -> int:
        """The most papers that there can be in the end."""
        return self.initial_papers + self.authors * self.horizon

    @property
    def state_bytes(self) -> int:
        """Memory that a state needs."""
        papers = 6 * (self.capacity + self.authors)
        blocks = 2 * (INITIAL_YEARS + self.horizon)
        authors = self.authors * (self.horizon + 2 + self.references + 6)
        return 4 * (papers + blocks + authors + self.journals * (LEVELS + 8))

    @property
    def roles(self) -> dict[str, Role]:
        """Authors choose 0, to write anew, or a journal, from 1; editors the share to turn away.

        An author sees the quality and the rejections of the draft, then the impact factor of every
        journal; an editor the impact factor and the number of papers of the journal.  Where an
        impact factor is not defined it is -1.
        """
        inf = float("inf")
        author = Role(
            self.authors, Box(-1.0, inf, (2 + self.journals,)), Discrete(1 + self.journals)
        )
        editor = Role(self.journals, Box(-1.0, inf, (2,)), Box(ACCEPT_ALL, 1.0, ()))
        return {"author": author, "editor": editor}

    def reset(self, key: Key[Array, ""]) -> tuple[State, PerRole]:
        """Papers of the years -2 to 0, and authors that have published nothing.

        Raises:
            TooLarge: more papers could be published than 32 bits can number, or a state needs more
                memory than is free.

        """
        self._require_room()
        state = initial_state(self, key)
        return state, self.observe(state)

    def observe(self, state: State) -> PerRole:
        """See `roles`."""
        impact = self._seen_impact(state)
        quality = state.drafts.level * (self.quality_max / TOP)
        own = jnp.stack([quality, state.drafts.rejections.astype(float)], 1)
        alike = jnp.broadcast_to(impact, (self.authors, self.journals))
        papers = state.qualities.papers.astype(float)
        return {
            "author": jnp.concatenate([own, alike], 1),
            "editor": jnp.stack([impact, papers], 1),
        }

    def step(self, key: Key[Array, ""], state: State, action: PerRole) -> tuple[State, Outcome]:
        """Submit, decide, publish, cite, write; at the end of a year, count."""
        choice, share = action["author"], action["editor"]
        if self.update == "synchronous":
            everyone = jnp.ones(self.authors, bool)
            after = submit(self, key, state, choice, share, everyone)
        else:
            everyone = jnp.arange(self.authors)

            def one(state: State, author: Int[Array, ""]) -> tuple[State, None]:
                own = branch(key, author)
                return submit(self, own, state, choice, share, everyone == author), None

            after, _ = lax.scan(one, state, jnp.argsort(random_words(key, self.authors)))
        after = pass_time(after, self.steps_per_year, self.impact_factor)
        over = after.time >= self.horizon
        gained = after.citation_stats.h_index - state.citation_stats.h_index
        change = jnp.nan_to_num(after.impact) - jnp.nan_to_num(state.impact)
        agents = {"author": self.authors, "editor": self.journals}
        return after, Outcome(
            observation=self.observe(after),
            reward={"author": gained.astype(float), "editor": change},
            terminated={role: jnp.zeros(count, bool) for role, count in agents.items()},
            truncated={role: jnp.broadcast_to(over, count) for role, count in agents.items()},
            metrics={
                "published": after.literature.published - state.literature.published,
                "rejected": (after.rejected - state.rejected).sum(),
                "choice": choice,
                "accepted": (choice > 0) & (after.drafts.rejections == 0),
            },
        )

    def scene(self, trajectory: Transition) -> Scene:
        """The steps of the first episode, two frames each: what is written, what becomes of it."""
        episode = first_episode(self, trajectory)
        return record_steps(
            f"{self.authors} authors, {self.journals} journals",
            np.asarray(episode.next_state.quality[0]),
            np.asarray(episode.state.impact),
            jax.vmap(glimpse)(episode.outcome, episode.next_state),
            np.asarray(episode.state.time),
            self.steps_per_year,
        )

    def year(self, state: State) -> Int[Array, ""]:
        """The current year, from 1."""
        return 1 + state.time // self.steps_per_year

    def impact_factor(
        self, received: Int[Array, "journal"], papers: Int[Array, "journal"]
    ) -> Float[Array, "journal"]:
        """Of each journal, from citations received and papers of the two years before."""
        undefined = jnp.nan if self.undefined_if is None else self.undefined_if
        found = function_of(IMPACT_FACTORS, self.if_window)(received, papers, undefined)
        return of_shape("if_window", found, received.shape)

    def power_law(self, key: Key[Array, ""], size: int) -> Float[Array, "..."]:
        """Qualities of so many authors or papers, in [0, quality_max]."""
        exponent, largest = self.power_law_exponent, self.power_law_max
        drawn = power_law(key, (size,), exponent=exponent, largest=largest)
        scaled = function_of(QUALITY_SCALES, self.quality_scale)(drawn, largest, self.quality_max)
        return of_shape("quality_scale", scaled, drawn.shape)

    def draft_quality(
        self, key: Key[Array, ""], quality: Float[Array, "author"]
    ) -> Float[Array, "author"]:
        """Of a new draft of each author."""
        law = function_of(DRAFT_QUALITIES, self.quality_bounds)
        drawn = law(random_words(key, self.authors), quality, self.sigma, self.quality_max)
        return of_shape("quality_bounds", drawn, quality.shape)

    def levels(self, quality: Float[Array, "..."]) -> Int[Array, "..."]:
        """Qualities cut off at their bounds and rounded."""
        share = jnp.clip(quality / self.quality_max, 0.0, 1.0)
        return jnp.round(share * TOP).astype(jnp.int32)

    def _seen_impact(self, state: State) -> Float[Array, "journal"]:
        impact = state.impact
        if self.if_timing == "running":
            impact = self.impact_factor(state.received, state.window.sum(1))
        return jnp.where(jnp.isnan(impact), -1.0, impact)

    def _require_room(self) -> None:
        if self.capacity > LARGEST_INDEX:
            raise TooLarge(
                f"{self.authors} authors over {self.horizon} steps could publish "
                f"{readable_count(self.capacity)} papers; allowed: {readable_count(LARGEST_INDEX)} "
                "papers."
            )
        require_memory(
            f"A publishing system of {self.authors} authors, {self.journals} journals and up to "
            f"{readable_count(self.capacity)} papers",
            self.state_bytes,
        )
