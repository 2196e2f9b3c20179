"""Computation of a case: evolution in all its trials side by side, then validation of the best."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jax import Array, lax
from jaxtyping import Float, Key

from ethogram.campaign.case import Case, Cost
from ethogram.campaign.context import Context
from ethogram.core.keys import fold_in, trial_keys
from ethogram.core.memory import require_memory
from ethogram.core.recorded import RECORDED, grouped
from ethogram.core.rollout import Policy
from ethogram.learners.base import Metrics, Trials
from ethogram.learners.evolution import AgeFitness, Evaluation, Population, best
from ethogram.learners.evolution.age_fitness import generation_bytes
from ethogram.physics.beams3d import State, centre
from ethogram.studies.sensing.condition import SCENARIOS
from ethogram.studies.sensing.plan import (
    Settings,
    condition_of,
    controller_of,
    training_starts,
    validation_starts,
    world_of,
)
from ethogram.studies.sensing.results import VALIDATED
from ethogram.studies.training import Arrays, train_case, use_kernels
from ethogram.worlds.softbody import SoftBody3D
from ethogram.worlds.softbody.bodies import text_of
from ethogram.worlds.softbody.controllers import Controller, policy
from ethogram.worlds.softbody.gravity import schedule
from ethogram.worlds.softbody.scene import Pose, scene_of_poses
from ethogram.worlds.softbody.simulation import SimulationResult, robots_per_block, simulate
from ethogram.worlds.softbody.starts import Start

VOXEL_STEPS_PER_SECOND = 5e6  # one core of an ordinary machine; see benchmarks
COMPILE_SECONDS = 12.0
PROCESS_BYTES = 600_000_000  # Python, JAX and compiled programs
RECORDED_BYTES = 32  # per recorded number, with the copies made on its way to the store
CURVES = "best", "diverged"  # metrics of each generation that are kept
ROBOT_BYTES = 4 * 200  # of a voxel's state, bonds and what is computed of them


class DistanceFitness(eqx.Module):
    """Fitness: how far along +x each controller gets, on average over starts.

    The starts are the same for all controllers (common random numbers), whenever they are asked
    for: nothing is left to chance.  Who diverges from one of them has diverged.
    """

    world: SoftBody3D
    controller: Controller
    gravity: Float[Array, "step 3"]
    starts: Start | None = None  # None is the one at rest
    deterministic: bool = eqx.field(static=True, default=True)

    def __call__(self, key: Key[Array, ""], genomes: Float[Array, "candidate gene"]) -> Evaluation:
        """Simulate all candidates side by side, and under `vmap` those of all runs."""
        del key  # nothing is left to chance
        if self.starts is None:
            found = simulate(self.world, self.controller, genomes.T, self.gravity)
            return Evaluation(found.distance, found.diverged)
        found = simulate_starts(self.world, self.controller, genomes.T, self.gravity, self.starts)
        return Evaluation(found.distance.mean(1), found.diverged.any(1))

    def policy(self, genome: Float[Array, "gene"]) -> Policy:
        """The controller with these parameters."""
        return policy(self.controller, genome, self.world.material.edge)


def simulate_starts(
    world: SoftBody3D,
    controller: Controller,
    parameters: Float[Array, "gene robot"],
    gravity: Float[Array, "step 3"],
    starts: Start,
) -> SimulationResult:
    """Simulate every robot from every start, all side by side.

    Returns:
        Distances and who diverged, with axes robot, start; nothing is recorded.

    """
    robots, number = parameters.shape[-1], len(starts.phase)
    found = simulate(
        world,
        controller,
        jnp.repeat(parameters, number, -1),
        gravity,
        start=jax.tree.map(lambda part: jnp.tile(part, robots), starts),
    )
    return jax.tree.map(lambda part: part.reshape(robots, number), found)


class Recorder(eqx.Module):
    """What is recorded: where every robot is, and all voxels of the first ones."""

    world: SoftBody3D
    first: int = eqx.field(static=True)  # how many

    def __call__(self, state: State) -> dict[str, Any]:
        """Of robots side by side, at one step."""
        first = Pose(*(part[..., : self.first] for part in self.world.pose(state)))
        return {"centre": centre(self.world.body, state), "first": first}


def cost(case: Case) -> Cost:
    """About what a case takes on one core."""
    settings = case.parsed(Settings)
    world, learner = world_of(settings), settings.learner
    body, block = world.body, robots_per_block(world)
    scenarios = len(SCENARIOS[settings.surface])
    size = learner.population_size
    starts, fresh = settings.starts, settings.validation_starts
    groups = (
        (size * starts, 1),
        ((size + 1) * starts, settings.generations),
        (scenarios, 1),
        (fresh, scenarios),
    )
    blocks = sum(-(-settings.trials * each // block) * times for each, times in groups)
    genes = controller_of(settings).search_space.size
    samples = settings.world.steps // settings.record_every
    shown = min(RECORDED, settings.trials)
    watched = settings.trials * scenarios * 2 * samples + shown * samples * body.voxels * 8
    side_by_side = settings.trials * max((size + 1) * starts, scenarios, fresh)
    return Cost(
        seconds=COMPILE_SECONDS
        + blocks * block * settings.world.steps * body.voxels / VOXEL_STEPS_PER_SECOND,
        bytes=PROCESS_BYTES
        + settings.trials * generation_bytes(learner.population_size, genes)
        + side_by_side * (ROBOT_BYTES * (body.voxels + body.pairs // 4) + 4 * genes)
        + 4 * 3 * settings.world.steps * settings.trials * scenarios
        + RECORDED_BYTES * watched,
    )


def run(case: Case, context: Context) -> dict[str, xr.Dataset]:
    """Evolve and validate all trials of a case.

    Returns:
        `results` (dimensions trial, generation, gene, scenario, axis, sample, and start where
        there are validation starts) and, as `scene`,
        `scene-2`, ..., the best robots of the first trials under the first scenario.

    Raises:
        TooLarge: the case would not fit in memory; the message names the size.

    """
    settings = case.parsed(Settings)
    require_memory(f"Evolution of {condition_of(settings).description}", cost(case).bytes)
    use_kernels(context, world_of(settings))
    keys = trial_keys(settings.seed, case.name, settings.trials)
    learner = learner_of(settings)

    def first_generation(population: Population) -> Arrays:
        metrics = jax.vmap(learner.metrics)(population)
        return {name: np.asarray(metrics[name])[None] for name in CURVES}

    population, curves = train_case(
        Trials(learner),
        fold_in(keys, 0),
        fold_in(keys, 1),
        settings.generations,
        context,
        _curves,
        initial=first_generation,
    )
    genome, _ = jax.vmap(best)(population)
    found = jax.tree.map(np.asarray, _validate(settings, genome))
    results = _label(settings, curves, genome, found)
    if settings.validation_starts:
        results[VALIDATED] = _validate_starts(settings, genome)
    material = world_of(settings).material
    scenes = [
        scene_of_poses(
            condition_of(settings).description,
            Pose(*(frames[..., trial] for frames in found.recorded["first"])),
            resting=float(material.edge),
            seconds=settings.record_every * float(material.time_step),
        )
        for trial in range(min(RECORDED, settings.trials))
    ]
    return {"results": results, **grouped(scenes)}


def learner_of(settings: Settings) -> AgeFitness:
    """The evolution of a case."""
    world, controller = world_of(settings), controller_of(settings)
    (gravity, *_) = SCENARIOS[settings.surface].values()
    return AgeFitness(
        search_space=controller.search_space,
        fitness=DistanceFitness(
            world,
            controller,
            schedule(gravity, settings.world.steps),
            training_starts(settings),
        ),
        **dataclasses.asdict(settings.learner),
    )


def _curves(metrics: Metrics) -> Arrays:
    return {name: metrics[name] for name in CURVES}


def _validate(settings: Settings, genome: Float[Array, "trial gene"]) -> SimulationResult:
    """The best of each trial under each gravity: robots are scenario by scenario, then trials."""
    world, programs = world_of(settings), SCENARIOS[settings.surface].values()
    schedules = [schedule(gravity, settings.world.steps) for gravity in programs]
    return eqx.filter_jit(simulate)(
        world,
        controller_of(settings),
        jnp.tile(genome.T, (1, len(schedules))),
        jnp.repeat(jnp.stack(schedules, -1), len(genome), -1),
        record=Recorder(world, min(RECORDED, settings.trials)),
        record_every=settings.record_every,
    )


def _validate_starts(settings: Settings, genome: Float[Array, "trial gene"]) -> xr.Variable:
    """How far the best of each trial gets under each gravity from each validation start (m)."""
    world, programs = world_of(settings), SCENARIOS[settings.surface].values()

    @eqx.filter_jit
    def distances(
        world: SoftBody3D,
        controller: Controller,
        genome: Array,
        schedules: Float[Array, "scenario step 3"],
        starts: Start,
    ) -> Float[Array, "scenario trial start"]:
        def under(gravity: Float[Array, "step 3"]) -> Float[Array, "trial start"]:
            return simulate_starts(world, controller, genome.T, gravity, starts).distance

        found: Array = lax.map(under, schedules)
        return found

    found = distances(
        world,
        controller_of(settings),
        genome,
        jnp.stack([schedule(gravity, settings.world.steps) for gravity in programs]),
        validation_starts(settings),
    )
    values = np.asarray(found, np.float32).transpose(1, 0, 2)
    return xr.Variable(("trial", "scenario", "start"), values)


def _label(
    settings: Settings,
    curves: dict[str, np.ndarray],
    genome: Float[Array, "trial gene"],
    found: SimulationResult,
) -> xr.Dataset:
    condition, trials = condition_of(settings), settings.trials
    scenarios = list(SCENARIOS[settings.surface])
    path = found.recorded["centre"][:, ::2]  # of x, y, z the first and the last
    samples = len(path)
    path = path.reshape(samples, 2, len(scenarios), trials).transpose(3, 2, 1, 0)
    time = np.arange(samples) * settings.record_every * float(world_of(settings).material.time_step)
    return xr.Dataset(
        {
            "fitness": (("trial", "generation"), curves["best"].T.astype(np.float32)),
            "diverged": (("trial", "generation"), curves["diverged"].T.astype(np.int32)),
            "genome": (("trial", "gene"), np.asarray(genome, np.float32)),
            "distance": (
                ("trial", "scenario"),
                found.distance.reshape(len(scenarios), trials).T.astype(np.float32),
            ),
            "path": (("trial", "scenario", "axis", "sample"), path.astype(np.float32)),
        },
        coords={
            "generation": ("generation", np.arange(settings.generations + 1)),
            "scenario": ("scenario", scenarios),
            "axis": ("axis", ["x", "z"]),
            "sample": ("sample", time, {"long_name": "time", "units": "s"}),
        },
        attrs={
            "body": condition.body,
            "layers": text_of(world_of(settings).cells),
            "voxels": len(world_of(settings).cells),
            "controller": condition.controller,
            "law": condition.law,
            "surface": condition.surface,
            "generations": settings.generations,
            "steps": settings.world.steps,
            "starts": settings.starts,
        },
    )
