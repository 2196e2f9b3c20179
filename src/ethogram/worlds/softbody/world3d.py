"""The world of chapter 5: a soft robot on a floor, sensing with every voxel and moving every voxel.

One step is one step of the physics (`ethogram.physics.beams3d`), 0.14 ms.  The robot senses, of
every voxel, scale, speed and acceleration, and a clock (`sensors`); it commands the edge of every
voxel, in metres; it is rewarded for the way that its centre of mass makes along +x, so that the
return of an episode is the distance of the thesis (section 5.3.4).  It ends when the robot breaks
(a strain beyond 100, or something not finite: the simulation failed) or time is up.

Many robots under fixed controllers go through `locomotion.travel`, which is faster.

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

from ethogram.core.errors import EthogramError, InvalidSettings
from ethogram.core.rollout import first_episode
from ethogram.core.scene import Scene
from ethogram.core.settings import Number, setting
from ethogram.core.spaces import Box
from ethogram.core.world import Outcome, PerRole, Role, Transition, World
from ethogram.physics.beams3d import Lattice, Material, State, at_rest, centre, lattice, step
from ethogram.worlds.softbody3d.bodies import BODIES, Body, cells_of, layers
from ethogram.worlds.softbody3d.gravity import Program, program
from ethogram.worlds.softbody3d.scene import record, shown
from ethogram.worlds.softbody3d.sensors import CLOCK, PER_VOXEL, Scale, Sensors, flatten, sense

ROLE = "robot"


def _readable(body: str) -> str:
    """The one spelling of a body that a plan names, or pydantic's word on what is wrong with it."""
    try:
        return _as_text(body)
    except EthogramError as error:
        raise ValueError(str(error).rstrip(".")) from error


def _as_text(body: Body) -> str:
    return body if isinstance(body, str) and body in BODIES else layers(cells_of(body))


def _known(gravity: str | Program) -> str | Program:
    program(gravity)
    return gravity


class SoftBody3D(World):
    """A robot of cubic voxels.

    Attributes:
        body: "worm", "biped", "tripod", text layers or a grid (see `bodies`).
        gravity: the name of a program, or one (see `gravity`).
        material: of its voxels and the floor.

    """

    body: str = setting(
        "worm", Annotated[str, AfterValidator(_readable)], static=True, converter=_as_text
    )
    gravity: str | Program = eqx.field(static=True, default="even", converter=_known)
    material: Material = eqx.field(default_factory=Material)
    steps: int = setting(10_000, Annotated[int, Field(ge=1, le=10_000_000)], static=True)
    frequency: Number = setting(40.0, Annotated[float, Field(ge=0)])  # f, Hz, of the clock
    shortest: Number = setting(0.25, Annotated[float, Field(gt=0)])  # command, in edges at rest
    longest: Number = setting(1.2, Annotated[float, Field(gt=0)])
    sensed_scale: Scale = setting("strain", Scale, static=True)
    acceleration_scale: Number = setting(0.01, Annotated[float, Field(ge=0)])  # of |dv/dt|, m/s^2

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
        """The places of the voxels in the grid (x, y, z)."""
        return cells_of(self.body)

    @property
    def lattice(self) -> Lattice:
        """The body as the physics knows it."""
        return _lattice(self.body)

    @property
    def roles(self) -> dict[str, Role]:
        """One robot: sensors in, edges (m) out."""
        voxels = len(self.cells)
        seen = Box(-np.inf, np.inf, (PER_VOXEL * voxels + CLOCK,))
        return {ROLE: Role(1, seen, Box(*self._edges, (voxels,)))}

    @property
    def horizon(self) -> int:
        """Steps of an episode."""
        return self.steps

    def reset(self, key: Key[Array, ""]) -> tuple[State, PerRole]:
        """A robot at rest with its lowest corner at the origin."""
        del key  # nothing is left to chance
        state = at_rest(self.lattice, self.material)
        return state, self.observe(state)

    def observe(self, state: State) -> PerRole:
        """What the robot senses; see `sensors.flatten` for the order."""
        return {ROLE: flatten(self.sense(state))[None]}

    def step(self, key: Key[Array, ""], state: State, action: PerRole) -> tuple[State, Outcome]:
        """Command edges for one step of the physics."""
        del key
        moment = state.steps.astype(float) / self.steps
        after = self.move(state, action[ROLE][0], program(self.gravity)(moment))
        made = centre(self.lattice, after)[0] - centre(self.lattice, state)[0]
        return after, Outcome(
            observation=self.observe(after),
            reward={ROLE: jnp.where(after.broken, 0.0, made)[None]},
            terminated={ROLE: after.broken[None]},
            truncated={ROLE: (after.steps >= self.steps)[None]},
        )

    def scene(self, trajectory: Transition) -> Scene:
        """The first episode: its start, and states evenly spread over it (see `scene.shown`)."""
        episode = first_episode(trajectory)
        frames, apart = shown(episode.state, episode.next_state)
        return record(
            f"Soft robot: {self.body}",
            frames,
            resting=float(self.material.edge),
            seconds=apart * float(self.material.time_step),
        )

    def sense(self, state: State) -> Sensors:
        """Read all sensors; for a batch of robots, too."""
        return sense(
            self.lattice,
            self.material,
            state,
            scale=self.sensed_scale,
            acceleration_scale=self.acceleration_scale,
            frequency=self.frequency,
        )

    def move(
        self,
        state: State,
        edge: Float[Array, "voxel *batch"],
        gravity: Float[Array, "3 ..."],
    ) -> State:
        """Limit the edges commanded (m) and let the physics take a step; for batches, too."""
        return step(self.lattice, self.material, state, jnp.clip(edge, *self._edges), gravity)

    @property
    def _edges(self) -> tuple[Number, Number]:
        """The shortest and the longest edge that can be commanded (m)."""
        return self.shortest * self.material.edge, self.longest * self.material.edge


@cache
def _lattice(body: str) -> Lattice:
    with jax.ensure_compile_time_eval():
        return lattice(cells_of(body))
