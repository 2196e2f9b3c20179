"""Avalanches: how far a pulse in one voxel spreads (thesis, section 6.4.1).

For each voxel in turn, a fresh body of the soft material, free of gravity, in which that voxel
alone is driven: contracted for 12 steps, expanded for 12, then left alone.  A voxel is active while
its area ratio changes by more than a threshold tau from the end of one step to that of the next.
The run ends at the first step without an active voxel.  The size of the avalanche is the number of
voxels that were ever active, its duration the number of steps in which some voxel was.
"""

from functools import partial
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float, Int

from ethogram.core.settings import Number
from ethogram.physics.kernel_calls import on_cpus
from ethogram.physics.lattice2d import kernel as native_kernel
from ethogram.physics.lattice2d.lattice import Lattice
from ethogram.physics.lattice2d.material import Material
from ethogram.physics.lattice2d.motion import State, at_rest, step
from ethogram.physics.lattice2d.squares import area_ratio, over_batch, squares

PULSE = 12  # steps of contraction, and then of expansion
LONGEST = 1800  # steps: 30 s
NEVER_ACTIVE = 2  # steps of a run: the first, and that with which it ends


class Avalanches(NamedTuple):
    """Avalanches of a body, one for each voxel that is driven; those of padding are empty."""

    size: Int[Array, "drive"]  # voxels
    duration: Int[Array, "drive"]  # steps


class Run(NamedTuple):
    """Runs under way, one for each voxel that is driven."""

    state: State  # of the bodies, drives last
    area: Float[Array, "voxel drive"]  # ratio to that at rest, after the last step
    ever: Bool[Array, "voxel drive"]  # whether it has been active
    step: Int[Array, ""]  # steps taken
    duration: Int[Array, "drive"]
    running: Bool[Array, "drive"]


def avalanches(
    lattice: Lattice,
    material: Material,
    threshold: Number,
    *,
    longest: int = LONGEST,
    kernel: str = "auto",
) -> Avalanches:
    """Sizes and durations of the avalanches that each voxel of a body starts.

    Args:
        lattice: the body.
        material: of its voxels; the thesis' is `Material.soft()`.
        threshold: tau, the change of the area ratio in a step of which an active voxel has more.
        longest: steps after which a run is ended that has not stopped.
        kernel: what does it on a CPU, as of `simulate.simulate`.  On a kernel, `jax.vmap` takes
            one after the other.

    Raises:
        EthogramError: there is no such kernel.

    """
    arguments = lattice, material, jnp.asarray(threshold, float)
    name = native_kernel.target(arguments[-1].dtype, kernel, native_kernel.AVALANCHES)
    in_jax = partial(_in_jax, longest=longest)
    if name is None:
        return Avalanches(*in_jax(*arguments))
    return Avalanches(*on_cpus(native_kernel.avalanches(name, longest), in_jax, *arguments))


def _in_jax(
    lattice: Lattice, material: Material, threshold: Array, *, longest: int
) -> tuple[Int[Array, "drive"], Int[Array, "drive"]]:
    """Sizes and durations by the steps in JAX."""
    begun = start(lattice)

    def on(run: Run) -> Bool[Array, ""]:
        return run.running.any() & (run.step < longest)

    run = lax.while_loop(on, lambda run: advanced(lattice, material, threshold, run)[0], begun)
    unfinished = run.step - NEVER_ACTIVE
    duration = jnp.where(run.running, unfinished + 1, run.duration)
    return run.ever.sum(0, dtype=jnp.int32), jnp.where(lattice.used, duration, 0)


def start(lattice: Lattice) -> Run:
    """Runs before the first step, one for each voxel."""
    voxels = lattice.voxels
    state = at_rest(lattice, (voxels,), terrain=False)
    return Run(
        state=state,
        area=jnp.ones_like(state.rope[0]),
        ever=jnp.zeros((voxels, voxels), bool),
        step=jnp.int32(0),
        duration=jnp.zeros(voxels, jnp.int32),
        running=lattice.used,
    )


def advanced(
    lattice: Lattice, material: Material, threshold: Number, run: Run
) -> tuple[Run, Bool[Array, "voxel drive"]]:
    """Runs after a step more, and which voxels are active now."""
    level = pulse(run.step)
    driven = level * jnp.eye(lattice.voxels, dtype=run.area.dtype)
    nothing = jnp.zeros((), run.area.dtype)
    state = step(lattice, material, run.state, driven, gravity=nothing)
    area = area_ratio(material, squares(lattice, material, state.moved, state.heading))
    taken = run.step + 1
    is_active = (jnp.abs(area - run.area) > threshold) & run.running
    is_active &= over_batch(lattice.used, 1) & (taken > 1)
    stops = run.running & ~is_active.any(0) & (taken > 1)
    after = Run(
        state=state,
        area=area,
        ever=run.ever | is_active,
        step=taken,
        duration=jnp.where(stops, taken - NEVER_ACTIVE, run.duration),
        running=run.running & ~stops,
    )
    return after, is_active


def pulse(step: Int[Array, ""]) -> Float[Array, ""]:
    """Control of the driven voxel in a step, counted from 0."""
    return jnp.where(step < 1, 0.0, jnp.where(step <= PULSE, 1.0, -1.0)) * (step <= 2 * PULSE)
