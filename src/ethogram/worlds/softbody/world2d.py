"""Soft robot in the plane: it senses with every voxel and changes the area of every voxel.

One step is one step of the physics (`ethogram.physics.lattice2d`), 1/60 s.  What the robot is for
is a task (`tasks`): to get ahead, to jump, to escape through a narrowing gap, or one of a user's
own.  The return of an episode is the way, or the highest rise, in metres.  It terminates when
something is not finite, and is truncated when time is up.

`metrics` has `energy`, of the control in this step: u^2 of the voxels that are commanded beyond the
area that they have at rest, mean over all voxels.  The thesis' tables seem to show a fitness that
is made less by it, v / (1 + 400 P), with v the velocity and P the mean energy (`energy_fitness`).

Deviations from the thesis are those of the physics; the robot also sees a clock of 1 Hz, that of
the phase controller.
"""

from functools import cache
from typing import Annotated, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Int, Key
from pydantic import AfterValidator, Field

from ethogram.core.clock import phase
from ethogram.core.errors import EthogramError
from ethogram.core.rollout import first_episode
from ethogram.core.scene import Scene
from ethogram.core.settings import Number, chosen, setting
from ethogram.core.spaces import Box
from ethogram.core.world import Outcome, PerRole, Role, Transition, World
from ethogram.physics.lattice2d import (
    Lattice,
    Material,
    State,
    Terrain,
    at_rest,
    lattice,
    simulate,
)
from ethogram.physics.lattice2d.contacts import height
from ethogram.physics.lattice2d.squares import over_batch
from ethogram.physics.native import Kernel
from ethogram.worlds.softbody.bodies import PLANE, PLANE_BODIES, Body, cells_of, text_of
from ethogram.worlds.softbody.scene2d import FRAMES, Outline, outline, scene_of_outlines
from ethogram.worlds.softbody.sensors import CLOCK, clock
from ethogram.worlds.softbody.sensors2d import PER_VOXEL, Voxels, readings, voxels
from ethogram.worlds.softbody.tasks import DROP, TASKS, Task, task_of

ROLE = "robot"
PRICE = 400.0  # of energy, in the thesis' tables
STEPS_PER_SECOND = 60


class RobotState(eqx.Module):
    """A robot, and how far its episode is."""

    body: State
    step: Int[Array, ""]  # taken so far
    standing: Float[Array, ""]  # height of the centre after the first step that was commanded, m
    highest: Float[Array, ""]  # that the centre has risen above it, m


def _readable(body: str) -> str:
    """The one spelling of a body that a plan names, or pydantic's word on what is wrong with it."""
    try:
        return body if body in PLANE_BODIES else text_of(cells_of(body, axes=PLANE))
    except EthogramError as error:
        raise ValueError(str(error).rstrip(".")) from error


def lattice_of(body: Body | Lattice) -> Lattice:
    """The body as the physics knows it; bodies alike are made once.

    Raises:
        InvalidSettings: it is no body (see `bodies.cells_of`).

    """
    if isinstance(body, Lattice):
        return body
    named = PLANE_BODIES.get(body, body) if isinstance(body, str) else body
    return _lattice(text_of(cells_of(named, axes=PLANE)))


@cache
def _lattice(text: str) -> Lattice:
    with jax.ensure_compile_time_eval():
        return lattice(cells_of(text, axes=PLANE))


class SoftBody2D(World):
    """A robot of square voxels; one role, `robot`, of one agent.

    Action: control of every voxel, from -1 (expand to the largest area) to 1 (contract to the
    smallest).  In the first step, and while it settles, nothing is commanded.
    Observation: of every voxel in turn touch, velocity along its own x and y axes, and area, all
    in [0, 1] (`sensors2d`), then sine and cosine of a clock of 1 Hz.  Voxels are in the order of
    `cells`.

    Attributes:
        body: "box", "worm", "biped" or "revT" of chapter 6, a text layer ("####/#..#"), a grid of
            truth values [x, y] or a lattice.  It is kept as a lattice, which is data: worlds whose
            bodies have arrays of the same shapes are one compiled program.
        task: "locomotion", "jump", "escape", "hills", "steps", or a `tasks.Task`.
        steps: of an episode, of 1/60 s each with the default material, from 1 to 10 000 000; None
            is as many as the task takes.
        material: of its voxels.
        gravity: m/s^2; 0 or more.
        frequency: of the clock, Hz; 0 or more.
        kernel: what does the physics on a CPU (see `ethogram.physics.lattice2d.simulate`).

    """

    body: Lattice = setting(
        "####/####/#..#", Annotated[str, AfterValidator(_readable)], converter=lattice_of
    )
    task: Task = chosen("locomotion", TASKS, task_of)
    steps: int | None = setting(
        None, Annotated[int, Field(ge=1, le=10_000_000)] | None, static=True
    )
    material: Material = eqx.field(default_factory=Material)
    gravity: Number = setting(9.8, Annotated[float, Field(ge=0)])
    frequency: Number = setting(1.0, Annotated[float, Field(ge=0)])
    kernel: str = setting("auto", Kernel, static=True)

    @property
    def cells(self) -> Int[np.ndarray, "voxel 2"]:
        """The places of the voxels in the grid (x, y), without padding."""
        found: np.ndarray = np.asarray(self.body.cell)[np.asarray(self.body.used)]
        return found

    @property
    def roles(self) -> dict[str, Role]:
        """One robot: sensors in, controls out."""
        count = self.body.voxels
        low = jnp.concatenate([jnp.zeros(PER_VOXEL * count), -jnp.ones(CLOCK)])
        observation = Box(low, 1.0, (PER_VOXEL * count + CLOCK,))
        return {ROLE: Role(1, observation, Box(-1.0, 1.0, (count,)))}

    @property
    def horizon(self) -> int:
        """Steps of an episode: settling, then control."""
        whole = self.settling + round(self.task.seconds * STEPS_PER_SECOND)
        return whole if self.steps is None else self.steps

    @property
    def settling(self) -> int:
        """Steps in which nothing is commanded."""
        return round(self.task.settling * STEPS_PER_SECOND)

    @property
    def kernels(self) -> dict[str, str]:
        """That of lattices in the plane, as the setting says."""
        return {"lattice2d": self.kernel}

    @property
    def terrain(self) -> Terrain:
        """Ground and ceiling."""
        return self.task.terrain(self.body, self.material.edge)

    def reset(self, key: Key[Array, ""]) -> tuple[RobotState, PerRole]:
        """A robot above the place where its task begins."""
        del key  # nothing is left to chance
        cells, edge = self.body.cell, self.material.edge
        used = self.body.used
        left = jnp.where(used, cells[:, 0], cells.max()).min()
        x = self.task.start - left * edge
        corners = jnp.stack([cells[:, 0], cells[:, 0] + 1]) * edge
        above = height(self.terrain, x + corners) - cells[:, 1] * edge
        y = jnp.where(used, above, -jnp.inf).max() + DROP
        body = at_rest(self.body, place=(x, y))
        nothing = jnp.zeros((), body.moved.dtype)
        state = RobotState(body, jnp.int32(0), nothing, nothing)
        return state, self.observe(state)

    def observe(self, state: RobotState) -> PerRole:
        """The robot's sensors, and the clock."""
        found = voxels(self.body, self.material, state.body)
        time = state.step - self.settling
        angle = phase(jnp.maximum(time, 0), self.frequency, self.material.time_step)
        sensed = readings(found, self.body.used)
        return {ROLE: jnp.concatenate([sensed, clock(angle).astype(sensed.dtype)])[None]}

    def step(
        self, key: Key[Array, ""], state: RobotState, action: PerRole
    ) -> tuple[RobotState, Outcome]:
        """Command the voxels for one step of the physics."""
        del key
        is_commanded = state.step >= self.first_command
        control = jnp.where(is_commanded & self.body.used, action[ROLE][0], 0.0)
        body = self.move(state.body, control)
        before = voxels(self.body, self.material, state.body)
        found = voxels(self.body, self.material, body)
        (x, _), (now_x, up) = self.centre(before), self.centre(found)
        standing = jnp.where(state.step <= self.first_command, up, state.standing)
        highest = jnp.maximum(state.highest, up - standing)
        after = RobotState(body, state.step + 1, standing, highest)
        gained = highest - state.highest if self.task.rises else now_x - x
        failed = ~jnp.isfinite(now_x + up)
        return after, Outcome(
            observation=self.observe(after),
            reward={ROLE: jnp.where(failed, 0.0, gained)[None]},
            terminated={ROLE: failed[None]},
            truncated={ROLE: (after.step >= self.horizon)[None]},
            metrics={"energy": self.energy(found, control)},
        )

    @property
    def first_command(self) -> int:
        """How many steps are taken before anything is commanded."""
        return max(self.settling, 1)

    def move(self, body: State, control: Float[Array, "voxel *batch"]) -> State:
        """Let the physics take a step; for batches, too."""
        limited = jnp.clip(control, -1.0, 1.0)
        return simulate(
            self.body,
            self.material,
            body,
            limited[None],
            gravity=self.gravity,
            terrain=self.terrain,
            kernel=self.kernel,
        )

    def centre(self, found: Voxels) -> Float[Array, "2 *batch"]:
        """The centre of mass: the mean of the voxels' centres, m."""
        used = over_batch(self.body.used, found.area.ndim - 1)
        return jnp.where(used, found.centre, 0.0).sum(1) / self.body.used.sum()

    def energy(
        self, found: Voxels, control: Float[Array, "voxel *batch"]
    ) -> Float[Array, "*batch"]:
        """Energy of a step of control: u^2 where it takes voxels beyond their resting area.

        The mean over voxels.

        Args:
            found: the voxels after the step.
            control: in force in it.

        """
        pushes = jnp.where(control > 0, found.area < 1, found.area > 1)
        used = over_batch(self.body.used, found.area.ndim - 1)
        return jnp.where(pushes & used, control**2, 0.0).sum(0) / self.body.used.sum()

    def scene(self, trajectory: Transition) -> Scene:
        """The first episode: its start, and states evenly spread over it."""
        episode = first_episode(self, trajectory)
        used = np.asarray(self.body.used)
        apart = -(-len(episode.state.step) // FRAMES)
        parts = []
        for state in (episode.state, episode.next_state):
            drawn = jax.vmap(lambda body: outline(self.body, self.material, body))(state.body)
            parts.append(Outline(*(np.asarray(part)[..., used] for part in drawn)))
        frames = Outline(
            *(np.concatenate([one[:1], rest])[::apart] for one, rest in zip(*parts, strict=True))
        )
        return scene_of_outlines(
            f"Soft robot in the plane: {text_of(self.cells)}",
            frames,
            self.terrain,
            seconds=apart * float(self.material.time_step),
        )


def energy_fitness(velocity: Any, energy: Any) -> Any:
    """Velocity made less by the energy that it takes: v / (1 + 400 P).

    Args:
        velocity: v, m/s (of a jump the height, m).
        energy: P, the mean of `energy` over steps.

    """
    return velocity / (1 + PRICE * energy)
