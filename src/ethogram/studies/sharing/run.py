"""Run a case: train its trials side by side, then watch them play greedily."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jax import Array, lax
from jaxtyping import Float, Int, Key

from ethogram.campaign.case import Case, Cost
from ethogram.campaign.context import Context
from ethogram.core.keys import fold_in, trial_keys
from ethogram.core.rollout import Transition, rollout
from ethogram.core.trees import from_arrays, to_arrays
from ethogram.learners.qlearning import Learned, QLearning
from ethogram.learners.train import train
from ethogram.studies.sharing.plan import Settings, learner_of
from ethogram.worlds.sharing.reward import REWARDS
from ethogram.worlds.sharing.scene import record
from ethogram.worlds.sharing.world import Sharing, State

AGENT_STEPS_PER_SECOND = 12e6  # training, one core of an ordinary machine; see benchmarks
COMPILE_SECONDS = 3.0
SHOWN = 10  # steps that figures 3.4 and 3.5 and tables 3.3 and 3.4 show
ACTS = ("confirm, silent", "confirm, speaking", "change, silent", "change, speaking")


class Watched(NamedTuple):
    """What validation records of one trial."""

    return_: Float[Array, "episode agent"]
    displacement: Float[Array, "step"]  # eq. 3.14
    communication: Float[Array, "step"]  # eq. 3.15
    reward: Float[Array, "step"]  # eq. 3.16
    acts: Float[Array, "step act"]  # share of agents that did each of `ACTS`
    first: State  # states reached in the first episode, steps leading
    first_reward: Float[Array, "step agent"]


def cost(case: Case) -> Cost:
    """About what a case takes on one core."""
    settings = case.parsed(Settings)
    agent_steps = settings.episodes * settings.world.steps * settings.world.agents
    training = agent_steps * settings.trials / AGENT_STEPS_PER_SECOND
    return Cost(seconds=COMPILE_SECONDS + training, bytes=learner_of(settings).table_bytes)


def run(case: Case, context: Context) -> dict[str, xr.Dataset]:
    """Train and validate all trials of a case.

    Returns:
        `results` (dimensions trial, point, episode, agent, step, act) and `scene`, the first
        trial's first validation episode.

    """
    settings = case.parsed(Settings)
    keys = trial_keys(settings.seed, case.name, settings.trials)
    learner = learner_of(settings)
    learned, curves = _train(learner, fold_in(keys, 0), settings, context)
    watched = _watch(
        learner,
        learned,
        fold_in(keys, 1),
        settings.validation_episodes,
        jnp.float32(settings.strategy == "random"),
    )
    watched = jax.tree.map(np.asarray, watched)
    first = jax.tree.map(lambda part: part[0], watched.first)
    scene = record(first, watched.first_reward[0], settings.world.resources)
    return {"results": _label(curves, watched, settings), "scene": scene.to_dataset()}


def _train(
    learner: QLearning, keys: Key[Array, "trials"], settings: Settings, context: Context
) -> tuple[Learned, dict[str, np.ndarray]]:
    """Train, from the last checkpoint if there is one; return the learning curves."""
    points = -(-settings.episodes // settings.record_every)
    curves: dict[str, np.ndarray] = {
        name: np.zeros((points, settings.trials), np.float32) for name in ("return", "inequality")
    }
    learned = learner.init()
    start = 0
    found = context.restore()
    if found is not None:
        curves = {name: found.pop(f"curve.{name}") for name in curves}
        learned = from_arrays(learned, found)
        start = int(learned.episode)

    def after_chunk(done: int, learned: Learned, metrics: Any) -> None:
        point = (done - 1) // settings.record_every
        return_ = metrics["return"]["agent"]
        curves["return"][point] = return_.mean((0, 2))
        curves["inequality"][point] = inequality(return_).mean(0)
        context.progress(done, settings.episodes)
        context.checkpoint(
            lambda: to_arrays(learned) | {f"curve.{name}": curve for name, curve in curves.items()}
        )

    learned = train(
        learner,
        keys,
        learned,
        settings.episodes,
        chunk=settings.record_every,
        after_chunk=after_chunk,
        start=start,
    )
    return learned, curves


@eqx.filter_jit
def _watch(
    learner: QLearning,
    learned: Learned,
    keys: Key[Array, "trials"],
    episodes: int,
    epsilon: Float[Array, ""],
) -> Watched:
    """Validate every trial, one after the other to keep memory low."""
    world = learner.world
    assert isinstance(world, Sharing)

    def watch_one(trial: Int[Array, ""]) -> Watched:
        policy = learner.policy(learned, trial, epsilon)

        def play(key: Key[Array, ""]) -> Transition:
            return rollout(world, policy, key, world.steps)[1]

        return summarise(jax.vmap(play)(jax.random.split(keys[trial], episodes)), world)

    return lax.map(watch_one, jnp.arange(learner.trials))


def summarise(played: Transition, world: Sharing) -> Watched:
    """Reduce a trial's validation episodes (leading axes: episode, step) to what is kept."""
    state: State = played.state
    reward = played.outcome.reward["agent"]
    before = jnp.pad(state.preference[:, :-1], ((0, 0), (1, 0), (0, 0)))
    act = 2 * (state.preference != before) + state.spoke
    filling = played.outcome.metrics["filling"]
    even = world.agents / world.resources
    return Watched(
        return_=reward.sum(1),
        displacement=jnp.abs(filling - even).sum(-1).mean(0),
        communication=state.spoke.mean((0, 2)),
        reward=reward.mean((0, 2)),
        acts=(act[..., None] == jnp.arange(len(ACTS))).mean((0, 2)),
        first=jax.tree.map(lambda part: part[0], state),
        first_reward=reward[0],
    )


def inequality(return_: np.ndarray) -> np.ndarray:
    """Sample standard deviation over the agents, the last axis (eq. 3.11); 0 for one agent."""
    if return_.shape[-1] == 1:
        return np.zeros(return_.shape[:-1])
    return return_.std(-1, ddof=1)


def payoff(settings: Settings) -> np.ndarray:
    """What a place pays when shared by 1 to n_a agents (figure 3.1)."""
    world = settings.world
    reward = REWARDS[world.scenario]
    filling = jnp.arange(1, world.agents + 1.0)
    literal = world.reward == "literal"
    return np.asarray(reward(filling, world.agents, world.resources, literal))


def _label(curves: dict[str, np.ndarray], watched: Watched, settings: Settings) -> xr.Dataset:
    points = len(curves["return"])
    last = np.minimum(np.arange(1, points + 1) * settings.record_every, settings.episodes)
    shown = slice(0, SHOWN)
    return xr.Dataset(
        {
            "training_return": (("trial", "point"), curves["return"].T),
            "training_inequality": (("trial", "point"), curves["inequality"].T),
            "validation_return": (("trial", "episode", "agent"), watched.return_),
            "displacement": (("trial", "step"), watched.displacement),
            "communication": (("trial", "step"), watched.communication),
            "reward": (("trial", "step"), watched.reward),
            "acts": (("trial", "step", "act"), watched.acts),
            "first_preference": (
                ("trial", "shown", "agent"),
                watched.first.preference[:, shown].astype(np.int32),
            ),
            "first_spoke": (("trial", "shown", "agent"), watched.first.spoke[:, shown]),
            "payoff": (("filling",), payoff(settings)),
        },
        coords={
            "point": ("point", last, {"long_name": "training episodes", "units": "episode"}),
            "step": ("step", np.arange(1, settings.world.steps + 1)),
            "act": ("act", list(ACTS)),
            "filling": ("filling", np.arange(1, settings.world.agents + 1)),
        },
        attrs={
            "agents": settings.world.agents,
            "resources": settings.world.resources,
            "largest_reward": float(payoff(settings).max()),
        },
    )
