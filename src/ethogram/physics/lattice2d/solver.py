"""Velocities after a step: rigid bodies one colour after the other, each by its own block.

Block Gauss-Seidel over the rigid bodies: with the others as they are, a rigid body's velocity
solves a system of three equations, exactly.  Contacts and ropes are impulses that push and never
pull; they are found one after the other (projected Gauss-Seidel), and meet the mass of the rigid
body with its springs.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float

from ethogram.physics.lattice2d import contacts as terrain
from ethogram.physics.lattice2d import ropes as rope
from ethogram.physics.lattice2d.contacts import Contacts, inertia, times
from ethogram.physics.lattice2d.lattice import COLOURS, Lattice
from ethogram.physics.lattice2d.material import Material
from ethogram.physics.lattice2d.ropes import Ropes
from ethogram.physics.lattice2d.springs import Blocks, impulse_on
from ethogram.physics.lattice2d.squares import of_colour, total


class Constraints(NamedTuple):
    """All that holds rigid bodies together and apart in a step."""

    springs: Blocks
    ropes: Ropes
    contacts: Contacts | None
    any_rope: Bool[Array, ""]  # whether one is taut, in any copy


class Impulses(NamedTuple):
    """Impulses that push and never pull (N s)."""

    rope: Float[Array, "side voxel *batch"]
    contact: Float[Array, "2 corner colour body *batch"]  # along normals, along tangents


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
    held = _of_all(lattice, springs.diagonal)
    momentum = jnp.stack([mass * free[0], mass * free[1], moment * free[2]])
    return System(_inverse(own + held), momentum + _of_all(lattice, springs.impulse))


def _of_all(lattice: Lattice, values: Float[Array, "c colour voxel *batch"]) -> Array:
    """Sums over the squares of each rigid body."""
    return jnp.stack([total(lattice, c, values[:, c]) for c in range(COLOURS)], 1)


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

    def sweep(_: Array, at: tuple[Array, Impulses]) -> tuple[Array, Impulses]:
        velocity, impulses = at
        pushed = equations.momentum + rope.impulse_of(lattice, constraints.ropes, impulses.rope)
        velocity, contact = _colours(
            lattice, material, constraints, equations._replace(momentum=pushed), velocity, impulses
        )
        tight = rope.tightened(
            lattice, constraints.ropes, equations.inverse, velocity, impulses.rope
        )
        return tight[0], Impulses(tight[1], contact)

    def sweep_without_ropes(_: Array, at: tuple[Array, Impulses]) -> tuple[Array, Impulses]:
        velocity, contact = _colours(lattice, material, constraints, equations, *at)
        return velocity, at[1]._replace(contact=contact)

    return lax.cond(
        constraints.any_rope,
        lambda: lax.fori_loop(0, material.sweeps, sweep, (guess, impulses)),
        lambda: lax.fori_loop(0, material.sweeps, sweep_without_ropes, (guess, impulses)),
    )


def _colours(
    lattice: Lattice,
    material: Material,
    constraints: Constraints,
    equations: System,
    velocity: Float[Array, "3 colour body *batch"],
    impulses: Impulses,
) -> tuple[Array, Array]:
    """Velocities of all rigid bodies, one colour after the other, and impulses of contacts."""
    contact = impulses.contact
    moving = [velocity[:, colour] for colour in range(COLOURS)]
    of_voxels = [of_colour(lattice, colour, moving[colour]) for colour in range(COLOURS)]
    for colour in range(COLOURS):
        push = impulse_on(colour, constraints.springs, of_voxels)
        momentum = equations.momentum[:, colour] + total(lattice, colour, push)
        inverse = equations.inverse[:, colour]
        if constraints.contacts is None:
            moving[colour] = times(inverse, momentum)
        else:
            momentum += terrain.impulse_of(constraints.contacts, colour, contact[:, :, colour])
            moving[colour], after = terrain.resolve(
                constraints.contacts,
                colour,
                material.friction,
                inverse,
                times(inverse, momentum),
                contact[:, :, colour],
            )
            contact = contact.at[:, :, colour].set(after)
        of_voxels[colour] = of_colour(lattice, colour, moving[colour])
    return jnp.stack(moving, 1), contact
