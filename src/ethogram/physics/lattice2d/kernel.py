"""The kernel written by hand: the steps of `motion.step`, compiled from `kernels/lattice2d.cpp`.

`jax.vmap` over robots makes more leading axes of robots, or more trailing ones where there are some
already; over bodies, materials, terrains or gravity, one leading axis of bodies, each with its
robots.  The kernel takes all of these as they are.

In 64 bits it agrees with the steps in JAX but for rounding.  Rigid bodies and voxels that are
padding stay as they are.  Where a processor has fused multiply-add, its bits depend on nothing but
a robot's own state and commands: not on the instruction set, nor on the other robots, nor on how
many steps one call takes.
"""

from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Int

from ethogram.core.batching import with_vmap_rule
from ethogram.physics import native
from ethogram.physics.kernel_calls import more_bodies, with_bodies
from ethogram.physics.lattice2d.contacts import Terrain
from ethogram.physics.lattice2d.lattice import Lattice
from ethogram.physics.lattice2d.material import Material
from ethogram.physics.lattice2d.motion import State

SYMBOLS = {"float32": "ethogram_lattice2d_f32", "float64": "ethogram_lattice2d_f64"}
AVALANCHES = {
    "float32": "ethogram_lattice2d_avalanches_f32",
    "float64": "ethogram_lattice2d_avalanches_f64",
}
NO_POINTS = np.zeros((0, 2))


def target(dtype: Any, choice: str, symbols: dict[str, str] = SYMBOLS) -> str | None:
    """The name of a function of the kernel for a type of numbers; None where there is none.

    Args:
        dtype: of the state's numbers.
        choice: "auto", "none", or a variant's name.
        symbols: of the function, by type: `SYMBOLS` or `AVALANCHES`.

    """
    symbol = symbols.get(jnp.dtype(dtype).name)
    return None if symbol is None else native.target(symbol, choice)


def constants(material: Material, dtype: Any) -> Float[Array, "11"]:
    """What the kernel needs of a material, in its order."""
    contracted, resting, expanded = material.edges
    numbers = [
        material.time_step,
        1 - material.time_step * material.drag,
        material.square,
        material.square_mass,
        contracted,
        resting,
        expanded,
        material.spring_inertia,
        material.spring_pull,
        material.friction,
        material.restitution,
    ]
    return jnp.stack([jnp.asarray(number, dtype) for number in numbers])


@cache
def simulation(name: str, steps_in_jax: Any) -> Any:
    """The simulation by the kernel of a name, which is differentiated as another one in JAX.

    Both take a lattice, a material, gravity, a terrain, a state and a control.
    """
    return _simulation(name, False, False, steps_in_jax)


@cache
def _simulation(name: str, bodies: bool, robots_first: bool, steps_in_jax: Any) -> Any:
    """The simulation of arrays of a layout; see `call`."""

    def steps(*arguments: Any) -> State:
        return call(name, *arguments, bodies=bodies, robots_first=robots_first)

    def batched(size: int, is_batched: list[Any], *arguments: Any) -> tuple[Any, Any]:
        if any(jax.tree.leaves(is_batched[:-2])):
            each = _simulation(name, True, robots_first, steps_in_jax)
            return more_bodies(each, size, is_batched, arguments, bodies=bodies)
        *surroundings, state, control = arguments
        are_last = not robots_first and control.ndim > bodies + 2 + is_batched[-1]
        to = -1 if are_last else int(bodies)

        def part(leaf: Array, there: bool) -> Array:
            leaf = leaf if there else jnp.broadcast_to(leaf, (size, *leaf.shape))
            return jnp.moveaxis(leaf, 0, to)

        each = _simulation(name, bodies, not are_last, steps_in_jax)
        robots = jax.tree.map(part, (state, control), tuple(is_batched[-2:]))
        after = jax.tree.map(lambda leaf: jnp.moveaxis(leaf, to, 0), each(*surroundings, *robots))
        return after, jax.tree.map(lambda _: True, after)

    return with_vmap_rule(steps, batched, differentiated=steps_in_jax)


def call(
    name: str,
    lattice: Lattice,
    material: Material,
    gravity: Array,
    terrain: Terrain | None,
    state: State,
    control: Array,
    *,
    bodies: bool = False,
    robots_first: bool = False,
) -> State:
    """The state after all steps, by the kernel of a name.

    Args:
        name: what `target` returned.
        lattice: as of `simulate`.
        material: as of `simulate`.
        gravity: as of `simulate`.
        terrain: as of `simulate`.
        state: as of `simulate`.
        control: as of `simulate`.
        bodies: whether all arrays have bodies, each with a material, gravity and a terrain of its
            own, as first axis.
        robots_first: whether all axes of robots come after that, and not last.

    """
    dtype = control.dtype
    before, structure = jax.tree.flatten(state)  # fields are in the kernel's order
    none = jnp.zeros((*gravity.shape, *NO_POINTS.shape), dtype)
    ceiling = None if terrain is None else terrain.ceiling
    after = jax.ffi.ffi_call(
        name,
        before,  # of whose shapes and types the results are
        input_output_aliases={place: place for place in range(len(before))},
    )(
        *before,
        control,
        gravity,
        none if terrain is None else terrain.ground.astype(dtype),
        none if ceiling is None else ceiling.astype(dtype),
        with_bodies(partial(constants, dtype=dtype), bodies)(material),
        *_arrays(lattice, dtype),
        **_settings(material),
        bodies=bodies,
        robots_first=robots_first,
    )
    found: State = jax.tree.unflatten(structure, after)
    return found


def _arrays(lattice: Lattice, dtype: Any) -> list[Array]:
    """What the kernel needs of a lattice, in its order."""
    return [
        lattice.cell,
        lattice.used,
        lattice.body,
        lattice.voxel,
        lattice.vertex.astype(dtype),
        lattice.centre.astype(dtype),
        lattice.squares.astype(dtype),
        lattice.inertia.astype(dtype),
    ]


def _settings(material: Material) -> dict[str, Any]:
    """What is not a number of a material."""
    return {"outline": material.springs == "outline", "sweeps": np.int64(material.sweeps)}


@cache
def avalanches(name: str, longest: int, bodies: bool = False) -> Any:
    """Sizes and durations of avalanches by the kernel of a name.

    It takes a lattice, a material and a threshold, the type of which is that of all numbers.

    Args:
        name: what `target` returned.
        longest: steps of a run, at most.
        bodies: whether all arrays have bodies as first axis.

    """

    def found(
        lattice: Lattice, material: Material, threshold: Array
    ) -> tuple[Int[Array, "*bodies voxel"], Int[Array, "*bodies voxel"]]:
        dtype = threshold.dtype
        per_voxel = jax.eval_shape(lambda: jnp.zeros(lattice.used.shape, jnp.int32))
        sizes, durations = jax.ffi.ffi_call(name, [per_voxel, per_voxel])(
            threshold,
            with_bodies(partial(constants, dtype=dtype), bodies)(material),
            *_arrays(lattice, dtype),
            **_settings(material),
            most_steps=np.int64(longest),
            bodies=bodies,
            robots_first=False,
        )
        return sizes, durations

    def batched(size: int, is_batched: list[Any], *arguments: Any) -> tuple[Any, Any]:
        each = avalanches(name, longest, True)
        return more_bodies(each, size, is_batched, arguments, bodies=bodies)

    return with_vmap_rule(found, batched)
