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

import dataclasses
from typing import Annotated, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.scipy.special import ndtr, ndtri
from jaxtyping import Bool, Float, Int, Key
from pydantic import Field

from ethogram.core.batching import add, in_any_copy, put, take
from ethogram.core.errors import TooLarge
from ethogram.core.keys import branch, gaussian, unit, words
from ethogram.core.memory import readable_count, require_memory
from ethogram.core.rollout import first_episode
from ethogram.core.scene import Scene
from ethogram.core.settings import Number, setting
from ethogram.core.spaces import LARGEST_INDEX, Box, Discrete
from ethogram.core.world import Outcome, PerRole, Role, Transition, World
from ethogram.worlds.publishing.citations import Standing, cite, rise
from ethogram.worlds.publishing.impact_2018 import Sources
from ethogram.worlds.publishing.initial import (
    Assignment,
    Scale,
    initial_references,
    place,
    power_law,
)
from ethogram.worlds.publishing.journals import Qualities, empty, impact_factor
from ethogram.worlds.publishing.literature import (
    INITIAL_YEARS,
    LEVELS,
    TOGETHER,
    Literature,
    append,
    begin,
    chosen_first,
    distinct,
    draw,
    draws_for,
    first_block,
)
from ethogram.worlds.publishing.scene import glimpse, record_steps
from ethogram.worlds.publishing.state import Drafts, State

ACCEPT_ALL = -1.0  # an editor's action below 0: whatever the quality
TOP = LEVELS - 1


class Out(eqx.Module):
    """What changes as papers come out."""

    literature: Literature
    standing: Standing
    qualities: Qualities
    received: Int[Array, "journal"]


Bounds = Literal["clipped", "truncated"]
Size = Annotated[int, Field(ge=1, le=100_000)]


class Publishing(World):
    """Authors, editors and journals."""

    authors: int = setting(100, Size, static=True)
    journals: int = setting(20, Annotated[int, Field(ge=1, le=10_000)], static=True)
    initial_papers: int = setting(1000, Annotated[int, Field(ge=1, le=100_000)], static=True)
    years: int = setting(20, Annotated[int, Field(ge=1, le=10_000)], static=True)
    steps_per_year: int = setting(10, Annotated[int, Field(ge=1, le=1000)], static=True)
    references: int = setting(10, Annotated[int, Field(ge=0, le=100)], static=True)
    quality_max: Number = setting(15.0, Annotated[float, Field(gt=0)])
    sigma: Number = setting(1.0, Annotated[float, Field(ge=0)])  # of an author's papers
    slope: Number = setting(1.5, Annotated[float, Field(ge=0)])  # k of the power law
    greatest: Number = setting(5.0, Annotated[float, Field(gt=1)])  # theta of the power law
    quality_scale: Scale = setting("linear", Scale, static=True)
    quality_bounds: Bounds = setting("clipped", Bounds, static=True)  # of papers
    init_assignment: Assignment = setting("two_phase", Assignment, static=True)
    init_sources: Sources = setting("journals", Sources, static=True)  # of the aim
    if_window: Literal["union", "intersection"] = setting(
        "union", Literal["union", "intersection"], static=True
    )
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
        for_authors, for_papers, for_years, for_cited, for_place, for_drafts = jax.random.split(
            key, 6
        )
        quality = self._power_law(for_authors, self.authors)
        level = self._levels(self._power_law(for_papers, self.initial_papers))
        year = jnp.sort(jax.random.randint(for_years, (self.initial_papers,), 0, INITIAL_YEARS))
        cited = initial_references(for_cited, level, year, self.references)
        journal = place(
            for_place, year, cited, self.journals, self.init_assignment, self.init_sources
        )
        counts = (cited >= 0) & (year[:, None] == INITIAL_YEARS - 1)
        counts &= take(year, jnp.maximum(cited, 0)) < INITIAL_YEARS - 1
        nobody = jnp.zeros(self.journals, jnp.int32)
        room = self.capacity + self.authors  # a step writes as many entries as there are authors
        in_year = jnp.zeros(self.journals * INITIAL_YEARS, jnp.int32)
        in_year = add(in_year, journal * INITIAL_YEARS + year, jnp.ones_like(year))
        papers = in_year.reshape(self.journals, INITIAL_YEARS)
        cited_in = take(journal, jnp.maximum(cited, 0))
        received = add(nobody, cited_in, counts.astype(jnp.int32))
        none = jnp.zeros(self.authors, jnp.int32)
        state = State(
            quality=quality,
            drafts=Drafts(none, jnp.full((self.authors, self.references), -1), none),
            standing=Standing(none, none, jnp.zeros((self.authors, self.horizon + 2), jnp.int32)),
            literature=begin(level, year, journal, cited, room, INITIAL_YEARS + self.horizon),
            qualities=empty(self.journals).add(journal, level, level >= 0),
            window=papers[:, :0:-1],
            this_year=nobody,
            received=nobody,
            impact=self._impact(received, papers[:, :-1].sum(1)),
            rejected=nobody,
            time=jnp.int32(0),
        )
        everyone = jnp.ones(self.authors, bool)
        drafts = self._write(
            for_drafts, quality, state.drafts, state.literature, self.year(state), everyone
        )
        state = eqx.tree_at(lambda s: s.drafts, state, drafts)
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
            after = self._act(key, state, choice, share, everyone)
        else:
            everyone = jnp.arange(self.authors)

            def one(state: State, author: Int[Array, ""]) -> tuple[State, None]:
                own = branch(key, author)
                return self._act(own, state, choice, share, everyone == author), None

            after, _ = lax.scan(one, state, jnp.argsort(words(key, self.authors)))
        after = self._close(after)
        over = after.time >= self.horizon
        gained = after.standing.h_index - state.standing.h_index
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
        episode = first_episode(trajectory)
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

    # The parts of a step

    def _act(
        self,
        key: Key[Array, ""],
        state: State,
        choice: Int[Array, "author"],
        share: Float[Array, "journal"],
        acting: Bool[Array, "author"],
    ) -> State:
        """What those who act do; drafts cite what there was before."""
        journal = jnp.maximum(choice - 1, 0)
        submits = acting & (choice > 0)
        threshold = jnp.where(share < 0, -jnp.inf, state.qualities.quantile(jnp.maximum(share, 0)))
        accepted = submits & (state.drafts.level >= take(threshold, journal))
        refused = submits & ~accepted
        out = self._come_out(state, journal, accepted)
        papers = out.literature
        writes = accepted | (acting & (choice == 0))
        known = papers.as_of(state.literature)
        drafts = self._write(key, state.quality, state.drafts, known, self.year(state), writes)
        return State(
            quality=state.quality,
            drafts=Drafts(drafts.level, drafts.cited, drafts.rejections + refused),
            standing=out.standing,
            literature=papers,
            qualities=out.qualities,
            window=state.window,
            this_year=add(state.this_year, journal, accepted.astype(jnp.int32)),
            received=out.received,
            impact=state.impact,
            rejected=add(state.rejected, journal, refused.astype(jnp.int32)),
            time=state.time,
        )

    def _come_out(
        self, state: State, journal: Int[Array, "author"], accepted: Bool[Array, "author"]
    ) -> "Out":
        """Publish the accepted drafts, some at a time, and count what they cite."""
        waiting, count = chosen_first(accepted), accepted.sum()
        some = min(self.authors, TOGETHER)
        tally = state.standing.tally.at[:, 0].add(accepted.astype(jnp.int32))
        standing = eqx.tree_at(lambda s: s.tally, state.standing, tally)
        out = Out(state.literature, standing, state.qualities, state.received)

        def publish(at: tuple[Out, Array]) -> tuple[Out, Array]:
            out, done = at
            number = done + jnp.arange(some)
            author = take(waiting, jnp.minimum(number, self.authors - 1))
            due, place = number < count, take(journal, author)
            level = jnp.where(due, take(state.drafts.level, author), 0)
            cited = jnp.where(due[:, None], state.drafts.cited[author], -1)
            papers = append(out.literature, state.time, author, place, level, due.sum())
            standing, papers = cite(papers, out.standing, cited)
            received = out.received + self._in_window(papers, self.year(state), cited)
            return Out(
                papers, standing, out.qualities.add(place, level, due), received
            ), done + some

        begin = out, jnp.int32(0)
        out, _ = lax.while_loop(lambda at: in_any_copy(at[1] < count), publish, begin)
        papers = out.literature
        # where the next block starts: outside the loop, as also a step without papers has an end
        start = put(papers.start, INITIAL_YEARS + state.time + 1, papers.published)
        papers = dataclasses.replace(papers, start=start)
        return Out(papers, rise(out.standing), out.qualities, out.received)

    def _in_window(
        self, papers: Literature, year: Int[Array, ""], cited: Int[Array, "draft reference"]
    ) -> Int[Array, "journal"]:
        """Citations, by the cited papers' journals, of papers of the two years before."""
        first, end = (
            take(papers.start, first_block(at, self.steps_per_year)) for at in (year - 2, year)
        )
        counts = (cited >= first) & (cited < end)
        journal = take(papers.journal, jnp.maximum(cited, 0))
        return add(jnp.zeros(self.journals, jnp.int32), journal, counts.astype(jnp.int32))

    def _close(self, state: State) -> State:
        """Let time pass; a year that ends gives its impact factors and becomes the year before."""
        time = state.time + 1
        ends = time % self.steps_per_year == 0
        shifted = jnp.stack([state.this_year, state.window[:, 0]], 1)
        impact = self._impact(state.received, state.window.sum(1))
        return eqx.tree_at(
            lambda s: (s.window, s.this_year, s.received, s.impact, s.time),
            state,
            (
                jnp.where(ends, shifted, state.window),
                jnp.where(ends, 0, state.this_year),
                jnp.where(ends, 0, state.received),
                jnp.where(ends, impact, state.impact),
                time,
            ),
        )

    def _write(
        self,
        key: Key[Array, ""],
        quality: Float[Array, "author"],
        drafts: Drafts,
        known: Literature,
        year: Int[Array, ""],
        who: Bool[Array, "author"],
    ) -> Drafts:
        """New drafts of those who write, the old ones of the others."""
        level = self._levels(self._draft_quality(branch(key, 0), quality))
        largest = max(self.authors, self.initial_papers)
        drawn = draw(known, year, self.steps_per_year, draws_for(self.references), largest)
        needed = jnp.where(who, jnp.minimum(self.references, known.citable), 0)
        cited = distinct(branch(key, 1), drawn, needed, self.references)
        return Drafts(
            jnp.where(who, level, drafts.level),
            jnp.where(who[:, None], cited, drafts.cited),
            jnp.where(who, 0, drafts.rejections),
        )

    # What it is made of

    def _impact(
        self, received: Int[Array, "journal"], papers: Int[Array, "journal"]
    ) -> Float[Array, "journal"]:
        if self.if_window == "intersection":  # no paper is of two years
            received = jnp.zeros_like(received)
        undefined = jnp.nan if self.undefined_if is None else self.undefined_if
        return impact_factor(received, papers, undefined)

    def _seen_impact(self, state: State) -> Float[Array, "journal"]:
        impact = state.impact
        if self.if_timing == "running":
            impact = self._impact(state.received, state.window.sum(1))
        return jnp.where(jnp.isnan(impact), -1.0, impact)

    def _power_law(self, key: Key[Array, ""], size: int) -> Float[Array, "..."]:
        return power_law(
            key,
            (size,),
            slope=self.slope,
            greatest=self.greatest,
            quality_max=self.quality_max,
            scale=self.quality_scale,
        )

    def _draft_quality(
        self, key: Key[Array, ""], quality: Float[Array, "author"]
    ) -> Float[Array, "author"]:
        """Normal about each author's quality; what lies out of bounds is cut off, or not drawn."""
        chance = words(key, self.authors)
        if self.quality_bounds == "clipped":
            return quality + self.sigma * gaussian(chance)
        sigma = jnp.maximum(self.sigma, 1e-6)
        low, high = (ndtr((bound - quality) / sigma) for bound in (0.0, self.quality_max))
        return quality + sigma * ndtri(low + unit(chance) * (high - low))

    def _levels(self, quality: Float[Array, "..."]) -> Int[Array, "..."]:
        share = jnp.clip(quality / self.quality_max, 0.0, 1.0)
        return jnp.round(share * TOP).astype(jnp.int32)

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
