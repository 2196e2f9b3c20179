"""Computation of a case: bodies drawn, made by hand or evolved, and their avalanches."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jax import Array
from jaxtyping import Float, Key

from ethogram.campaign.case import Case, Cost
from ethogram.campaign.context import Context
from ethogram.core.keys import fold_in, trial_keys
from ethogram.core.pytrees import from_arrays, to_arrays
from ethogram.core.recorded import RECORDED, grouped
from ethogram.learners.evolution import Evaluation, Genetic
from ethogram.learners.evolution.genetic import GeneticState
from ethogram.physics import native
from ethogram.studies.criticality.condition import BOXES, HAND_MADE
from ethogram.studies.criticality.plan import EVOLVED, Settings, condition_of, learner_of
from ethogram.studies.criticality.tasks import is_task, run_task, task_cost
from ethogram.studies.training import DONE, STATE, Arrays, named, named_so, trials_in_turn
from ethogram.worlds.softbody.avalanche_scene import avalanche_scene
from ethogram.worlds.softbody.bodies import PLANE, cells_of, text_of
from ethogram.worlds.softbody.criticality import (
    Criticality,
    PowerLaw,
    avalanches_of,
    criticality,
    power_law,
)
from ethogram.worlds.softbody.growth import Cells, grown, random_body, walked_body

SECONDS_OF_A_BODY = 2e-3  # on one core, by the kernel
PROCESS_BYTES = 600_000_000  # Python, JAX and compiled programs
THRESHOLDS = np.linspace(5e-5, 8e-3, 11)  # tau^all to tau^one, n_thr (Table 6.1)
KERNEL = "lattice2d"
CURVES = "best", "mean"


class BodyFitness:
    """Criticality of the bodies that genomes make, or how little they have of it.

    A body that was scored is not scored again; `asked` and `scored` count.  It is no JAX program:
    bodies of different sizes are simulated in groups of a size.
    """

    deterministic = True

    def __init__(self, voxels: int, *, sign: float = 1.0) -> None:
        """Score bodies of at least so many voxels, for the greatest score or, by -1, the least."""
        self.voxels, self.sign = voxels, sign
        self.known: dict[str, float] = {}
        self.asked = self.scored = 0

    def __call__(self, key: Key[Array, ""], genomes: Float[Array, "candidate gene"]) -> Evaluation:
        """Fitness of all candidates."""
        del key  # nothing is left to chance
        bodies = [grown(genes, self.voxels) for genes in np.asarray(genomes)]
        names = [text_of(body) for body in bodies]
        new = {
            name: body for name, body in zip(names, bodies, strict=True) if name not in self.known
        }
        for (name, body), sizes in zip(new.items(), sizes_of(list(new.values())), strict=True):
            self.known[name] = criticality(sizes, len(body)).score
        self.asked, self.scored = self.asked + len(names), self.scored + len(new)
        fitness = self.sign * np.array([self.known[name] for name in names])
        return Evaluation(jnp.asarray(fitness, float), jnp.zeros(len(names), bool))


def sizes_of(bodies: Sequence[Cells]) -> list[np.ndarray]:
    """Sizes of the avalanches of bodies."""
    return [size for size, _ in avalanches_of(bodies)] if bodies else []


def cost(case: Case) -> Cost:
    """About what a case takes on one core."""
    if is_task(case):
        return task_cost(case)
    settings = case.parsed(Settings)
    bodies = settings.trials
    if settings.bodies in EVOLVED:
        learner = settings.learner
        bodies *= learner.population_size + settings.generations * learner.children
    elif settings.bodies == "thresholds":
        bodies = len(BOXES) * len(THRESHOLDS)
    return Cost(seconds=5 + SECONDS_OF_A_BODY * bodies, bytes=PROCESS_BYTES)


def run(case: Case, context: Context) -> dict[str, xr.Dataset]:
    """Find the bodies of a case and measure them; or find controllers of a body for a task.

    Returns:
        Of tasks as `tasks.run_task`; else
        `results` (dimensions trial, voxel): of each body its score and what it is made of, the
        power law that fits it best, and the avalanches of each voxel; of evolution also, per
        generation, the best and the mean score; `scene`, `scene-2`, ..., some avalanches of the
        first bodies.  Of square bodies (dimensions trial, threshold,
        voxel) the avalanches at each threshold.

    """
    if is_task(case):
        return run_task(case, context)
    settings = case.parsed(Settings)
    context.use_kernels({KERNEL: native.implementation(KERNEL)})
    if settings.bodies == "thresholds":
        return {"results": _threshold_test(settings)}
    if settings.bodies in EVOLVED:
        return _with_scenes(_evolved(settings, context))
    if settings.bodies == "hand_made":
        names = list(HAND_MADE)
        bodies = [cells_of(text, axes=PLANE) for text in HAND_MADE.values()]
    else:
        names, bodies = [], _drawn(settings)
    return _with_scenes(_measured(settings, bodies, names))


def _with_scenes(results: xr.Dataset) -> dict[str, xr.Dataset]:
    """The results, and avalanches of the first bodies to be watched."""
    texts = str(results.attrs["layers"]).split()[:RECORDED]
    scenes = [avalanche_scene(cells_of(text, axes=PLANE), text) for text in texts]
    return {"results": results, **grouped(scenes)}


def _keys(settings: Settings) -> Key[Array, "trial"]:
    """The keys of a case's trials: those of the first ones are other cases'."""
    name, first = condition_of(settings).name, settings.first
    return trial_keys(settings.seed, name, first + settings.trials)[first:]


def _drawn(settings: Settings) -> list[Cells]:
    """Random bodies, one for each trial."""
    bodies = []
    for key in _keys(settings):
        rng = np.random.default_rng(np.asarray(jax.random.key_data(key)))
        if settings.bodies == "rnd":
            bodies.append(random_body(rng, settings.voxels, settings.grid))
        else:
            bodies.append(walked_body(rng, settings.voxels))
    return bodies


def _measured(settings: Settings, bodies: Sequence[Cells], names: Sequence[str] = ()) -> xr.Dataset:
    """Scores of bodies and the avalanches behind them."""
    found = avalanches_of(bodies)
    most = max(map(len, bodies))
    scores = [criticality(size, len(size)) for size, _ in found]
    laws = [power_law(size, len(size), seed=settings.seed) for size, _ in found]
    numbers = {
        **{name: [getattr(each, name) for each in scores] for name in Criticality._fields},
        **{f"law_{name}": [getattr(each, name) for each in laws] for name in PowerLaw._fields},
        "voxels": [len(body) for body in bodies],
    }
    variables: dict[str, Any] = {name: ("trial", each) for name, each in numbers.items()}
    for place, name in enumerate(("size", "duration")):
        padded = [np.pad(each[place], (0, most - len(each[place]))) for each in found]
        variables[name] = ("trial", "voxel"), np.stack(padded)
    texts = [text_of(body) for body in bodies]
    return xr.Dataset(
        variables,
        attrs={**_attributes(settings), "layers": " ".join(texts), "names": " ".join(names)},
    )


def _attributes(settings: Settings) -> dict[str, Any]:
    return {
        "bodies": condition_of(settings).bodies,
        "grid": settings.grid,
        "wanted_voxels": settings.voxels,
        "generations": settings.generations,
        "population_size": settings.learner.population_size,
        "first": settings.first,
    }


def _threshold_test(settings: Settings) -> xr.Dataset:
    """Avalanches of square bodies at each threshold (section 6.4.1, figures 6.1 and 6.2)."""
    most = BOXES[-1] ** 2
    size = np.zeros((len(BOXES), len(THRESHOLDS), most), int)
    for place, side in enumerate(BOXES):
        body = cells_of("/".join(["#" * side] * side), axes=PLANE)
        found = avalanches_of([body] * len(THRESHOLDS), list(THRESHOLDS))
        for number, (each, _) in enumerate(found):
            size[place, number, : len(body)] = each
    return xr.Dataset(
        {"size": (("trial", "threshold", "voxel"), size), "side": ("trial", list(BOXES))},
        {"threshold": THRESHOLDS},
        attrs=_attributes(settings),
    )


def _evolved(settings: Settings, context: Context) -> xr.Dataset:
    """The best body of each run, and how its score rose."""
    keys = _keys(settings)
    runs = trials_in_turn(
        settings.trials,
        context,
        lambda number, turn: _one_run(settings, keys[number], turn),
    )
    best = [grown(run["genome"], settings.voxels) for run in runs]
    found = _measured(settings, best)
    for name in CURVES:
        found[name] = ("trial", "generation"), np.stack([run[name] for run in runs])
    for name in ("asked", "scored"):
        found[name] = "trial", np.array([int(run[name]) for run in runs])
    return found.assign_coords(generation=np.arange(settings.generations + 1))


def _one_run(settings: Settings, key: Key[Array, ""], context: Context) -> Arrays:
    """A run of the genetic algorithm, from its last checkpoint."""
    fitness = BodyFitness(settings.voxels, sign=-1.0 if settings.bodies == "minimised" else 1.0)
    learner = learner_of(settings, fitness)
    found = context.restore()
    kept: dict[str, list[float]] = {name: [] for name in CURVES}
    done = 0
    if found is None:
        state = learner.init(fold_in(key, 0))
        _keep(kept, learner.metrics(state), fitness)
    else:
        done = int(found[DONE])
        kept = {name: found[name].tolist() for name in CURVES}
        fitness.asked, fitness.scored = int(found["asked"]), int(found["scored"])
        state = from_arrays(_form(settings), named_so(STATE, found))

    def arrays() -> Arrays:
        curves = {name: np.array(values) for name, values in kept.items()}
        counts = {"asked": np.array(fitness.asked), "scored": np.array(fitness.scored)}
        return curves | counts

    def snapshot(done: int, state: GeneticState) -> Arrays:
        return {DONE: np.array(done)} | arrays() | named(STATE, to_arrays(state))

    for generation in range(done, settings.generations):
        for_children, for_ties = jax.random.split(fold_in(key, generation + 1))
        candidates = _ask(learner, for_children, state)
        state = _tell(learner, for_ties, state, candidates, fitness(key, candidates))
        _keep(kept, learner.metrics(state), fitness)
        context.progress(generation + 1, settings.generations)
        context.checkpoint(partial(snapshot, generation + 1, state))
    return arrays() | {"genome": np.asarray(state.best_ever.genome)}


def _keep(kept: dict[str, list[float]], metrics: dict[str, Any], fitness: BodyFitness) -> None:
    """Append the scores of a generation."""
    for name in CURVES:
        kept[name].append(fitness.sign * float(metrics[name]))


class _Nothing:
    """A fitness of which only the shape is wanted."""

    deterministic = True

    def __call__(self, key: Key[Array, ""], genomes: Float[Array, "candidate gene"]) -> Evaluation:
        del key
        return Evaluation(jnp.zeros(len(genomes)), jnp.zeros(len(genomes), bool))


def _form(settings: Settings) -> Any:
    """The shapes and types of a learner's state."""
    return jax.eval_shape(learner_of(settings, _Nothing()).init, jax.random.key(0))


@eqx.filter_jit
def _ask(learner: Genetic, key: Key[Array, ""], state: GeneticState) -> Array:
    return learner.ask(key, state)


@eqx.filter_jit
def _tell(
    learner: Genetic, key: Key[Array, ""], state: GeneticState, born: Array, found: Evaluation
) -> GeneticState:
    return learner.tell(key, state, born, found)
