"""Computation of a case: bodies drawn, made by hand or evolved, and their avalanches."""

from collections.abc import Sequence
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
from ethogram.learners.evolution import Evaluation, Genetic
from ethogram.physics import native
from ethogram.studies.criticality.condition import BOXES, HAND_MADE
from ethogram.studies.criticality.plan import EVOLVED, Settings, condition_of, learner_of
from ethogram.studies.training import DONE, STATE, Arrays, named, named_so, trials_in_turn
from ethogram.worlds.softbody.bodies import PLANE, cells_of, text_of
from ethogram.worlds.softbody.criticality import (
    Criticality,
    PowerLaw,
    avalanches_of,
    criticality,
    power_law,
    threshold,
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
            name: body
            for name, body in zip(names, bodies, strict=True)
            if name not in self.known
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
    settings = case.parsed(Settings)
    bodies = settings.trials
    if settings.bodies in EVOLVED:
        learner = settings.learner
        bodies *= learner.population_size + settings.generations * learner.children
    elif settings.bodies == "thresholds":
        bodies = len(BOXES) * len(THRESHOLDS)
    return Cost(seconds=5 + SECONDS_OF_A_BODY * bodies, bytes=PROCESS_BYTES)


def run(case: Case, context: Context) -> dict[str, xr.Dataset]:
    """Find the bodies of a case and measure them.

    Returns:
        `results` (dimensions trial, voxel): of each body its score and what it is made of, the
        power law that fits it best, and the avalanches of each voxel; of evolution also, per
        generation, the best and the mean score.  Of square bodies (dimensions trial, threshold,
        voxel) the avalanches at each threshold.

    """
    settings = case.parsed(Settings)
    context.use_kernels({KERNEL: native.implementation(KERNEL)})
    if settings.bodies == "thresholds":
        return {"results": _threshold_test(settings)}
    if settings.bodies in EVOLVED:
        return {"results": _evolved(case, settings, context)}
    if settings.bodies == "hand_made":
        names = list(HAND_MADE)
        bodies = [cells_of(text, axes=PLANE) for text in HAND_MADE.values()]
    else:
        names, bodies = [], _drawn(case, settings)
    return {"results": _measured(settings, bodies, names)}


def _drawn(case: Case, settings: Settings) -> list[Cells]:
    """Random bodies, one for each trial."""
    bodies = []
    for key in trial_keys(settings.seed, case.name, settings.trials):
        rng = np.random.default_rng(np.asarray(jax.random.key_data(key)))
        if settings.bodies == "rnd":
            bodies.append(random_body(rng, settings.voxels, settings.grid))
        else:
            bodies.append(walked_body(rng, settings.voxels))
    return bodies


def _measured(
    settings: Settings, bodies: Sequence[Cells], names: Sequence[str] = ()
) -> xr.Dataset:
    """Scores of bodies and the avalanches behind them."""
    found = avalanches_of(bodies)
    most = max(map(len, bodies))
    scores = [criticality(size, len(size)) for size, _ in found]
    laws = [power_law(size, len(size), seed=settings.seed) for size, _ in found]
    of_body: dict[str, Any] = {
        "voxels": ("trial", [len(body) for body in bodies]),
        **{name: ("trial", [getattr(each, name) for each in scores]) for name in Criticality._fields},
        **{f"law_{name}": ("trial", [getattr(each, name) for each in laws]) for name in PowerLaw._fields},
    }
    of_voxel = {
        name: (("trial", "voxel"), np.stack([np.pad(each[i], (0, most - len(each[i]))) for each in found]))
        for i, name in enumerate(("size", "duration"))
    }
    texts = [text_of(body) for body in bodies]
    return xr.Dataset(
        of_body | of_voxel,
        attrs={**_attributes(settings), "layers": " ".join(texts), "names": " ".join(names)},
    )


def _attributes(settings: Settings) -> dict[str, Any]:
    return {
        "bodies": condition_of(settings).bodies,
        "grid": settings.grid,
        "wanted_voxels": settings.voxels,
        "generations": settings.generations,
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


def _evolved(case: Case, settings: Settings, context: Context) -> xr.Dataset:
    """The best body of each run, and how its score rose."""
    keys = trial_keys(settings.seed, case.name, settings.trials)
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
        state = from_arrays(_form(settings, learner), named_so(STATE, found))

    def arrays() -> Arrays:
        curves = {name: np.array(values) for name, values in kept.items()}
        counts = {"asked": np.array(fitness.asked), "scored": np.array(fitness.scored)}
        return curves | counts

    for generation in range(done, settings.generations):
        for_children, for_ties = jax.random.split(fold_in(key, generation + 1))
        candidates = _ask(learner, for_children, state)
        state = _tell(learner, for_ties, state, candidates, fitness(key, candidates))
        _keep(kept, learner.metrics(state), fitness)
        context.progress(generation + 1, settings.generations)
        context.checkpoint(
            lambda done=generation + 1, state=state: (
                {DONE: np.array(done)} | arrays() | named(STATE, to_arrays(state))
            )
        )
    return arrays() | {"genome": np.asarray(state.best_ever.genome)}


def _keep(kept: dict[str, list[float]], metrics: dict[str, Any], fitness: BodyFitness) -> None:
    """Append the scores of a generation."""
    for name in CURVES:
        kept[name].append(fitness.sign * float(metrics[name]))


def _form(settings: Settings, learner: Genetic) -> Any:
    """A state as the learner's are, without scoring anything."""

    class Nothing:
        deterministic = True

        def __call__(self, key: Any, genomes: Array) -> Evaluation:
            return Evaluation(jnp.zeros(len(genomes)), jnp.zeros(len(genomes), bool))

    blank = learner_of(settings, Nothing())
    return jax.eval_shape(blank.init, jax.random.key(0))


_ask = eqx.filter_jit(lambda learner, key, state: learner.ask(key, state))
_tell = eqx.filter_jit(
    lambda learner, key, state, candidates, evaluation: learner.tell(
        key, state, candidates, evaluation
    )
)
