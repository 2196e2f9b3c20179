"""The kernel written by hand: the steps of `motion.step`, compiled from `kernels/beams3d.cpp`.

It takes bodies as the leading axis of every array, each with a material of its own, and robots of a
body as trailing ones.  `jax.vmap` makes more of either.  It has no derivatives.

In 64 bits it agrees with the steps in JAX but for rounding, in 32 bits it takes large angles from a
polynomial that is 9e-8 of them off.  Where a processor has fused multiply-add its bits depend on
nothing but a robot's own state and commands: not on the instruction set, nor on the other robots,
nor on how many steps one call takes.
"""

from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from ethogram.core.batching import with_vmap_rule
from ethogram.physics import native
from ethogram.physics.beams3d.lanes import more_lanes
from ethogram.physics.beams3d.lattice import Lattice
from ethogram.physics.beams3d.material import Material
from ethogram.physics.beams3d.motion import Memory, State

SYMBOLS = {"float32": "ethogram_beams3d_f32", "float64": "ethogram_beams3d_f64"}


def target(dtype: Any, choice: str) -> str | None:
    """The name of the kernel for a type of numbers; None where there is none.

    Args:
        dtype: of the state's numbers.
        choice: "auto", "none", or a variant's name.

    """
    symbol = SYMBOLS.get(jnp.dtype(dtype).name)
    return None if symbol is None else native.target(symbol, choice)


def constants(material: Material, dtype: Any) -> Float[Array, "19"]:
    """What the kernel needs of a material, in its order."""
    time = material.time_step
    numbers = [
        *material.beam,
        *(dashpot / time for dashpot in material.bond_dashpot),
        time,
        material.mass,
        material.inertia,
        material.global_damping * material.contact_dashpot / material.mass,
        material.spin_decay,
        2 * material.elastic_modulus * material.edge,
        material.floor_damping * material.contact_dashpot / material.mass,
        material.static_friction,
        material.dynamic_friction,
    ]
    return jnp.stack([jnp.asarray(number, dtype) for number in numbers])


@cache
def simulation(name: str, floor: bool) -> Any:
    """The simulation by the kernel of that name: a function of trees with bodies as first axis.

    It takes lattices, materials, states, edges [body, step, voxel, *batch] and gravity
    [body, step, 3] or [body, step, 3, *batch], and returns states.
    """

    def steps(*arguments: Any) -> State:
        return _called(name, floor, *arguments)

    def batched(size: int, is_batched: list[Any], *arguments: Any) -> tuple[Any, Any]:
        if not any(jax.tree.leaves(is_batched[:2])):
            return more_lanes(simulated, size, is_batched, arguments, bodies=1)

        def more_bodies(leaf: Array, leaf_is_batched: bool) -> Array:
            if not leaf_is_batched:
                leaf = jnp.broadcast_to(leaf, (size, *leaf.shape))
            return leaf.reshape(-1, *leaf.shape[2:])

        after = simulated(*jax.tree.map(more_bodies, arguments, tuple(is_batched)))
        after = jax.tree.map(lambda leaf: leaf.reshape(size, -1, *leaf.shape[1:]), after)
        return after, jax.tree.map(lambda _: True, after)

    simulated = with_vmap_rule(steps, batched)
    return simulated


def _called(
    name: str,
    floor: bool,
    lattice: Lattice,
    material: Material,
    state: State,
    edge: Float[Array, "body step voxel *batch"],
    gravity: Float[Array, "body step 3 ..."],
) -> State:
    """The call itself, with all batches of robots as one axis."""
    memory = state.memory
    arrays = [
        state.position,
        state.orientation,
        state.momentum,
        state.angular_momentum,
        state.force,
        state.edge,
        state.strain,
        memory.small,
        memory.deformation,
        state.diverged,
        state.clearance,
    ]
    batch = edge.ndim - 3

    def in_a_row(array: Array, own: int) -> Array:
        return array.reshape(*array.shape[:own], -1)

    rows = [in_a_row(array, array.ndim - batch) for array in arrays]
    found = jax.ffi.ffi_call(
        name,
        [jax.ShapeDtypeStruct(row.shape, row.dtype) for row in rows],
        input_output_aliases={place: place for place in range(len(rows))},
    )(
        *rows,
        in_a_row(state.steps == 0, 1),
        in_a_row(edge, 3),
        in_a_row(gravity, 3),
        jax.vmap(partial(constants, dtype=edge.dtype))(material),
        lattice.first.voxel,
        lattice.second.voxel,
        lattice.axis,
        lattice.left.voxel,
        lattice.right.voxel,
        lattice.first.items,
        lattice.left.items,
        floor=floor,
        padded=lattice.is_padded,
    )
    position, orientation, momentum, spin, force, edges, strain, small, deformation, *last = (
        row.reshape(array.shape) for row, array in zip(found, arrays, strict=True)
    )
    diverged, clearance = last
    return State(
        position=position,
        orientation=orientation,
        momentum=momentum,
        angular_momentum=spin,
        force=force,
        edge=edges,
        strain=strain,
        memory=Memory(small, deformation),
        steps=state.steps + edge.shape[1],
        diverged=diverged,
        clearance=clearance,
    )
