"""Simulation: states and commands in, states out, for a block of robots and many steps.

All that moves a body in the plane goes through `simulate`, or, one voxel driven at a time, through
`avalanche.avalanches`.  On a CPU a kernel written by hand does the steps (`kernel`), where there is
one for the processor; elsewhere they are `motion.step` in JAX.  `jax.vmap` over robots of one body
lays them side by side, however deep it is nested; over bodies, materials or terrains the kernel
takes one after the other, and JAX does what it always does.  Derivatives are those of the steps in
JAX.
"""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float

from ethogram.core.batching import plain_vmap, with_vmap_rule
from ethogram.core.errors import InvalidSettings
from ethogram.core.settings import Number
from ethogram.physics.kernel_calls import on_cpus
from ethogram.physics.lattice2d import kernel as native_kernel
from ethogram.physics.lattice2d.contacts import POINTS, Terrain
from ethogram.physics.lattice2d.lattice import COLOURS, Lattice
from ethogram.physics.lattice2d.material import Material
from ethogram.physics.lattice2d.motion import State, step
from ethogram.physics.lattice2d.springs import SIDES


def simulate(
    lattice: Lattice,
    material: Material,
    state: State,
    control: Float[Array, "step voxel *batch"],
    *,
    gravity: Number,
    terrain: Terrain | None = None,
    kernel: str = "auto",
) -> State:
    """The state after as many steps of `material.time_step` as there are commands.

    Args:
        lattice: the body.
        material: of its voxels.
        state: at the start; made for a terrain, or for none, as there is one.
        control: of each voxel at each step: 1 contracts, -1 expands, 0 is at rest.
        gravity: acceleration downwards (m/s^2).
        terrain: what there is to touch; None is nothing.
        kernel: what does it on a CPU: "auto" (the fastest kernel that there is for the processor,
            or what the environment variable `ETHOGRAM_KERNEL` says), "none" (JAX), or a kernel by
            its instruction set: "x86-64-v4", "x86-64-v3", "x86-64", "portable".

    Raises:
        InvalidSettings: an array is not of the shape or the type that it should be.
        EthogramError: there is no such kernel.

    """
    control = _checked(lattice, state, control, terrain)
    if len(control) == 0:
        return state
    gravity = jnp.asarray(gravity, control.dtype)
    arguments = lattice, material, gravity, terrain, state, control
    name = native_kernel.target(control.dtype, kernel)
    found: State
    if name is None:
        found = _simulated(*arguments)
    else:
        found = on_cpus(native_kernel.simulation(name, _steps), _simulated, *arguments)
    return found


def _checked(lattice: Lattice, state: State, control: Any, terrain: Terrain | None) -> Array:
    """Commands as an array of the state's type."""
    dtype, control = state.moved.dtype, jnp.asarray(control)
    batch = state.moved.shape[3:]
    bodies = (COLOURS, lattice.bodies, *batch)
    for name, array, shape in (
        ("state.moved", state.moved, (2, *bodies)),
        ("state.heading", state.heading, (2, *bodies)),
        ("state.velocity", state.velocity, (3, *bodies)),
        ("state.change", state.change, (3, *bodies)),
        ("state.rope", state.rope, (len(SIDES), lattice.voxels, *batch)),
        ("state.contact", state.contact, (POINTS if terrain else 0, 2, *bodies)),
        ("control", control, (*control.shape[:1], lattice.voxels, *batch)),
    ):
        is_typed = array.dtype == dtype or array is control
        if array.shape != shape or not (is_typed and jnp.issubdtype(array.dtype, jnp.floating)):
            raise InvalidSettings(
                f"simulate: {name} has the shape {array.shape} and the type {array.dtype}; "
                f"allowed: {shape} and {dtype}."
            )
    return control.astype(dtype)


def _steps(
    lattice: Lattice,
    material: Material,
    gravity: Array,
    terrain: Terrain | None,
    state: State,
    control: Array,
) -> State:
    advance = partial(step, lattice, material, gravity=gravity, terrain=terrain)
    if len(control) == 1:
        return advance(state, control[0])
    return lax.scan(lambda at, now: (advance(at, now), None), state, control)[0]


def _batched(size: int, is_batched: list[Any], *arguments: Any) -> tuple[Any, Any]:
    """Robots of one body side by side."""
    *surroundings, state, control = arguments
    if any(jax.tree.leaves(is_batched[:-2])):
        return plain_vmap(_steps, is_batched, arguments)

    def last(leaf: Array, there: bool) -> Array:
        leaf = leaf if there else jnp.broadcast_to(leaf, (size, *leaf.shape))
        return jnp.moveaxis(leaf, 0, -1)

    moved = jax.tree.map(last, (state, control), tuple(is_batched[-2:]))
    after = _simulated(*surroundings, *moved)
    first = jax.tree.map(lambda leaf: jnp.moveaxis(leaf, -1, 0), after)
    return first, jax.tree.map(lambda _: True, first)


_simulated = with_vmap_rule(_steps, _batched)
