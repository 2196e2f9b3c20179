"""Velocities after a step: rigid bodies one colour after the other, each by its own block.

Block Gauss-Seidel over the rigid bodies: with the others as they are, a rigid body's velocity
solves a system of three equations, exactly.  Contacts, and then ropes, are impulses that push and
never pull; they are found one after the other (projected Gauss-Seidel), and meet the mass of the
rigid body with its springs.
"""

from functools import partial
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float

from ethogram.physics.lattice2d import contacts as terrain
from ethogram.physics.lattice2d import ropes as rope
from ethogram.physics.lattice2d.contacts import Contacts, Motion, inertia, times
from ethogram.physics.lattice2d.lattice import COLOURS, Lattice
from ethogram.physics.lattice2d.material import Material
from ethogram.physics.lattice2d.ropes import Ropes
from ethogram.physics.lattice2d.springs import Blocks, impulse_on, on_squares
from ethogram.physics.lattice2d.squares import of_bodies, of_colour, total


class Constraints(NamedTuple):
    """All that holds rigid bodies together and apart in a step."""

    springs: Blocks
    ropes: Ropes
    contacts: Contacts | None
    any_rope: Bool[Array, ""]  # whether one is taut, in any copy


class Impulses(NamedTuple):
    """Impulses that push and never pull (N s)."""

    rope: Float[Array, "side voxel *batch"]
    contact: Float[Array, "point 2 colour body *batch"]  # along normals, along tangents


class System(NamedTuple):
    """The equations of each rigid body, the others' velocities given."""

    inverse: Float[Array, "6 colour body *batch"]  # of its mass and springs: xx, xy, yy, xw, yw, ww
    momentum: Float[Array, "3 colour body *batch"]  # before the step, and what springs begin with


def system(
    lattice: Lattice,
    material: Material,
    springs: Blocks,
    free: Float[Array, "3 colour body *batch"],
) -> System:
    """Equations of rigid bodies.

    Args:
        lattice: the body.
        material: of its voxels.
        springs: of its voxels.
        free: velocities without springs, contacts and ropes.

    """
    mass, moment = inertia(lattice, material, free.ndim - 3)
    nothing = jnp.zeros_like(mass)
    own = jnp.stack([mass, nothing, mass, nothing, nothing, moment])
    held = of_bodies(lattice, on_squares(springs))
    momentum = jnp.stack([mass * free[0], mass * free[1], moment * free[2]])
    return System(_inverse(own + held[:6]), momentum + held[6:])


def _inverse(matrix: Float[Array, "6 *at"]) -> Float[Array, "6 *at"]:
    """The inverse of a symmetric 3 x 3 matrix (xx, xy, yy, xw, yw, ww), by cofactors."""
    xx, xy, yy, xw, yw, ww = matrix
    cofactors = jnp.stack(
        [
            yy * ww - yw * yw,
            xw * yw - xy * ww,
            xx * ww - xw * xw,
            xy * yw - yy * xw,
            xy * xw - xx * yw,
            xx * yy - xy * xy,
        ]
    )
    return cofactors / (xx * cofactors[0] + xy * cofactors[1] + xw * cofactors[3])


def solve(
    lattice: Lattice,
    material: Material,
    constraints: Constraints,
    free: Float[Array, "3 colour body *batch"],
    guess: Float[Array, "3 colour body *batch"],
    impulses: Impulses,
) -> tuple[Float[Array, "3 colour body *batch"], Impulses]:
    """Velocities and impulses after as many sweeps as the material says.

    Args:
        lattice: the body.
        material: of its voxels.
        constraints: of this step.
        free: velocities without constraints.
        guess: velocities to begin with.
        impulses: those of the last step, to begin with.

    """
    equations = system(lattice, material, constraints.springs, free)
    contacts = constraints.contacts
    rows = None if contacts is None else terrain.rows(contacts, equations.inverse)

    carried = rope.impulse_of(lattice, constraints.ropes, impulses.rope)
    if rows is not None:
        carried += terrain.impulse_of(rows, impulses.contact)

    def sweep(_: Array, at: tuple[Motion, Impulses]) -> tuple[Motion, Impulses]:
        (velocity, pushed), (tension, contact) = at
        momentum = equations.momentum + pushed
        velocity = _by_colour(lattice, constraints.springs, equations.inverse, momentum, velocity)
        motion = Motion(velocity, pushed)
        if contacts is not None and rows is not None:
            motion, contact = terrain.resolve(contacts, rows, material.friction, motion, contact)
        motion, tension = lax.cond(
            constraints.any_rope,
            partial(rope.tightened, lattice, constraints.ropes, equations.inverse),
            lambda *same: same,
            motion,
            tension,
        )
        return motion, Impulses(tension, contact)

    motion, impulses = lax.fori_loop(0, material.sweeps, sweep, (Motion(guess, carried), impulses))
    return motion.velocity, impulses


def _by_colour(
    lattice: Lattice,
    springs: Blocks,
    inverse: Float[Array, "6 colour body *batch"],
    momentum: Float[Array, "3 colour body *batch"],
    velocity: Float[Array, "3 colour body *batch"],
) -> Float[Array, "3 colour body *batch"]:
    """Velocities of all rigid bodies, solved for one colour after the other.

    Args:
        lattice: the body.
        springs: of its voxels.
        inverse: of the mass of rigid bodies, springs included.
        momentum: before the step, with all impulses but those of springs between moving squares.
        velocity: so far.

    """
    moving = [velocity[:, colour] for colour in range(COLOURS)]
    of_voxels = [of_colour(lattice, colour, moving[colour]) for colour in range(COLOURS)]
    for colour in range(COLOURS):
        push = total(lattice, colour, impulse_on(colour, springs, of_voxels))
        moving[colour] = times(inverse[:, colour], momentum[:, colour] + push)
        of_voxels[colour] = of_colour(lattice, colour, moving[colour])
    return jnp.stack(moving, 1)
