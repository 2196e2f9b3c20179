"""Soft robot in space: on a floor, sensing with every voxel and moving every voxel (chapter 5).

One step is one step of the physics (`ethogram.physics.beams3d`), 0.14 ms.  The robot senses, of
every voxel, scale, speed and acceleration, and a clock (`sensors`); it commands the edge of every
voxel, in metres; it is rewarded for the way that its centre of mass makes along +x, so that the
return of an episode is the distance of the thesis (section 5.3.4).  It terminates when the
simulation diverges (a strain beyond 100, or something not finite), and is truncated when time is
up.

Many robots under fixed controllers go through `simulation.simulate`, which is faster.

Deviations from the thesis: lengths that it prints in cubic metres are read as edges in metres; the
clock shows a cosine beside the sine; commanded edges are limited to 0.25 to 1.2 edges at rest.
Other tasks (to climb, to carry) are other rewards on the same steps; there are none yet.
"""

from functools import cache
from typing import Annotated

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Int, Key
from pydantic import AfterValidator, Field

from ethogram.core.clock import phase
from ethogram.core.errors import EthogramError, InvalidSettings
from ethogram.core.rollout import first_episode
from ethogram.core.scene import Scene
from ethogram.core.settings import Number, setting
from ethogram.core.spaces import Box
from ethogram.core.world import Outcome, PerRole, Role, Transition, World
from ethogram.physics.beams3d import (
    Kernel,
    Lattice,
    Material,
    Size,
    State,
    at_rest,
    centre,
    lattice,
    pad,
    sensed_scale,
    simulate,
)
from ethogram.worlds.softbody.bodies import BODIES, MAX_VOXELS, Body, cells_of, name_of, text_of
from ethogram.worlds.softbody.gravity import Program, program
from ethogram.worlds.softbody.scene import Pose, episode_frames, scene_of_poses
from ethogram.worlds.softbody.sensors import (
    CLOCK,
    PER_VOXEL,
    Scale,
    Sensors,
    clock,
    flatten,
    flatten_used,
    length,
    only_used,
)

ROLE = "robot"


def _readable(body: str) -> str:
    """The one spelling of a body that a plan names, or pydantic's word on what is wrong with it."""
    try:
        return body if body in BODIES else text_of(cells_of(body))
    except EthogramError as error:
        raise ValueError(str(error).rstrip(".")) from error


def lattice_of(body: Body | Lattice) -> Lattice:
    """The body as the physics knows it; bodies alike are made once.

    Raises:
        InvalidSettings: it is no body (see `bodies.cells_of`).

    """
    return body if isinstance(body, Lattice) else _lattice(text_of(cells_of(body)))


def _known(gravity: str | Program) -> str | Program:
    program(gravity)
    return gravity


class SoftBody3D(World):
    """A robot of cubic voxels; one role, `robot`, of one agent.

    Action: the edge of every voxel (m), limited to between `shortest` and `longest`.  Observation:
    of every voxel in turn its scale (1 at rest), speed (m/s) and acceleration (m/s^2, times
    `acceleration_scale`), then sine and cosine of the clock.  Voxels are in the order of `cells`.

    Attributes:
        body: "worm", "biped", "tripod", text layers, a grid (see `bodies`) or a lattice.  It is
            kept as a lattice, which is data: worlds whose bodies have arrays of the same shapes are
            one compiled program.
        max_voxels: how many voxels bodies are padded to, so that all of them have the same shapes,
            from 1 to 1000; None pads nothing.
        gravity: the name of a program, or one (see `gravity`): "even", "evolution", "flat", "step",
            "sin", or a function of the share of the episode that has passed to m/s^2 (x, y, z).
        material: of its voxels and the floor.
        steps: of an episode, of 0.14 ms each with the default material; from 1 to 10 000 000.
        frequency: f, of the clock, Hz; 0 or more.
        shortest: edge that can be commanded, in edges at rest; above 0 and below `longest`.
        longest: edge that can be commanded, in edges at rest.
        sensed_scale: "strain", the mean of 1 + strain over a voxel's bonds, or "commanded".
        acceleration_scale: what sensed accelerations are multiplied by, 0 or more.
        kernel: what does the physics on a CPU: "auto", "none" (JAX), or a kernel by name; see
            `ethogram.physics.beams3d.simulate`.

    """

    body: Lattice = setting("worm", Annotated[str, AfterValidator(_readable)], converter=lattice_of)
    max_voxels: int | None = setting(
        None, Annotated[int, Field(ge=1, le=MAX_VOXELS)] | None, static=True
    )
    gravity: str | Program = eqx.field(static=True, default="even", converter=_known)
    material: Material = eqx.field(default_factory=Material)
    steps: int = setting(10_000, Annotated[int, Field(ge=1, le=10_000_000)], static=True)
    frequency: Number = setting(40.0, Annotated[float, Field(ge=0)])  # f, Hz, of the clock
    shortest: Number = setting(0.25, Annotated[float, Field(gt=0)])  # command, in edges at rest
    longest: Number = setting(1.2, Annotated[float, Field(gt=0)])
    sensed_scale: Scale = setting("strain", Scale, static=True)
    acceleration_scale: Number = setting(0.01, Annotated[float, Field(ge=0)])  # of |dv/dt|, m/s^2
    kernel: Kernel = setting("auto", Kernel, static=True)

    def __post_init__(self) -> None:
        """Pad the body, if asked for."""
        if self.max_voxels is not None:
            self.body = _padded(lattice_of(self.body), self.max_voxels)

    def __check_init__(self) -> None:
        """Refuse bounds of commands that leave nothing between them, in any world of a sweep.

        Raises:
            InvalidSettings: `shortest` is not below `longest`.

        """
        bounds = self.shortest, self.longest
        if any(isinstance(bound, jax.core.Tracer) for bound in bounds):
            return
        shortest, longest = map(np.asarray, bounds)  # NumPy: under jit JAX would trace this, too
        try:
            in_order = (shortest < longest).all()
        except ValueError:  # swept along axes of their own
            in_order = shortest.max() < longest.min()
        if not in_order:
            raise InvalidSettings(
                f"SoftBody3D: shortest = {self.shortest} and longest = {self.longest}; allowed: "
                "shortest below longest."
            )

    @property
    def cells(self) -> Int[np.ndarray, "voxel 3"]:
        """The places of the voxels in the grid (x, y, z), without padding."""
        found: np.ndarray = np.asarray(self.body.cell)[np.asarray(self.body.used)]
        return found

    @property
    def roles(self) -> dict[str, Role]:
        """One robot: sensors in, edges (m) out."""
        voxels = self.body.voxels
        used = self.body.used if self.body.is_padded else None
        readings = None if used is None else flatten_used(used)
        observation = Box(-np.inf, np.inf, (PER_VOXEL * voxels + CLOCK,), readings)
        return {ROLE: Role(1, observation, Box(*self._edges, (voxels,), used))}

    @property
    def horizon(self) -> int:
        """Steps of an episode."""
        return self.steps

    def reset(self, key: Key[Array, ""]) -> tuple[State, PerRole]:
        """A robot at rest with its lowest corner at the origin."""
        del key  # nothing is left to chance
        state = self.at_rest()
        return state, self.observe(state)

    def observe(self, state: State) -> PerRole:
        """The robot's sensors; see `sensors.flatten` for the order."""
        return {ROLE: flatten(self.sense(state))[None]}

    def step(self, key: Key[Array, ""], state: State, action: PerRole) -> tuple[State, Outcome]:
        """Command edges for one step of the physics."""
        del key
        moment = state.steps.astype(float) / self.steps
        after = self.move(state, action[ROLE][0], program(self.gravity)(moment))
        reward = jnp.where(after.diverged, 0.0, self.distance(state, after))
        return after, Outcome(
            observation=self.observe(after),
            reward={ROLE: reward[None]},
            terminated={ROLE: after.diverged[None]},
            truncated={ROLE: (after.steps >= self.steps)[None]},
        )

    def scene(self, trajectory: Transition) -> Scene:
        """The first episode: its start, and states evenly spread over it."""
        episode = first_episode(trajectory)
        used = np.asarray(self.body.used)
        left, reached = (
            Pose(*(np.asarray(part)[..., used] for part in self.pose(state)))
            for state in (episode.state, episode.next_state)
        )
        diverged = np.concatenate([episode.state.diverged[:1], episode.next_state.diverged])
        frames, apart = episode_frames(left, reached, diverged)
        return scene_of_poses(
            f"Soft robot: {name_of(self.cells)}",
            frames,
            resting=float(self.material.edge),
            seconds=apart * float(self.material.time_step),
        )

    def at_rest(self, batch: tuple[int, ...] = ()) -> State:
        """Robots that nothing has moved yet, with trailing axes for a batch."""
        return at_rest(self.body, self.material, batch)

    def sense(self, state: State) -> Sensors:
        """Read all sensors; for a batch of robots, too."""
        material = self.material
        angle = phase(state.steps, self.frequency, material.time_step)
        if self.sensed_scale == "strain":
            scale = sensed_scale(self.body, state)
        else:
            scale = state.edge / material.edge
        sensors = Sensors(
            scale=scale,
            speed=length(state.momentum) / material.mass,
            acceleration=length(state.force) / material.mass * self.acceleration_scale,
            clock=clock(angle).astype(scale.dtype),
        )
        return only_used(sensors, self.body.used) if self.body.is_padded else sensors

    def move(
        self,
        state: State,
        edge: Float[Array, "voxel *batch"],
        gravity: Float[Array, "3 ..."],
    ) -> State:
        """Limit the edges commanded (m) and let the physics take a step; for batches, too."""
        edges = jnp.clip(edge, *self._edges)
        return simulate(
            self.body, self.material, state, edges[None], gravity[None], kernel=self.kernel
        )

    def distance(self, start: State, end: State) -> Float[Array, "*batch"]:
        """How far the centre of mass got along +x (m): over an episode, its return."""
        return (centre(self.body, end) - centre(self.body, start))[0]

    def pose(self, state: State) -> Pose:
        """What a scene needs of a state."""
        return Pose(state.position, state.orientation, state.edge)

    @property
    def _edges(self) -> tuple[Number, Number]:
        """The shortest and the longest edge that can be commanded (m)."""
        return self.shortest * self.material.edge, self.longest * self.material.edge


@cache
def _lattice(text: str) -> Lattice:
    with jax.ensure_compile_time_eval():
        return lattice(cells_of(text))


def _padded(body: Lattice, voxels: int) -> Lattice:
    """The body in arrays whose shapes depend on a number of voxels alone."""
    size = Size.for_voxels(voxels)
    if body.is_padded and Size.of(body) == size:
        return body
    if body.voxels > voxels:
        raise InvalidSettings(
            f"SoftBody3D: max_voxels = {voxels}; the body has {body.voxels} voxels."
        )
    with jax.ensure_compile_time_eval():
        return pad(body, size)
