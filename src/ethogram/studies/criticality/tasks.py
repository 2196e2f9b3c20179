"""The tasks of section 6.5.2: for each body controllers evolved by CMA-ES, and how well they do.

A case is a body in a task, with all its runs side by side.  The phase controller commands
u_i(t) = sin(-2 pi t + pi g_i), with a gene for each cell of the body's bounding grid; t is the time
of control so far.

Deviations from the thesis: its neural controller is not among it yet.  A run has as many births as
whole generations make up.
"""

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jax import Array, lax
from jaxtyping import Float, Int, Key
from pydantic import Field

from ethogram.campaign.case import Case, Cost
from ethogram.campaign.context import Context
from ethogram.core.errors import InvalidSettings
from ethogram.core.keys import fold_in, trial_keys
from ethogram.core.rollout import Policy, rollout
from ethogram.core.search_space import SearchSpace
from ethogram.core.settings import settings_class, settings_of
from ethogram.core.world import PerRole, Transition
from ethogram.learners.base import Metrics, Trials
from ethogram.learners.evolution import CMAES, Evaluation
from ethogram.learners.evolution.base import Fitness
from ethogram.learners.evolution.cmaes import PRESETS as CMAES_PRESETS
from ethogram.learners.evolution.cmaes_parameters import default_population_size
from ethogram.physics.lattice2d import at_rest
from ethogram.studies.criticality.found import BODIES
from ethogram.studies.training import Arrays, train_case, use_kernels
from ethogram.worlds.softbody import SoftBody2D
from ethogram.worlds.softbody.sensors import CLOCK
from ethogram.worlds.softbody.sensors2d import voxels
from ethogram.worlds.softbody.world2d import ROLE, STEPS_PER_SECOND, energy_fitness

THESIS_TASKS = ("locomotion", "jump", "escape")
VOXEL_STEPS_PER_SECOND = 8e6  # one core, by the kernel
PROCESS_BYTES = 700_000_000

if TYPE_CHECKING:

    class OptimiserSettings(CMAES):
        """Those of CMA-ES, without what it searches."""

        search_space: SearchSpace = field(init=False)
        fitness: Fitness = field(init=False)

else:
    OptimiserSettings = settings_of(CMAES)


@settings_class
class TaskSettings:
    """Everything that fixes the numbers of a body in a task."""

    body: Literal[tuple(BODIES)] = "box"  # type: ignore[valid-type]
    task: Literal["locomotion", "jump", "escape"] = "locomotion"
    controller: Literal["phase"] = "phase"
    optimiser: OptimiserSettings = Field(
        default_factory=lambda: OptimiserSettings(**CMAES_PRESETS["thesis"])
    )
    births: Annotated[int, Field(ge=1, le=10_000_000)] = 10_000
    trials: Annotated[int, Field(ge=1, le=100_000)] = 10
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0


@dataclass(frozen=True)
class TaskCondition:
    """A body in a task under a controller."""

    body: str
    task: str
    controller: str

    @property
    def name(self) -> str:
        """The case's name: it goes into its random keys."""
        return f"{self.body}-{self.task}-{self.controller}"

    @property
    def description(self) -> str:
        """The condition in words, for tables and notes."""
        return f"{self.body}, {self.task}, {self.controller} controller"


def is_task(case: Case) -> bool:
    """Whether a case is a body in a task."""
    return "task" in case.settings


def task_condition(settings: TaskSettings) -> TaskCondition:
    """The cell of the campaign that settings belong to."""
    return TaskCondition(settings.body, settings.task, settings.controller)


class PhaseFitness(eqx.Module):
    """How far, or how high, a body gets by phase controllers: the return of `SoftBody2D`.

    A jump is worth its height, the other tasks their way, in metres.
    """

    world: SoftBody2D
    gene: Int[Array, "voxel"]  # which gene of the grid is a voxel's
    deterministic: bool = eqx.field(static=True, default=True)

    def __call__(self, key: Key[Array, ""], genomes: Float[Array, "candidate gene"]) -> Evaluation:
        """Simulate all candidates side by side."""
        del key  # nothing is left to chance
        phases = jnp.pi * genomes.T[self.gene]
        world = self.world
        place, _ = world.reset(jax.random.key(0))
        lifted = place.body.moved[:, :1, :1, None]
        body = at_rest(world.body, (len(genomes),), place=(lifted[0], lifted[1]))
        first = world.first_command

        def centre(body: Any) -> Float[Array, "2 candidate"]:
            return world.centre(voxels(world.body, world.material, body))

        def advance(at: Any, step: Int[Array, ""]) -> tuple[Any, None]:
            body, standing, highest = at
            time = (step - world.settling) / STEPS_PER_SECOND
            control = jnp.where(step >= first, jnp.sin(phases - 2 * jnp.pi * (time % 1)), 0.0)
            body = world.move(body, control)
            if not world.task.rises:
                return (body, standing, highest), None
            up = centre(body)[1]
            standing = jnp.where(step <= first, up, standing)
            return (body, standing, jnp.maximum(highest, up - standing)), None

        begun = centre(body)
        nothing = jnp.zeros_like(begun[0])
        end, _, highest = lax.scan(advance, (body, nothing, nothing), jnp.arange(world.horizon))[0]
        value = highest if world.task.rises else (centre(end) - begun)[0]
        return Evaluation(value, ~jnp.isfinite(value))

    def policy(self, genome: Float[Array, "gene"]) -> Policy:
        """The phase controller with these genes, by the clock that the world shows."""
        phase = jnp.pi * genome[self.gene]

        def act(key: Key[Array, ""], observation: PerRole) -> PerRole:
            del key
            sine, cosine = observation[ROLE][:, -CLOCK:].T
            control = cosine[:, None] * jnp.sin(phase) - sine[:, None] * jnp.cos(phase)
            return {ROLE: control}

        return act


def world_of(settings: TaskSettings) -> SoftBody2D:
    """The world of a case."""
    chosen: dict[str, Any] = {"body": BODIES[settings.body], "task": settings.task}
    return SoftBody2D(**chosen)


def learner_of(settings: TaskSettings) -> CMAES:
    """CMA-ES for a case: a gene for each cell of the bounding grid, the first mean in [0, 1]."""
    world = world_of(settings)
    width, height = world.cells.max(0) + 1
    genes = int(width * height)
    gene = jnp.asarray(world.cells[:, 0] + width * world.cells[:, 1], jnp.int32)
    limit = jnp.full(genes, jnp.inf)
    space = SearchSpace(jnp.zeros(genes), jnp.ones(genes), -limit, limit)
    return CMAES(space, PhaseFitness(world, gene), **dataclasses.asdict(settings.optimiser))


def task_cost(case: Case) -> Cost:
    """About what a case takes on one core."""
    settings = case.parsed(TaskSettings)
    world = world_of(settings)
    steps = settings.trials * settings.births * world.horizon * len(world.cells)
    return Cost(seconds=10 + steps / VOXEL_STEPS_PER_SECOND, bytes=PROCESS_BYTES)


def run_task(case: Case, context: Context) -> dict[str, xr.Dataset]:
    """Evolve controllers of a body for a task, in all runs side by side.

    Returns:
        `results` (dimensions trial, generation): the best value so far of each generation, that of
        the best controller of each run, its energy and the energy fitness.

    """
    settings = case.parsed(TaskSettings)
    world, learner = world_of(settings), learner_of(settings)
    use_kernels(context, world)
    keys = trial_keys(settings.seed, case.name, settings.trials)
    candidates = settings.optimiser.population_size
    if candidates is None:
        candidates = default_population_size(learner.search_space.size)
    generations = settings.births // candidates
    if not generations:
        raise InvalidSettings(
            f"births = {settings.births}: one generation has {candidates} candidates; allowed: at "
            "least as many."
        )
    trained = train_case(
        Trials(learner), fold_in(keys, 0), fold_in(keys, 1), generations, context, _curves
    )
    best = trained.state.best_ever
    value, energy = (np.asarray(each) for each in _watched(learner, best.genome))
    seconds = world.task.seconds
    scale = 1.0 if world.task.rises else 1 / seconds
    found: dict[str, Any] = {
        "best": (("trial", "generation"), trained.curves["best"].T),
        "value": ("trial", np.asarray(best.fitness)),
        "return": ("trial", value),
        "energy": ("trial", energy),
        "energy_fitness": ("trial", energy_fitness(value * scale, energy)),
    }
    attributes = dataclasses.asdict(task_condition(settings)) | {
        "births": settings.births,
        "seconds": seconds,
        "rises": int(world.task.rises),
    }
    generation = np.arange(1, generations + 1)
    return {"results": xr.Dataset(found, {"generation": generation}, attrs=attributes)}


def _curves(metrics: Metrics) -> Arrays:
    return {"best": np.asarray(metrics["best"])}


@eqx.filter_jit
def _watched(learner: CMAES, genomes: Float[Array, "trial gene"]) -> tuple[Array, Array]:
    """Return and mean energy of an episode of each, through the world's own steps."""
    fitness = learner.fitness
    assert isinstance(fitness, PhaseFitness)
    world = fitness.world

    def kept(transition: Transition) -> tuple[Array, Array]:
        return transition.outcome.reward[ROLE][0], transition.outcome.metrics["energy"]

    def one(genome: Array) -> tuple[Array, Array]:
        act = fitness.policy(genome)
        _, (reward, energy) = rollout(world, act, jax.random.key(0), world.horizon, keep=kept)
        return reward.sum(), energy[world.settling :].mean()

    return jax.vmap(one)(genomes)
