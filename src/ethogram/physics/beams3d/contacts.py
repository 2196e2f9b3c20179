"""Contacts: with the floor at z = 0, and of a body with itself."""

import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float

from ethogram.physics.beams3d.lattice import Lattice
from ethogram.physics.beams3d.material import Material
from ethogram.physics.beams3d.rotations import Vector

TOUCH = 0.75  # times the sum of two edges: the distance at which voxels begin to repel


def self_collisions(
    lattice: Lattice,
    material: Material,
    position: Float[Array, "3 voxel *batch"],
    edge: Float[Array, "voxel *batch"],
) -> Float[Array, "3 voxel *batch"]:
    """Forces (N) between surface voxels that touch: a1 (reach - distance), along their line.

    Pairs that do not touch cost little: forces are computed where some pair of the batch does.
    """
    if len(lattice.left.voxel) == 0:
        return jnp.zeros_like(position)
    voxels = jnp.concatenate([position, edge[None]])
    left, right = lattice.left.of(voxels), lattice.right.of(voxels)
    offset, reach = right[:3] - left[:3], TOUCH * (left[3] + right[3])
    square = (offset * offset).sum(0)
    touching = square < reach * reach

    def repel() -> Float[Array, "3 voxel *batch"]:
        distance = jnp.sqrt(jnp.where(touching, square, 1.0))
        push = jnp.where(touching, material.beam.axial * (reach - distance) / distance, 0.0)
        return lattice.right.total(push * offset) - lattice.left.total(push * offset)

    return lax.cond(touching.any(), repel, lambda: jnp.zeros_like(position))


def floor(
    material: Material,
    height: Float[Array, "voxel *batch"],
    edge: Float[Array, "voxel *batch"],
    momentum: Vector,
    force: Vector,
) -> tuple[Vector, Vector]:
    """Push up what is in the floor, and hold or brake it sideways: momentum and force after that.

    A voxel at rest stays where the sideways force is below mu_s N, and is free for a step else.  A
    moving one is braked by mu_d N, and stops where that would turn it round.  Only the speed before
    the step counts, and of the force against the floor only N, the elastic part.

    Args:
        material: of voxels and floor.
        height: of the voxels' centres (m).
        edge: as commanded (m).
        momentum: before the step (kg m/s).
        force: all others (N).

    """
    depth = edge / 2 - height
    inside = depth > 0
    normal = jnp.where(inside, 2 * material.elastic_modulus * material.edge * depth, 0.0)
    brake = material.floor_damping * material.contact_dashpot * momentum.z / material.mass
    square = momentum.x * momentum.x + momentum.y * momentum.y
    resting = square == 0
    sideways = jnp.sqrt(jnp.where(resting, 1.0, square))
    friction = material.dynamic_friction * normal
    slides = friction * material.time_step < sideways
    # forces compared as squares: the root of a zero force has no gradient
    sticks = force.x * force.x + force.y * force.y < (material.static_friction * normal) ** 2
    stops = inside & ~resting & ~slides
    held = stops | (inside & resting & sticks)
    braked = jnp.where(inside & ~resting & slides, friction / sideways, 0.0)

    def free(value: Array, where: Array) -> Array:
        return jnp.where(where, 0.0, value)

    return (
        Vector(free(momentum.x, stops), free(momentum.y, stops), momentum.z),
        Vector(
            free(force.x - braked * momentum.x, held),
            free(force.y - braked * momentum.y, held),
            force.z + normal - jnp.where(inside, brake, 0.0),
        ),
    )
