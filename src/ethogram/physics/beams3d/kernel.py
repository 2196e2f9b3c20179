"""The kernel written by hand: the steps of `motion.step`, compiled from `kernels/beams3d.cpp`.

It takes bodies as the leading axis of every array, each with a material of its own, and robots of a
body as trailing ones.  `jax.vmap` makes more of either.  It has no derivatives.

In 64 bits it agrees with the steps in JAX but for rounding, in 32 bits it takes large angles from a
polynomial that is 9e-8 of them off.  Where a processor has fused multiply-add its bits depend on
nothing but a robot's own state and commands: not on the instruction set, nor on the other robots,
nor on how many steps one call takes.
"""

from functools import cache, partial
from typing import Any, Literal

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from ethogram.core.batching import with_vmap_rule
from ethogram.physics import native
from ethogram.physics.beams3d.lanes import more_lanes
from ethogram.physics.beams3d.lattice import Lattice
from ethogram.physics.beams3d.material import Material
from ethogram.physics.beams3d.motion import State

Kernel = Literal["auto", "none", "x86-64-v4", "x86-64-v3", "x86-64", "portable"]
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

    It takes lattices, materials, states, edges and gravity as `simulate` does, all with bodies as
    first axis.
    """

    def steps(*arguments: Any) -> State:
        return call(name, *arguments, floor=floor, bodies=True)

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


def call(
    name: str,
    lattice: Lattice,
    material: Material,
    state: State,
    edge: Array,
    gravity: Array,
    *,
    floor: bool,
    bodies: bool = False,
) -> State:
    """The state after all steps, by the kernel of a name.

    Args:
        name: what `target` returned.
        lattice: as of `simulate`.
        material: as of `simulate`.
        state: as of `simulate`.
        edge: as of `simulate`.
        gravity: as of `simulate`.
        floor: as of `simulate`.
        bodies: whether all arrays have bodies as first axis.

    """
    before, structure = jax.tree.flatten(state)  # fields are in the kernel's order
    numbers = partial(constants, dtype=edge.dtype)
    after = jax.ffi.ffi_call(
        name,
        [jax.ShapeDtypeStruct(array.shape, array.dtype) for array in before],
        input_output_aliases={place: place for place in range(len(before))},
    )(
        *before,
        edge,
        gravity,
        (jax.vmap(numbers) if bodies else numbers)(material),
        lattice.first.voxel,
        lattice.second.voxel,
        lattice.axis,
        lattice.left.voxel,
        lattice.right.voxel,
        lattice.first.items,
        lattice.left.items,
        floor=floor,
        padded=lattice.is_padded,
        bodies=bodies,
    )
    found: State = jax.tree.unflatten(structure, after)
    return found
