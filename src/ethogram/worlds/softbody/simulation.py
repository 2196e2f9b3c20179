"""Whole-episode simulation of many robots of one body: how far each gets.

`simulate` is the one way from controllers to distances.  Robots lie side by side as the last axis;
`jax.vmap` over sets of robots, as over runs of an evolution, makes one longer row of them.  Every
step of the physics goes through `ethogram.physics.beams3d.simulate`, by the kernel that the world
names; controllers, sensors and laws of a user's own stay in JAX.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float

from ethogram.core.batching import plain_vmap, with_vmap_rule
from ethogram.core.errors import InvalidSettings
from ethogram.physics.beams3d import State
from ethogram.worlds.softbody.controllers import Controller
from ethogram.worlds.softbody.starts import Start
from ethogram.worlds.softbody.world3d import SoftBody3D

BLOCK_ROBOTS = 192  # robots simulated side by side
BLOCK_VOXELS = 2048  # at most, where that leaves 16 robots: the state of more leaves the cache
LANES = 16  # numbers that a processor takes at a time: the fewest robots of a block
SHARED_GRAVITY = 2  # axes of a gravity that is the same for all robots: step, component


class SimulationResult(eqx.Module):
    """Distances of robots, and what was recorded of them."""

    distance: Float[Array, "robot"]  # m along +x, of the centre of mass; NaN if diverged
    diverged: Bool[Array, "robot"]
    recorded: Any  # what `record` returned, with samples as leading axis, then its own, robots last


def simulate(
    world: SoftBody3D,
    controller: Controller,
    parameters: Float[Array, "gene robot"],
    gravity: Float[Array, "step 3 *robot"],
    *,
    start: Start | None = None,
    record: Callable[[State], Any] | None = None,
    record_every: int | None = None,
    block_size: int | None = None,
) -> SimulationResult:
    """Let robots move for as many steps as gravity is given for.

    No robot harms another: one that diverges (a strain beyond 100, or something not finite) is
    flagged, and the others go on as if it were not there.  Robots are simulated in blocks, the last
    one filled up with copies: so their state stays in the processor's cache, and where a robot goes
    does not depend, to the last bit, on how many others there are, which one it is, or what is
    recorded.  Blocks of another size are rounded otherwise, by JAX if not by the kernel, and a
    sensing robot then soon goes another way.

    Args:
        world: the body and its surroundings.
        controller: the law of control, the same for all.
        parameters: one column per robot.
        gravity: acceleration (m/s^2) at each step, as `gravity.schedule` makes it: the same for
            all robots, or one each.
        start: one each; None is at rest for all.
        record: what to keep of the state of all robots; robots are the last axis.  None keeps
            nothing.
        record_every: how many steps between two samples; the first is before the first step.
        block_size: robots in a block; None leaves it to the body.  Fewer are faster for a lone
            robot.

    Raises:
        InvalidSettings: the steps are not a whole number of samples, or no robot is in a block.

    """
    every = record_every or len(gravity)
    if len(gravity) % every:
        raise InvalidSettings(f"record_every = {every}: it should divide the {len(gravity)} steps.")
    width = robots_per_block(world) if block_size is None else block_size
    if width < 1:
        raise InvalidSettings(f"block_size = {width}: it should be at least 1.")
    arrays, static = eqx.partition((world, controller, record), eqx.is_array)
    found: SimulationResult = _simulation(static, width, every)(arrays, parameters, gravity, start)
    return found


def robots_per_block(world: SoftBody3D) -> int:
    """How many robots of a body to simulate side by side: a whole number of `LANES`."""
    fitting = BLOCK_VOXELS // world.body.voxels // LANES * LANES
    return max(LANES, min(BLOCK_ROBOTS, fitting))


def _simulation(static: Any, width: int, every: int) -> Callable[..., Any]:
    """The simulation of robots side by side, of which `vmap` makes more robots side by side."""

    def in_blocks(
        arrays: Any, parameters: Array, gravity: Array, start: Start | None
    ) -> SimulationResult:
        episode = partial(_episode, *eqx.combine(arrays, static), every=every)
        return _in_blocks(episode, width, parameters, gravity, start)

    def in_one_row(
        size: int,
        batched: list[Any],
        arrays: Any,
        parameters: Array,
        gravity: Array,
        start: Any,
    ) -> tuple[Any, Any]:
        if any(jax.tree.leaves(batched[0])):  # worlds or controllers differ
            return plain_vmap(in_blocks, batched, (arrays, parameters, gravity, start))
        robots = parameters.shape[-1]
        own_gravity = gravity.ndim - batched[2] > SHARED_GRAVITY
        if batched[2] and not own_gravity:
            gravity = jnp.broadcast_to(gravity[..., None], (*gravity.shape, robots))
        result = simulation(
            arrays,
            _one_row(size, parameters, batched[1]),
            _one_row(size, gravity, batched[2]) if batched[2] or own_gravity else gravity,
            jax.tree.map(partial(_one_row, size), start, batched[3]),
        )

        def apart(leaf: Array) -> Array:
            return jnp.moveaxis(leaf.reshape(*leaf.shape[:-1], size, robots), -2, 0)

        return jax.tree.map(apart, result), jax.tree.map(lambda _: True, result)

    simulation = with_vmap_rule(in_blocks, in_one_row)
    return simulation


def _one_row(size: int, values: Array, is_batched: bool) -> Array:
    """Robots of a batch, whose axis comes first, as one row: the last axis."""
    if not is_batched:
        values = jnp.broadcast_to(values, (size, *values.shape))
    return jnp.moveaxis(values, 0, -2).reshape(*values.shape[1:-1], -1)


def _in_blocks(
    episode: Callable[..., SimulationResult],
    width: int,
    parameters: Float[Array, "gene robot"],
    gravity: Float[Array, "step 3 *robot"],
    start: Start | None,
) -> SimulationResult:
    """Robots block after block, the last one filled up with copies of the last robot."""
    robots = parameters.shape[-1]
    blocks = -(-robots // width)

    def block(values: Array) -> Array:
        room = [(0, 0)] * (values.ndim - 1) + [(0, blocks * width - robots)]
        filled = jnp.pad(values, room, mode="edge")
        return jnp.moveaxis(filled.reshape(*values.shape[:-1], blocks, width), -2, 0)

    def simulate_block(each: tuple[Array, Array | None, Start | None]) -> SimulationResult:
        columns, own, starts = each
        return episode(columns, gravity if own is None else own, starts)

    own = block(gravity) if gravity.ndim > SHARED_GRAVITY else None
    found = lax.map(simulate_block, (block(parameters), own, jax.tree.map(block, start)))
    return jax.tree.map(
        lambda leaf: jnp.moveaxis(leaf, 0, -2).reshape(*leaf.shape[1:-1], -1)[..., :robots], found
    )


def _episode(
    world: SoftBody3D,
    controller: Controller,
    record: Callable[[State], Any] | None,
    parameters: Float[Array, "gene robot"],
    gravity: Float[Array, "step 3 *robot"],
    start: Start | None,
    *,
    every: int,
) -> SimulationResult:
    drive = controller.drive(parameters)
    first = world.at_rest(parameters.shape[1:]) if start is None else world.started(start)

    def advance(state: State, pull: Float[Array, "3 *robot"]) -> tuple[State, None]:
        edge = world.material.edge * drive(world.sense(state, start))
        return world.move(state, edge, pull), None

    def sample(state: State, pulls: Float[Array, "every 3 *robot"]) -> tuple[State, Any]:
        recorded = None if record is None else record(state)
        state, _ = lax.scan(advance, state, pulls)
        return state, recorded

    end, recorded = lax.scan(sample, first, gravity.reshape(-1, every, *gravity.shape[1:]))
    gone = world.distance(first, end)
    return SimulationResult(jnp.where(end.diverged, jnp.nan, gone), end.diverged, recorded)
