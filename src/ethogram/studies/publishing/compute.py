"""Run a case: train who learns, then watch the system of every trial, year by year."""

from collections.abc import Callable
from operator import itemgetter
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jax import Array, lax
from jaxtyping import Float, Int, Key

from ethogram.campaign.case import Case, Cost
from ethogram.campaign.context import Context
from ethogram.core.keys import branch, fold_in, trial_keys
from ethogram.core.memory import require_memory
from ethogram.core.recorded import RECORDED
from ethogram.core.rollout import Policy
from ethogram.core.scene import Scene
from ethogram.core.world import PerRole, World
from ethogram.learners.base import Metrics
from ethogram.learners.qlearning import QLearning, QLearningState
from ethogram.studies.publishing import records
from ethogram.studies.publishing.plan import (
    Settings,
    condition_of,
    learner_of,
    policy_of,
    world_of,
)
from ethogram.studies.readings import DEFAULT
from ethogram.studies.training import Arrays, train_case
from ethogram.worlds.publishing import Publishing
from ethogram.worlds.publishing.indicators import INDICATORS
from ethogram.worlds.publishing.learnable import LearnablePublishing
from ethogram.worlds.publishing.literature import first_block
from ethogram.worlds.publishing.scene import Glimpse, glimpse, record
from ethogram.worlds.publishing.state import State
from ethogram.worlds.publishing.world import TOP

# On one core of an ordinary machine; see benchmarks
AUTHOR_STEPS_PER_SECOND = 8e5
STEP_SECONDS = 1.2e-4  # per step, however few authors there are
COMPILE_SECONDS = 15.0
PROCESS_BYTES = 600_000_000  # Python, JAX and compiled programs
RECORDED_BYTES = 32  # per recorded number, with the copies made on its way to the store
QUALITY_BINS = 30  # of the recorded distributions


class Year(eqx.Module):
    """What is recorded at the end of a year; the first is that of the initial state."""

    indicators: dict[str, Float[Array, "agent"]]
    papers: Int[Array, "journal"]  # of this year
    quality: Float[Array, "journal"]  # the sum of their qualities
    histogram: Int[Array, "bin"]  # of their qualities
    stuck: Float[Array, ""]  # share of the authors whose draft was rejected more than ten times


class Played(eqx.Module):
    """A trial from its first state to its last."""

    author_quality: Float[Array, "author"]
    start: Year
    years: Year  # with a leading axis of years
    steps: Glimpse  # with leading axes of years and steps


def cost(case: Case) -> Cost:
    """About what a case takes on one core."""
    settings = case.parsed(Settings)
    world, learner = world_of(settings), learner_of(settings)
    per_episode = settings.trials * world.authors * world.horizon
    trained = 0 if learner is None else settings.episodes
    turns = world.authors if settings.world.update == "sequential" else 1
    agents = world.authors + 6 * world.journals + QUALITY_BINS
    recorded = settings.trials * (world.years + 1) * agents
    recorded += settings.trials * trained  # what is earned in each episode
    steps = world.horizon * (trained + settings.trials)  # those watched are played one by one
    work = (1 + 2 * trained) * per_episode
    seen = 4 * world.authors * (world.references + world.journals)
    return Cost(
        seconds=COMPILE_SECONDS + turns * (steps * STEP_SECONDS + work / AUTHOR_STEPS_PER_SECOND),
        bytes=PROCESS_BYTES
        + 2 * (world.state_bytes + seen) * (1 if learner is None else settings.trials)
        + (0 if learner is None else 3 * learner.table_bytes(settings.trials))
        + RECORDED_BYTES * recorded,
    )


def run(case: Case, context: Context) -> dict[str, xr.Dataset]:
    """Train, if anybody learns, and watch all trials of a case.

    Returns:
        `results` (dimensions trial, year, author, journal, bin, episode; see `records`) and, under
        the default reading, as `scene`, `scene-2`, ..., the first trials.

    Raises:
        TooLarge: the case would not fit in memory; the message names the size.

    """
    settings = case.parsed(Settings)
    condition = condition_of(settings)
    require_memory(f"The publishing system of {condition.description}", cost(case).bytes)
    keys = trial_keys(settings.seed, case.name, settings.trials)
    learner = learner_of(settings)
    curve: np.ndarray | None = None
    if learner is None:
        watched = _watch(world_of(settings), Always(policy_of(settings)), fold_in(keys, 1))
    else:
        for_training = fold_in(keys, 0)
        state, curves = train_case(
            learner, for_training, for_training, settings.episodes, context, _curves
        )
        curve = curves["return"]
        watched = _watch(learner.world, Greedy(learner, state), fold_in(keys, 1))
    played = jax.tree.map(np.asarray, watched)
    found = {"results": _label(settings, played, curve)}
    if condition.reading == DEFAULT:
        first = range(min(RECORDED, settings.trials))
        shown = (_scene(condition.description, played, trial) for trial in first)
        found |= records.scenes(shown, settings.world.steps_per_year)
    return found


def _scene(words: str, played: Played, trial: int) -> Scene:
    seen = jax.tree.map(itemgetter(trial), played)
    impact = seen.years.indicators["impact_factor"]  # at the end of each year; known in the next
    impact = np.concatenate([seen.start.indicators["impact_factor"][None], impact[:-1]])
    return record(words, seen.author_quality, impact, seen.steps)


class Always(eqx.Module):
    """The same policy in every trial."""

    policy: Policy

    def __call__(self, trial: Int[Array, ""]) -> Policy:
        """Whatever the trial."""
        del trial
        return self.policy


class Greedy(eqx.Module):
    """In every trial, what was learned in it, without exploration."""

    learner: QLearning
    state: QLearningState

    def __call__(self, trial: Int[Array, ""]) -> Policy:
        """The greedy policy of a trial."""
        return self.learner.policy(jax.tree.map(lambda part: part[trial], self.state))


@eqx.filter_jit
def _watch(
    world: World, policy: Callable[[Int[Array, ""]], Policy], keys: Key[Array, "trial"]
) -> Played:
    """Play all trials, one after the other: the arrays of one stay near the processor."""

    def one(at: tuple[Key[Array, ""], Int[Array, ""]]) -> Played:
        key, trial = at
        return _play(world, policy(trial), key)

    return lax.map(one, (keys, jnp.arange(len(keys))))


def _play(world: World, policy: Policy, key: Key[Array, ""]) -> Played:
    system = world.system if isinstance(world, LearnablePublishing) else world
    assert isinstance(system, Publishing)
    for_start, for_steps = jax.random.split(key)
    start, seen = world.reset(for_start)

    def step(at: tuple[Any, PerRole], key: Key[Array, ""]) -> tuple[Any, Glimpse]:
        state, seen = at
        for_policy, for_world = branch(key, 0), branch(key, 1)
        after, outcome = world.step(for_world, state, policy(for_policy, seen))
        return (after, outcome.observation), glimpse(outcome, _system(after))

    def year(at: tuple[Any, PerRole], keys: Key[Array, "step"]) -> tuple[Any, Any]:
        at, steps = lax.scan(step, at, keys)
        return at, (_look(system, _system(at[0]), len(keys) * system.authors), steps)

    keys = jax.random.split(for_steps, (system.years, system.steps_per_year))
    _, (years, steps) = lax.scan(year, (start, seen), keys)
    first = _system(start)
    return Played(first.quality, _look(system, first, system.initial_papers), years, steps)


def _system(state: Any) -> State:
    """The publishing system's state, also in that of the world of those who learn."""
    found = getattr(state, "system", state)
    assert isinstance(found, State)
    return found


def _look(world: Publishing, state: State, most: int) -> Year:
    """What is recorded of a year that has just ended, in which there were `most` papers or fewer.

    Papers of the initial years count as those of the year before the first.
    """
    papers, ended = state.literature, state.time // world.steps_per_year
    begun = papers.start[first_block(ended, world.steps_per_year)]
    first = jnp.where(ended > 0, begun, 0)
    number = first + jnp.arange(most)
    there = number < papers.published
    level = papers.level[number]
    journal = jnp.where(there, papers.journal[number], world.journals)  # beyond: dropped
    bin_ = jnp.where(there, level * QUALITY_BINS // (TOP + 1), QUALITY_BINS)
    quality = level * (world.quality_max / TOP)
    none = jnp.zeros(world.journals)
    return Year(
        indicators={name: INDICATORS[name].measure(state) for name in INDICATORS},
        papers=none.astype(int).at[journal].add(1, mode="drop"),
        quality=none.at[journal].add(quality, mode="drop"),
        histogram=jnp.zeros(QUALITY_BINS, int).at[bin_].add(1, mode="drop"),
        stuck=(state.drafts.rejections > 10).mean(),
    )


def _curves(metrics: Metrics) -> Arrays:
    ((_, return_),) = metrics["episode_return"].items()
    return {"return": return_[:, :, 0].mean(2)}


def _label(settings: Settings, played: Played, curve: np.ndarray | None) -> xr.Dataset:
    world, condition = world_of(settings), condition_of(settings)
    start = jax.tree.map(lambda part: np.asarray(part)[:, None], played.start)
    every = jax.tree.map(lambda *parts: np.concatenate(parts, 1), start, played.years)
    flows = {name: getattr(every, name) for name in ("papers", "quality", "histogram")}
    quality = np.asarray(played.author_quality)
    found: dict[str, Any] = records.results(
        condition, flows, every.indicators, quality, every.stuck
    )
    if curve is not None and condition.reading == DEFAULT:
        found["training_return"] = (("trial", "episode"), curve.T.astype(np.float32))
    edges = np.linspace(0, float(world.quality_max), QUALITY_BINS + 1)
    return xr.Dataset(
        found,
        coords=records.coordinates(condition, world.years, edges),
        attrs={
            "author": condition.author,
            "editor": condition.editor,
            "size": list(condition.size),
            "reading": condition.reading,
            "years": world.years,
            "steps_per_year": world.steps_per_year,
            "quality_max": float(world.quality_max),
            "episodes": settings.episodes if curve is not None else 0,
        },
    )
