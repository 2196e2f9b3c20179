"""Run a case: train its trials side by side, then watch them play greedily."""

from operator import itemgetter

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ethogram.campaign.case import Case, Cost
from ethogram.campaign.context import Context
from ethogram.core.keys import fold_in, trial_keys
from ethogram.core.memory import require_memory
from ethogram.core.recorded import RECORDED, grouped
from ethogram.learners.base import Metrics
from ethogram.studies.sharing.plan import Settings, condition_of, learner_of
from ethogram.studies.sharing.validation import ACTS, TRANSITION_BYTES, Watched, watch
from ethogram.studies.training import Arrays, learning_curve, train_case, training_points
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
    for_training = fold_in(keys, 0)
    state, curves = train_case(
        learner, for_training, for_training, settings.episodes, context, _curves
    )
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


def _curves(metrics: Metrics) -> Arrays:
    return_ = metrics["episode_return"]["agent"][:, :, 0]
    return {"return": return_.mean(2), "inequality": inequality(return_)}


def inequality(return_: np.ndarray) -> np.ndarray:
    """Sample standard deviation over the agents, the last axis (eq. 3.11); 0 for one agent."""
    if return_.shape[-1] == 1:
        return np.zeros(return_.shape[:-1])
    return return_.std(-1, ddof=1)


def payoff(settings: Settings) -> np.ndarray:
    """What a place pays when shared by 1 to n_a agents (figure 3.1)."""
    world = settings.world
    reward = REWARDS[condition_of(settings).scenario]
    filling = jnp.arange(1, world.agents + 1.0)
    literal = world.reward == "literal"
    return np.asarray(reward(filling, world.agents, world.resources, literal=literal))


def _label(curves: Arrays, watched: Watched, settings: Settings) -> xr.Dataset:
    points = {
        name: learning_curve(values, settings.record_every).T.astype(np.float32)
        for name, values in curves.items()
    }
    shown = slice(0, SHOWN)
    return xr.Dataset(
        {
            "training_return": (("trial", "point"), points["return"]),
            "training_inequality": (("trial", "point"), points["inequality"]),
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
            "point": training_points(settings.episodes, settings.record_every),
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
