"""Run a case: train its trials side by side, then watch them play greedily."""

from operator import itemgetter
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jax import Array
from jaxtyping import Key

from ethogram.campaign.case import Case, Cost
from ethogram.campaign.context import Context
from ethogram.core.keys import fold_in, trial_keys
from ethogram.core.memory import require_memory
from ethogram.core.pytrees import from_arrays, to_arrays
from ethogram.core.scene import RECORDED, grouped
from ethogram.learners.qlearning import QLearning, QLearningState
from ethogram.learners.train import train
from ethogram.studies.sharing.plan import Settings, learner_of
from ethogram.studies.sharing.validation import ACTS, TRANSITION_BYTES, Watched, watch
from ethogram.worlds.sharing.reward import REWARDS
from ethogram.worlds.sharing.scene import record

# Training, on one core of an ordinary machine; see benchmarks
AGENT_STEPS_PER_SECOND = 14e6
STEP_SECONDS = 6e-6  # per step of the trials side by side, however few agents there are
COMPILE_SECONDS = 3.0
PROCESS_BYTES = 500_000_000  # Python, JAX and compiled programs
RECORDED_BYTES = 32  # per recorded number, with the copies made on its way to the store
SHOWN = 10  # steps that figures 3.4 and 3.5 and tables 3.3 and 3.4 show


def cost(case: Case) -> Cost:
    """About what a case takes on one core.

    A checkpoint holds the tables twice more for a moment: as arrays, and as bytes.
    """
    settings = case.parsed(Settings)
    learner, per_episode = learner_of(settings), _agent_steps(settings)
    episodes = settings.episodes + settings.validation_episodes
    steps = episodes * settings.world.steps
    points = -(-settings.episodes // settings.record_every)
    recorded = settings.trials * (points + settings.validation_episodes * settings.world.agents)
    return Cost(
        seconds=COMPILE_SECONDS
        + steps * STEP_SECONDS
        + episodes * per_episode / AGENT_STEPS_PER_SECOND,
        bytes=PROCESS_BYTES
        + 3 * learner.table_bytes(settings.trials)
        + TRANSITION_BYTES * per_episode
        + RECORDED_BYTES * recorded,
    )


def run(case: Case, context: Context) -> dict[str, xr.Dataset]:
    """Train and validate all trials of a case.

    Returns:
        `results` (dimensions trial, point, episode, agent, step, act) and, as `scene`, `scene-2`,
        ..., the first validation episode of the first trials.

    Raises:
        TooLarge: the case would not fit in memory; the message names the size.

    """
    settings = case.parsed(Settings)
    keys = trial_keys(settings.seed, case.name, settings.trials)
    learner = learner_of(settings)
    require_memory(f"Q-learning with {learner.size(settings.trials)}", cost(case).bytes)
    state, curves = _train(learner, fold_in(keys, 0), settings, context)
    watched = watch(
        learner,
        state,
        fold_in(keys, 1),
        settings.validation_episodes,
        explore=settings.strategy == "random",
    )
    watched = jax.tree.map(np.asarray, watched)
    scenes = []
    for trial in range(min(RECORDED, settings.trials)):
        seen = jax.tree.map(itemgetter(trial), watched.first)
        scenes.append(record(seen.state, seen.reward, settings.world.resources))
    return {"results": _label(curves, watched, settings), **grouped(scenes)}


def _agent_steps(settings: Settings) -> int:
    """Steps of all agents of all trials in one episode."""
    return settings.trials * settings.world.steps * settings.world.agents


def _train(
    learner: QLearning, keys: Key[Array, "trials"], settings: Settings, context: Context
) -> tuple[QLearningState, dict[str, np.ndarray]]:
    """Train, from the last checkpoint if there is one; return the learning curves."""
    points = -(-settings.episodes // settings.record_every)
    sums = {name: np.zeros((points, settings.trials)) for name in ("return", "inequality")}
    state, start = learner.init(keys), 0
    found = context.restore()
    if found is not None:
        sums = {name: found.pop(f"sum.{name}") for name in sums}
        state = from_arrays(state, found)
        start = int(state.episode[0])

    def after_chunk(done: int, state: QLearningState, metrics: Any) -> None:
        return_ = metrics["episode_return"]["agent"][:, :, 0]
        point = np.arange(done - len(return_), done) // settings.record_every
        np.add.at(sums["return"], point, return_.mean(2))
        np.add.at(sums["inequality"], point, inequality(return_))
        context.progress(done, settings.episodes)
        context.checkpoint(
            lambda: to_arrays(state) | {f"sum.{name}": total for name, total in sums.items()}
        )

    state, _ = train(
        learner, keys, settings.episodes, state=state, start=start, after_chunk=after_chunk
    )
    episodes = np.bincount(np.arange(settings.episodes) // settings.record_every)
    return state, {name: total / episodes[:, None] for name, total in sums.items()}


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
    return np.asarray(reward(filling, world.agents, world.resources, literal=literal))


def _label(curves: dict[str, np.ndarray], watched: Watched, settings: Settings) -> xr.Dataset:
    points = len(curves["return"])
    last = np.minimum(np.arange(1, points + 1) * settings.record_every, settings.episodes)
    shown = slice(0, SHOWN)
    return xr.Dataset(
        {
            "training_return": (("trial", "point"), curves["return"].T.astype(np.float32)),
            "training_inequality": (
                ("trial", "point"),
                curves["inequality"].T.astype(np.float32),
            ),
            "validation_return": (("trial", "episode", "agent"), watched.return_),
            "displacement": (("trial", "step"), watched.mean.displacement),
            "communication": (("trial", "step"), watched.mean.communication),
            "reward": (("trial", "step"), watched.mean.reward),
            "acts": (("trial", "step", "act"), watched.mean.acts),
            "first_preference": (
                ("trial", "shown", "agent"),
                watched.first.state.preference[:, shown].astype(np.int32),
            ),
            "first_spoke": (("trial", "shown", "agent"), watched.first.state.spoke[:, shown]),
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
