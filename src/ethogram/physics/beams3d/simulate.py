"""Simulation: states and commands in, states out, for a block of robots and many steps.

All that moves a body goes through `simulate`.  On a CPU a kernel written by hand does the steps
(`kernel`), where there is one for the processor; elsewhere they are `motion.step` in JAX.
`jax.vmap` over robots of one body and one material lays them side by side, however deep it is
nested; over bodies or materials the kernel takes one after the other, and JAX does what it always
does.  Derivatives are those of the steps in JAX, which are traced only for these.
"""

from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float

from ethogram.core.batching import plain_vmap, with_vmap_rule
from ethogram.core.errors import InvalidSettings
from ethogram.physics.beams3d import kernel as native_kernel
from ethogram.physics.beams3d.lanes import more_lanes
from ethogram.physics.beams3d.lattice import Lattice
from ethogram.physics.beams3d.material import Material
from ethogram.physics.beams3d.motion import State, step
from ethogram.physics.kernel_calls import on_cpus


def simulate(
    lattice: Lattice,
    material: Material,
    state: State,
    edge: Float[Array, "step voxel *batch"],
    gravity: Float[Array, "step 3 ..."],
    *,
    floor: bool = True,
    kernel: str = "auto",
) -> State:
    """The state after as many steps of `material.time_step` as there are commands.

    Args:
        lattice: the body.
        material: of voxels and floor.
        state: at the start.
        edge: commanded at each step (m).
        gravity: acceleration at each step (m/s^2), the same for all robots or one each.
        floor: whether there is one, at z = 0.
        kernel: what does it on a CPU: "auto" (the fastest kernel that there is for the processor,
            or what the environment variable `ETHOGRAM_KERNEL` says), "none" (JAX), or a kernel by
            its instruction set: "x86-64-v4", "x86-64-v3", "x86-64", "portable".

    Raises:
        InvalidSettings: an array is not of the shape or the type that it should be.
        EthogramError: there is no such kernel.

    """
    edge, gravity = _checked(lattice, state, edge, gravity)
    if len(edge) == 0:
        return state
    arguments = lattice, material, state, edge, gravity
    name, in_jax = native_kernel.target(edge.dtype, kernel), _simulation_in_jax(floor)
    found: State
    if name is None:
        found = in_jax(*arguments)
    else:
        by_kernel = native_kernel.simulation(name, floor, _in_jax(floor))
        found = on_cpus(by_kernel, in_jax, *arguments)
    return found


def _checked(lattice: Lattice, state: State, edge: Any, gravity: Any) -> tuple[Array, Array]:
    """Edges and gravity as arrays of the state's type."""
    dtype = state.position.dtype
    edge, gravity = jnp.asarray(edge), jnp.asarray(gravity)
    batch = state.position.shape[2:]
    voxels, bonds = (lattice.voxels, *batch), (lattice.bonds, *batch)
    steps = edge.shape[:1]
    real, flag = (dtype,), (jnp.dtype(bool),)
    any_real = tuple(map(jnp.dtype, (jnp.float16, jnp.bfloat16, jnp.float32, jnp.float64)))
    memory = state.memory
    for name, array, shapes, dtypes in (
        ("state.position", state.position, [(3, *voxels)], any_real),
        ("state.orientation", state.orientation, [(4, *voxels)], real),
        ("state.momentum", state.momentum, [(3, *voxels)], real),
        ("state.angular_momentum", state.angular_momentum, [(3, *voxels)], real),
        ("state.force", state.force, [(3, *voxels)], real),
        ("state.edge", state.edge, [voxels], real),
        ("state.strain", state.strain, [bonds], real),
        ("state.memory.small", memory.small, [bonds], flag),
        ("state.memory.deformation", memory.deformation, [(9, *bonds)], real),
        ("state.steps", state.steps, [(), batch], (jnp.dtype(jnp.int32),)),
        ("state.diverged", state.diverged, [batch], flag),
        ("state.clearance", state.clearance, [batch], real),
        ("edge", edge, [(*steps, *voxels)], any_real),
        ("gravity", gravity, [(*steps, 3), (*steps, 3, *batch)], any_real),
    ):
        if array.shape not in shapes or array.dtype not in dtypes:
            allowed = " or ".join(dict.fromkeys(map(str, shapes)))
            types = " or ".join(map(str, dtypes))
            raise InvalidSettings(
                f"simulate: {name} has the shape {array.shape} and the type {array.dtype}; "
                f"allowed: {allowed} and {types}."
            )
    return edge.astype(dtype), gravity.astype(dtype)


@cache
def _in_jax(floor: bool) -> Any:
    """The steps in JAX."""

    def steps(
        lattice: Lattice, material: Material, state: State, edge: Array, gravity: Array
    ) -> State:
        advance = partial(step, lattice, material, floor=floor)
        if len(edge) == 1:
            return advance(state, edge[0], gravity[0])
        return lax.scan(lambda at, now: (advance(at, *now), None), state, (edge, gravity))[0]

    return steps


@cache
def _simulation_in_jax(floor: bool) -> Any:
    """The same, of which `vmap` over robots makes more lanes."""
    steps = _in_jax(floor)

    def batched(size: int, is_batched: list[Any], *arguments: Any) -> tuple[Any, Any]:
        if any(jax.tree.leaves(is_batched[:2])):
            return plain_vmap(steps, is_batched, arguments)
        return more_lanes(simulated, size, is_batched, arguments)

    simulated = with_vmap_rule(steps, batched)
    return simulated
