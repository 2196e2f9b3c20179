"""Run a case: train its trials, then watch what their drivers do."""

from operator import itemgetter
from typing import Any

import jax
import numpy as np
import xarray as xr
from jax import Array
from jaxtyping import Key

from ethogram.campaign.case import Case, Cost
from ethogram.campaign.context import Context
from ethogram.core.keys import fold_in, trial_keys
from ethogram.core.memory import require_memory
from ethogram.core.recorded import grouped
from ethogram.learners.base import Metrics, Trials
from ethogram.learners.ppo import PPOState
from ethogram.studies.rules.plan import Settings, cars_of, condition_of, learner_of, world_of
from ethogram.studies.rules.validation import (
    ACTING,
    APPROACHES,
    GROUPS,
    HUMANS,
    ROADS,
    SHARES,
    TRAFFIC,
    Approach,
    Fare,
    among_humans,
    before_a_stopped_car,
    episodes_of,
    in_traffic,
)
from ethogram.studies.training import (
    Arrays,
    learning_curve,
    train_case,
    training_points,
    use_kernels,
)
from ethogram.worlds.traffic.rules import RULES

# On one core of an ordinary machine; see benchmarks
MULTIPLICATIONS_PER_SECOND = 2e10  # of networks in training, forwards and backwards
CAR_STEPS_PER_SECOND = 1.5e6  # of trained drivers, watched
COMPILE_SECONDS = {"traffic": 20.0, "mixed": 15.0, "greater_good": 5.0}
PROCESS_BYTES = 600_000_000  # Python, JAX and compiled programs
FRAME_STEPS = 2  # of a recorded scene
STEP_BYTES = 250  # of a car, while an episode is watched or learned from


def parts(settings: Settings) -> tuple[str, ...]:
    """The validations of a case: traffic always, as figure 4.6 and all claims need it."""
    others = ("mixed", "greater_good")
    chosen = others if settings.validation == "all" else (settings.validation,)
    return "traffic", *(each for each in others if each in chosen)


def cost(case: Case) -> Cost:
    """About what a case takes on one core."""
    settings = case.parsed(Settings)
    learner, validated = settings.learner, parts(settings)
    steps = settings.world.steps
    samples = learner.episodes_per_update * steps * cars_of(settings)
    units = learner.hidden_size
    weights = units * (11 + units + 7) * (1 if learner.shared_trunk else 2)
    trained = settings.trials * settings.updates * samples * learner.epochs * 3 * weights
    levels = len(ACTING) * sum(TRAFFIC) + ("mixed" in validated) * cars_of(settings) * (
        len(HUMANS) * (len(SHARES) - 1) + 1
    )
    watched = settings.trials * settings.validation_episodes * steps * levels
    return Cost(
        seconds=15.0
        + sum(COMPILE_SECONDS[part] for part in validated)
        + trained / MULTIPLICATIONS_PER_SECOND
        + watched / CAR_STEPS_PER_SECOND,
        bytes=PROCESS_BYTES
        + STEP_BYTES * max(samples, settings.validation_episodes * steps * sum(TRAFFIC))
        + STEP_BYTES * settings.scenes * steps * cars_of(settings),
    )


def run(case: Case, context: Context) -> dict[str, xr.Dataset]:
    """Train all trials of a case, and validate them.

    Returns:
        `results` (dimensions trial, point; level, acting; and as was asked for human, share, group,
        road; rule) and, as `scene`, `scene-2`, ..., an episode of the first trials.

    Raises:
        TooLarge: the case would not fit in memory; the message names the size.

    """
    settings = case.parsed(Settings)
    world = world_of(settings)
    use_kernels(context, world)
    require_memory(f"rules with {cars_of(settings)} cars", cost(case).bytes)
    keys = trial_keys(settings.seed, case.name, settings.trials)
    for_init, for_training, for_validation = (fold_in(keys, number) for number in range(3))
    learner = learner_of(settings, world)
    state, curves = train_case(
        Trials(learner, in_turn=True),
        for_init,
        for_training,
        settings.updates,
        context,
        _curves,
    )
    results = _training(curves, settings)
    results |= _in_traffic(settings, state, fold_in(for_validation, 0))
    if "mixed" in parts(settings):
        fares = among_humans(settings, state, fold_in(for_validation, 1))
        results |= _named("mixed", fares, ("trial", "human", "share", "group"))
    if "greater_good" in parts(settings):
        approached = before_a_stopped_car(settings, state, fold_in(for_validation, 2))
        results |= _named("approach", approached, ("trial", "road"))
    shown = min(settings.scenes, settings.trials)
    if not shown:
        return {"results": _labelled(results, settings)}
    first = jax.tree.map(itemgetter(slice(0, shown)), (state, fold_in(for_validation, 3)))
    played = episodes_of(world, learner, *first)
    scenes = [world.scene(jax.tree.map(itemgetter(trial), played)) for trial in range(shown)]
    thinned = [scene.every(FRAME_STEPS) for scene in scenes]
    return {"results": _labelled(results, settings), **grouped(thinned)}


def _curves(metrics: Metrics) -> Arrays:
    """R, E and C of each episode of training: mean and standard deviation among cars."""
    sums, earned = metrics["episode_sums"], metrics["episode_return"]["driver"]
    per_car = {"R": earned, "E": sums["speed"], "C": sums["collision"]}
    found = {}
    for name, values in per_car.items():
        found[name] = values.mean((2, 3))  # [update, trial, episode, car]
        found[f"{name}_deviation"] = values.std(3).mean(2)
    return found


def _training(curves: Arrays, settings: Settings) -> dict[str, Any]:
    return {
        f"training_{name}": (
            ("trial", "point"),
            learning_curve(values, settings.record_every).T.astype(np.float32),
        )
        for name, values in curves.items()
    }


def _in_traffic(settings: Settings, state: PPOState, keys: Key[Array, "trial"]) -> dict[str, Any]:
    each = [
        in_traffic(settings, state, fold_in(keys, number), explore=how == "drawn")
        for number, how in enumerate(ACTING)
    ]
    fares, earned = jax.tree.map(lambda *parts: np.stack(parts, 1), *each)
    found = _named("traffic", fares, ("trial", "acting", "level"))
    return {**found, "traffic_return": (("trial", "acting", "level"), earned)}


def _named(what: str, found: Fare | Approach, axes: tuple[str, ...]) -> dict[str, Any]:
    return {
        f"{what}_{name}": (axes + ("rule",) * (values.ndim - len(axes)), values)
        for name, values in found._asdict().items()
    }


def _labelled(results: dict[str, Any], settings: Settings) -> xr.Dataset:
    known = {
        "acting": list(ACTING),
        "level": list(TRAFFIC),
        "human": list(HUMANS),
        "share": list(SHARES),
        "group": list(GROUPS),
        "road": list(ROADS),
        "rule": list(RULES),
    }
    used = {axis for axes, _ in results.values() for axis in axes}
    condition = condition_of(settings)
    return xr.Dataset(
        {name: (axes, np.asarray(values, np.float32)) for name, (axes, values) in results.items()},
        coords={
            "point": training_points(settings.updates, settings.record_every, "update"),
            **{name: (name, values) for name, values in known.items() if name in used},
        },
        attrs={
            **{f"fine_{rule}": fine for rule, fine in condition.fines._asdict().items()},
            "collided": condition.collided,
            "reading": condition.reading,
            "updates": settings.updates,
            "steps": settings.world.steps,
            "time_step": float(settings.world.time_step),
            "top_speed": float(world_of(settings).top_speed),
            "cars": cars_of(settings),
            "approaches": APPROACHES,
        },
    )
