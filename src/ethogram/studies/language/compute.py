"""Run a case: train its trials one after the other, and watch each of them play.

One after the other, because on a processor trials side by side are slower than the same trials
in turn (their weights leave the cache), and need the memory of all at once.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from jaxtyping import Float

from ethogram.campaign.case import Case, Cost
from ethogram.campaign.context import Context
from ethogram.core.keys import fold_in, trial_keys
from ethogram.core.memory import require_memory
from ethogram.core.pytrees import from_arrays, to_arrays
from ethogram.core.recorded import RECORDED, grouped
from ethogram.core.specs import role_specs
from ethogram.core.wrappers import unwrapped
from ethogram.learners.base import Metrics
from ethogram.learners.critic_input import input_count, network_sizes
from ethogram.learners.maddpg import MADDPG, MADDPGState
from ethogram.learners.train import Diverged
from ethogram.studies.language.plan import Settings, condition_of, learner_of, plays
from ethogram.studies.language.validation import MODES, Watched, watch, watched_bytes
from ethogram.studies.training import (
    Arrays,
    learning_curve,
    named,
    named_so,
    train_case,
    training_points,
    trials_in_turn,
)
from ethogram.worlds.language.scene import record

COMPILE_SECONDS = 30.0
PROCESS_BYTES = 800_000_000  # Python, JAX and compiled programs
# On one core of an ordinary machine; see benchmarks
MULTIPLICATIONS_PER_SECOND = 25e9  # of networks
PLAY_SECONDS = 15e-6  # per agent and step of the episodes side by side, however small
LEARN_SECONDS = 4e-4  # per agent and update, however small
RECORDED_BYTES = 32  # per recorded number, with the copies made on its way to the store
EPISODE = "episode."  # what names of the states that a scene shows begin with
RETURNS = ("validation", "noise_free", "discounted", "silenced", "scrambled")
BUFFER = "replay_buffer.rows"


def cost(case: Case) -> Cost:
    """About what a case takes on one core.

    A checkpoint holds the replay buffer twice more for a moment: as an array, and as bytes.
    """
    settings = case.parsed(Settings)
    learner, validated = learner_of(settings), settings.validation_episodes
    training = plays(settings) * update_seconds(learner)
    watching = len(MODES) * _play_seconds(learner, 2 * validated)  # with noise and without
    recorded = settings.trials * (_points(settings) + 5 * validated)
    return Cost(
        seconds=COMPILE_SECONDS + settings.trials * (training + watching),
        bytes=PROCESS_BYTES
        + 3 * learner.replay_bytes
        + 4 * learner.network_bytes  # gradients, and those on their way to a checkpoint
        + _batch_bytes(learner)
        + RECORDED_BYTES * recorded
        + watched_bytes(learner, validated),
    )


def update_seconds(learner: MADDPG) -> float:
    """About how long an update takes: episodes side by side, then learning."""
    playing = _play_seconds(learner, learner.episodes_per_update)
    return playing + learner.updates_per_iteration * _learn_seconds(learner)


def run(case: Case, context: Context) -> dict[str, xr.Dataset]:
    """Train and validate all trials of a case.

    Returns:
        `results` (dimensions trial, point, episode, talker, guided, target, word, listener) and, as
        `scene`, `scene-2`, ..., the first trials' first validation episodes.

    Raises:
        TooLarge: the case would not fit in memory; the message names the size.
        Diverged: a loss is not finite; the message names trial, agent and update.

    """
    settings = case.parsed(Settings)
    learner = learner_of(settings)
    require_memory(f"MADDPG with {condition_of(settings).description}", cost(case).bytes)
    keys = trial_keys(settings.seed, case.name, settings.trials)
    watched: Watched | None = None

    def curves(metrics: Metrics) -> Arrays:
        return {"return": _earned(learner, metrics["episode_return"])}

    def one(number: int, context: Context) -> Arrays:
        nonlocal watched
        for_init, for_training, for_watching = (fold_in(keys[number], use) for use in range(3))
        try:
            state, found = train_case(
                learner,
                for_init,
                for_training,
                plays(settings),
                context,
                curves,
                pack=_pack,
                unpack=_unpack,
            )
        except Diverged as error:
            raise Diverged(f"Trial {number}: {error}") from error
        watched = watch(learner, state, for_watching, settings.validation_episodes)
        kept = _kept(found["return"], watched, settings)
        if number < RECORDED:
            kept |= named(EPISODE, to_arrays((watched.start, watched.states)))
        return kept

    finished = trials_in_turn(settings.trials, context, one)
    assert watched is not None  # the last trial is never in a checkpoint
    like = watched.start, watched.states
    scenes = [record(*from_arrays(like, named_so(EPISODE, kept))) for kept in finished[:RECORDED]]
    return {"results": _label(finished, settings), **grouped(scenes)}


def _earned(learner: MADDPG, returns: Arrays) -> Float[np.ndarray, "update episode"]:
    """Returns of all agents; talkers that learn nothing together earn as much as the movers do.

    Each robot is guided by one other, so every distance counts for one mover and one talker.
    """
    total = sum(part.sum(-1) for part in returns.values())
    return total * (len(unwrapped(learner.world).roles) / len(returns))


def _kept(
    returns: Float[np.ndarray, "update episode"], watched: Watched, settings: Settings
) -> Arrays:
    """What is stored of a trial."""
    words = condition_of(settings).vocabulary_size + 1  # the rest is padding
    kept = {name: np.asarray(getattr(watched, name)) for name in RETURNS}
    # the last episodes played may be more than asked for
    played = returns.reshape(-1)[: settings.episodes]
    return kept | {
        "training": learning_curve(played, settings.record_every),
        "meaning": np.asarray(watched.meaning)[..., :words],
        "influence": np.asarray(watched.influence),
    }


def _pack(state: MADDPGState) -> Arrays:
    """A state for a checkpoint: of the replay buffer, what is filled."""
    arrays = to_arrays(state)
    filled = min(int(state.replay_buffer.added), len(arrays[BUFFER]))
    return arrays | {BUFFER: arrays[BUFFER][:filled]}


def _unpack(like: MADDPGState, arrays: Arrays) -> MADDPGState:
    """The state that `_pack` was given."""
    empty = like.replay_buffer.rows.shape[0] - len(arrays[BUFFER])
    rows = np.pad(arrays[BUFFER], ((0, empty), (0, 0)))
    return from_arrays(like, arrays | {BUFFER: rows})


def _label(finished: Sequence[Arrays], settings: Settings) -> xr.Dataset:
    condition = condition_of(settings)
    names = (*RETURNS, "training", "meaning", "influence")
    found = {name: np.stack([kept[name] for kept in finished]) for name in names}
    trial_episode = ("trial", "episode")
    return xr.Dataset(
        {f"{name}_return": (trial_episode, found[name].astype(np.float32)) for name in RETURNS}
        | {
            "training_return": (("trial", "point"), found["training"].astype(np.float32)),
            "meaning": (("trial", "talker", "guided", "target", "word"), found["meaning"]),
            "influence": (("trial", "talker", "listener"), found["influence"]),
        },
        coords={"point": training_points(settings.episodes, settings.record_every)},
        attrs={
            "robots": condition.robots,
            "targets": condition.targets,
            "talkers": condition.talkers,
            "vocabulary_size": condition.vocabulary_size,
            "silence": condition.silence,
            "discount": settings.learner.discount,
        },
    )


def _points(settings: Settings) -> int:
    return -(-settings.episodes // settings.record_every)


class _Networks(NamedTuple):
    """How large those of a role are."""

    agents: int
    actor: int  # numbers of each
    critic: int


def _networks(learner: MADDPG) -> list[_Networks]:
    roles, hidden = role_specs(learner.world), (learner.hidden_size, learner.hidden_size)
    return [
        _Networks(role.agents, *network_sizes(roles, name, hidden)) for name, role in roles.items()
    ]


def _play_seconds(learner: MADDPG, episodes: int) -> float:
    """About how long episodes side by side take."""
    agents = sum(role.agents for role in role_specs(learner.world).values())
    actors = sum(role.agents * role.actor for role in _networks(learner))
    each = PLAY_SECONDS * agents + episodes * actors / MULTIPLICATIONS_PER_SECOND
    return learner.world.horizon * each


def _learn_seconds(learner: MADDPG) -> float:
    """About how long an update of all agents takes: networks forward and back, and the rest."""
    networks = _networks(learner)
    agents = sum(role.agents for role in networks)
    actors = sum(role.agents * role.actor for role in networks)
    critics = sum(role.agents * role.critic for role in networks)
    per_row = 6 * critics + (agents + 3) * actors
    return LEARN_SECONDS * agents + learner.batch_size * per_row / MULTIPLICATIONS_PER_SECOND


def _batch_bytes(learner: MADDPG) -> int:
    """What a minibatch takes: the critic's inputs, a few times, and as many again to come."""
    return 8 * 4 * learner.batch_size * input_count(role_specs(learner.world))
