"""Many robots of one body through one simulation: how far each gets.

`travel` is the one way from controllers to distances, and the place of a faster one.  A kernel
written by hand for a processor would take the place of `_simulate`, a block of robots at a time:
all that it needs are arrays (the body's indices, numbers of the material, parameters with robots
side by side, gravity step by step) and the name of the law, of which there are two with two forms
each; and all that it returns are distances and, for those who watch, states at some steps.  What a
user brings along, a law of their own, would go on through `_simulate`.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float

from ethogram.core.errors import InvalidSettings
from ethogram.physics.beams3d import State, at_rest, centre
from ethogram.worlds.softbody3d.controllers import Controller
from ethogram.worlds.softbody3d.world import SoftBody3D

ABREAST = 96  # robots simulated side by side
VOXELS_ABREAST = 2048  # at most, where that leaves 16 robots: the state of more leaves the cache
LANES = 16  # numbers that a processor takes at a time: the least robots abreast


class Journey(eqx.Module):
    """What became of each robot."""

    distance: Float[Array, "robot"]  # m along +x, of the centre of mass; not a number if broken
    broken: Bool[Array, "robot"]
    seen: Any  # what `watch` saw, with samples as leading axis, then its own, robots last


def travel(
    world: SoftBody3D,
    controller: Controller,
    parameters: Float[Array, "gene robot"],
    gravity: Float[Array, "step 3 *robot"],
    *,
    watch: Callable[[State], Any] | None = None,
    every: int | None = None,
    abreast: int | None = None,
) -> Journey:
    """Let robots move for as many steps as gravity is given for.

    No robot harms another: one that breaks (a strain beyond 100, or something not finite) is
    flagged, and the others go on as if it were not there.  Robots are simulated in blocks, the last
    one filled up with copies: so their state stays in the processor's cache, and where a robot goes
    does not depend, to the last bit, on how many others there are, which one it is, or who watches.
    Blocks of another size are rounded otherwise, and a sensing robot then soon goes another way.

    Args:
        world: the body and its surroundings.
        controller: the law of control, the same for all.
        parameters: one column per robot.
        gravity: acceleration (m/s^2) at each step, as `gravity.schedule` makes it: the same for
            all robots, or one each.
        watch: what to look at, of the state of all robots; robots are the last axis.  None looks
            at nothing.
        every: how many steps between two looks; the first is before the first step.
        abreast: robots in a block; None leaves it to the body.  Fewer are faster for a lone robot.

    Raises:
        InvalidSettings: the steps are not a whole number of looks, or no robot is in a block.

    """
    every = every or len(gravity)
    if len(gravity) % every:
        raise InvalidSettings(f"every = {every}: it should divide the {len(gravity)} steps.")
    width = robots_abreast(world) if abreast is None else abreast
    if width < 1:
        raise InvalidSettings(f"abreast = {width}: it should be at least 1.")
    robots = parameters.shape[-1]
    blocks = -(-robots // width)

    def part(values: Array) -> Array:
        room = [(0, 0)] * (values.ndim - 1) + [(0, blocks * width - robots)]
        filled = jnp.pad(values, room, mode="edge")
        return jnp.moveaxis(filled.reshape(*values.shape[:-1], blocks, width), -2, 0)

    def simulate(each: tuple[Array, Array | None]) -> Journey:
        columns, own = each
        return _simulate(world, controller, columns, gravity if own is None else own, watch, every)

    own = part(gravity) if gravity.ndim > 2 else None
    found = lax.map(simulate, (part(parameters), own))
    return jax.tree.map(
        lambda leaf: jnp.moveaxis(leaf, 0, -2).reshape(*leaf.shape[1:-1], -1)[..., :robots], found
    )


def robots_abreast(world: SoftBody3D) -> int:
    """How many robots of a body to simulate side by side: a whole number of `LANES`."""
    fitting = VOXELS_ABREAST // world.lattice.voxels // LANES * LANES
    return max(LANES, min(ABREAST, fitting))


def _simulate(
    world: SoftBody3D,
    controller: Controller,
    parameters: Float[Array, "gene robot"],
    gravity: Float[Array, "step 3 *robot"],
    watch: Callable[[State], Any] | None,
    every: int,
) -> Journey:
    drive = controller.drive(parameters)
    start = at_rest(world.lattice, world.material, parameters.shape[1:])

    def advance(state: State, pull: Float[Array, "3 *robot"]) -> tuple[State, None]:
        edge = world.material.edge * drive(world.sense(state))
        return world.move(state, edge, pull), None

    def look(state: State, pulls: Float[Array, "every 3 *robot"]) -> tuple[State, Any]:
        seen = None if watch is None else watch(state)
        state, _ = lax.scan(advance, state, pulls)
        return state, seen

    end, seen = lax.scan(look, start, gravity.reshape(-1, every, *gravity.shape[1:]))
    gone = (centre(world.lattice, end) - centre(world.lattice, start))[0]
    return Journey(jnp.where(end.broken, jnp.nan, gone), end.broken, seen)
