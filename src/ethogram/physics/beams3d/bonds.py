"""Forces of the beams, from the deformation of each bond.

Each bond is seen in a frame of its own: the grid axis along which it was made becomes x, and the
frame turns with its first voxel (small angles) or so that x points at the second voxel (large).
In that frame d is the displacement of the second voxel from where it would rest, th1 and th2 are
the rotations of the two ends, in radians; beam theory makes them forces and moments.

Reading: in the step in which a bond's angles become small, or large, it is not damped and forgets
nothing; one of which they do so in the very first step is damped next against no deformation.
"""

import math

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int, Shaped

from ethogram.physics.beams3d.lattice import Lattice
from ethogram.physics.beams3d.material import Beam, Material
from ethogram.physics.beams3d.rotations import (
    SMALL_ANGLE,
    Quaternion,
    Vector,
    inverse,
    norm,
    product,
    rotate,
    rotation_vector,
    to_x_axis,
)

# A bond's angles are small again below the first bound of each, and large above the second.
COSINE = (math.cos(SMALL_ANGLE / 2), math.cos(1.1 * SMALL_ANGLE / 2))  # of half the angle
TURN = (0.05, 0.055)  # sideways displacement per length
EXTENSION = (1.30, 1.43)  # length per length at rest


class Memory(eqx.Module):
    """State of the bonds: what damping needs of the step before."""

    small: Bool[Array, "bond *batch"]  # whether its angles were small
    deformation: Float[Array, "9 bond *batch"]  # d (m), th1, th2 (rad); what damping goes by


class Pull(eqx.Module):
    """Forces and torques of the bonds on the voxels, and their strains."""

    force: Float[Array, "3 voxel *batch"]  # N
    torque: Float[Array, "3 voxel *batch"]  # N m
    strain: Float[Array, "bond *batch"]  # a_x / D - 1


def bond_forces(
    lattice: Lattice,
    material: Material,
    pose: tuple[Float[Array, "3 voxel *batch"], Float[Array, "4 voxel *batch"]],
    edge: Float[Array, "voxel *batch"],
    memory: Memory,
    first_step: Bool[Array, "..."],
) -> tuple[Pull, Memory]:
    """Forces and torques of each voxel's bonds, summed.

    Args:
        lattice: the body.
        material: of its voxels.
        pose: positions (m) and orientations.
        edge: as commanded now (m); a bond's length at rest is the mean of its voxels' edges.
        memory: what `bond_forces` returned in the step before.
        first_step: whether there was none: then nothing is damped.

    """
    voxels = jnp.concatenate([*pose, edge[None]])
    one, two = lattice.first.of(voxels), lattice.second.of(voxels)
    axis = over_batch(lattice.axis, edge)
    offset = along_x(axis, Vector(*(two[:3] - one[:3])))
    q1 = Quaternion(one[3], *along_x(axis, Vector(*one[4:7])))
    q2 = Quaternion(two[3], *along_x(axis, Vector(*two[4:7])))
    rest = (one[7] + two[7]) / 2
    seen = rotate(inverse(q1), offset)
    small = small_angles(memory.small, product(inverse(q1), q2), seen, rest)
    frame, deformation = deform(small, offset, seen, q1, q2, rest)
    flipped = small != memory.small
    rate = (deformation - memory.deformation) / material.time_step
    rate = jnp.where(flipped | first_step, 0.0, rate)
    pull = _elastic(material.beam, deformation) + _damping(material.bond_dashpot, rate)
    force, moment1, moment2 = (
        jnp.stack(from_x(axis, rotate(inverse(frame), Vector(*part))))
        for part in (pull[:3], pull[3:6], pull[6:])
    )
    return (
        Pull(
            force=lattice.first.total(force) - lattice.second.total(force),
            torque=-lattice.first.total(moment1) - lattice.second.total(moment2),
            strain=seen.x / rest - 1,
        ),
        Memory(small, jnp.where(flipped, memory.deformation, deformation)),
    )


def small_angles(
    before: Bool[Array, "bond *batch"],
    bend: Quaternion,
    seen: Vector,
    rest: Float[Array, "bond *batch"],
) -> Bool[Array, "bond *batch"]:
    """Whether a bond's angles are small, with a band in which they stay what they were.

    Args:
        before: whether they were small in the step before.
        bend: the second end's orientation as the first one sees it.
        seen: the second end's place as the first one sees it (m).
        rest: length at rest (m).

    """
    turn = (jnp.abs(seen.y) + jnp.abs(seen.z)) / seen.x
    extension = seen.x / rest
    becomes = (bend.w > COSINE[0]) & (turn < TURN[0]) & (extension < EXTENSION[0])
    ceases = (bend.w <= COSINE[1]) | (turn > TURN[1]) | (extension > EXTENSION[1])
    return jnp.where(before, ~ceases, becomes)


def deform(
    small: Bool[Array, "bond *batch"],
    offset: Vector,
    seen: Vector,
    q1: Quaternion,
    q2: Quaternion,
    rest: Float[Array, "bond *batch"],
) -> tuple[Quaternion, Float[Array, "9 bond *batch"]]:
    """The rotation into each bond's frame, and d, th1, th2 in it.

    Small angles: the frame is that of the first voxel, d has three components and th1 is zero.
    Large angles: x points at the second voxel, d is a stretch alone.
    """
    aligned = to_x_axis(seen)
    turned = Quaternion(
        jnp.where(small, 1.0, aligned.w), *(jnp.where(small, 0.0, part) for part in aligned[1:])
    )
    frame = product(turned, inverse(q1))
    length = jnp.where(small, seen.x, norm(offset))
    return frame, jnp.stack(
        [
            length - rest,
            jnp.where(small, seen.y, 0.0),
            jnp.where(small, seen.z, 0.0),
            *rotation_vector(turned),
            *rotation_vector(product(frame, q2)),
        ]
    )


def _elastic(
    beam: Beam, deformation: Float[Array, "9 bond *batch"]
) -> Float[Array, "9 bond *batch"]:
    """Force on the first voxel, and the two moments, of a linear beam."""
    dx, dy, dz, x1, y1, z1, x2, y2, z2 = deformation
    a1, a2, b1, b2, b3 = beam
    return jnp.stack(
        [
            a1 * dx,
            b1 * dy - b2 * (z1 + z2),
            b1 * dz + b2 * (y1 + y2),
            a2 * (x1 - x2),
            b2 * dz + b3 * (2 * y1 + y2),
            -b2 * dy + b3 * (2 * z1 + z2),
            a2 * (x2 - x1),
            b2 * dz + b3 * (y1 + 2 * y2),
            -b2 * dy + b3 * (z1 + 2 * z2),
        ]
    )


def _damping(dashpot: Beam, rate: Float[Array, "9 bond *batch"]) -> Float[Array, "9 bond *batch"]:
    """The same beam on rates of deformation; moments are damped half as much as forces."""
    force, moments = jnp.split(_elastic(dashpot, rate), [3])
    return jnp.concatenate([force, moments / 2])


def along_x(axis: Int[Array, "..."], v: Vector) -> Vector:
    """A vector with the bond's grid axis turned into x: (y, -x, z) along y, (z, y, -x) along z."""
    return Vector(
        jnp.where(axis == 0, v.x, jnp.where(axis == 1, v.y, v.z)),
        jnp.where(axis == 1, -v.x, v.y),
        jnp.where(axis == 2, -v.x, v.z),
    )


def from_x(axis: Int[Array, "..."], v: Vector) -> Vector:
    """A vector with x turned back into the bond's grid axis."""
    return Vector(
        jnp.where(axis == 0, v.x, jnp.where(axis == 1, -v.y, -v.z)),
        jnp.where(axis == 1, v.x, v.y),
        jnp.where(axis == 2, v.x, v.z),
    )


def over_batch(values: Shaped[Array, "item"], like: Shaped[Array, "other *batch"]) -> Array:
    """One value for each item, in a shape that goes with all robots of a batch."""
    return values.reshape(values.shape + (1,) * (like.ndim - 1))
