"""The kernel written by hand: the steps of `motion.step`, compiled from `kernels/beams3d.cpp`.

`jax.vmap` over robots makes more leading axes of robots, or more trailing ones where there are some
already; over bodies or materials, one leading axis of bodies, each with its robots.  The kernel
takes all of these as they are.

In 64 bits it agrees with the steps in JAX but for rounding; in 32 bits it takes large angles from a
polynomial that is 9e-8 of them off.  Where a processor has fused multiply-add, its bits depend on
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
from ethogram.physics.beams3d.motion import State
from ethogram.physics.kernel_calls import more_bodies, with_bodies

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
def simulation(name: str, floor: bool, steps_in_jax: Any) -> Any:
    """The simulation by the kernel of a name, which is differentiated as another one in JAX.

    Both take a lattice, a material, a state, edges and gravity as `simulate` does.
    """
    return _simulation(name, floor, False, False, steps_in_jax)


@cache
def _simulation(name: str, floor: bool, bodies: bool, robots_first: bool, steps_in_jax: Any) -> Any:
    """The simulation of arrays of a layout; see `call`."""

    def steps(*arguments: Any) -> State:
        return call(name, *arguments, floor=floor, bodies=bodies, robots_first=robots_first)

    def batched(size: int, is_batched: list[Any], *arguments: Any) -> tuple[Any, Any]:
        if any(jax.tree.leaves(is_batched[:2])):
            each = _simulation(name, floor, True, robots_first, steps_in_jax)
            return more_bodies(each, size, is_batched, arguments, bodies=bodies)
        edge = arguments[3]
        if not robots_first and edge.ndim > bodies + 2 + is_batched[3]:
            return more_lanes(simulated, size, is_batched, arguments, bodies=int(bodies))
        return more_robots_first(size, is_batched, arguments)

    def more_robots_first(size: int, is_batched: list[Any], arguments: Any) -> tuple[Any, Any]:
        lattice, material, state, edge, gravity = arguments
        batch = edge.shape[is_batched[3] + bodies : edge.ndim - 2]  # of robots that come first

        def part(leaf: Array, leaf_is_batched: bool, own: int | None = None) -> Array:
            """The array with the batch as first axis after that of bodies."""
            if own is not None and leaf.ndim == bodies + own + leaf_is_batched:  # shared so far
                if not leaf_is_batched:
                    return leaf
                at = leaf.ndim - own
                leaf = jnp.expand_dims(leaf, tuple(range(at, at + len(batch))))
                shape = leaf.shape[:at] + batch + leaf.shape[at + len(batch) :]
                leaf = jnp.broadcast_to(leaf, shape)
            if not leaf_is_batched:
                leaf = jnp.broadcast_to(leaf, (size, *leaf.shape))
            return jnp.moveaxis(leaf, 0, int(bodies))

        each = _simulation(name, floor, bodies, True, steps_in_jax)
        after = each(
            lattice,
            material,
            jax.tree.map(
                lambda leaf, is_in: part(leaf, is_in, 0 if leaf is state.steps else None),
                state,
                is_batched[2],
            ),
            part(edge, is_batched[3]),
            part(gravity, is_batched[4], 2),
        )
        is_in = jax.tree.map(lambda leaf: leaf is not after.steps or leaf.ndim > bodies, after)
        return jax.tree.map(
            lambda leaf, there: jnp.moveaxis(leaf, int(bodies), 0) if there else leaf, after, is_in
        ), is_in

    simulated = with_vmap_rule(steps, batched, differentiated=steps_in_jax)
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
    robots_first: bool = False,
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
        bodies: whether all arrays have bodies, each with a material of its own, as first axis.
        robots_first: whether all axes of robots come after that, and not last.

    """
    before, structure = jax.tree.flatten(state)  # fields are in the kernel's order
    numbers = partial(constants, dtype=edge.dtype)
    after = jax.ffi.ffi_call(
        name,
        before,  # of whose shapes and types the results are
        input_output_aliases={place: place for place in range(len(before))},
    )(
        *before,
        edge,
        gravity,
        with_bodies(numbers, bodies)(material),
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
        robots_first=robots_first,
    )
    found: State = jax.tree.unflatten(structure, after)
    return found
