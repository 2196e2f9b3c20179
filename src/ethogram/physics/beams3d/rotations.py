"""Vectors and quaternions, component by component: arrays of any one shape.

Rotations are quaternions w + xi + yj + zk under Hamilton's product; q rotates v to q v q^-1.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

SMALL_ANGLE = 0.01732  # rad: below it, rotations to the x axis are taken to first order
SMALL_W = 0.9988  # below it, an angle is taken from its cosine
NEARLY_BACKWARDS = 5e-15  # 1 + cos(pi - 1e-7)


class Vector(NamedTuple):
    """A vector, as three arrays."""

    x: Array
    y: Array
    z: Array


class Quaternion(NamedTuple):
    """A rotation, as four arrays."""

    w: Array
    x: Array
    y: Array
    z: Array


def norm(v: Vector) -> Array:
    """Length of a vector."""
    return jnp.sqrt(v.x * v.x + v.y * v.y + v.z * v.z)


def inverse(q: Quaternion) -> Quaternion:
    """The conjugate, which of a unit quaternion is the inverse."""
    return Quaternion(q.w, -q.x, -q.y, -q.z)


def product(p: Quaternion, q: Quaternion) -> Quaternion:
    """Hamilton's product: first q, then p."""
    return Quaternion(
        p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z,
        p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y,
        p.w * q.y - p.x * q.z + p.y * q.w + p.z * q.x,
        p.w * q.z + p.x * q.y - p.y * q.x + p.z * q.w,
    )


def rotate(q: Quaternion, v: Vector) -> Vector:
    """Turn v: q v q^-1, as v + w t + u x t with u the vector part of q and t = 2 u x v."""
    tx = 2 * (q.y * v.z - q.z * v.y)
    ty = 2 * (q.z * v.x - q.x * v.z)
    tz = 2 * (q.x * v.y - q.y * v.x)
    return Vector(
        v.x + q.w * tx + (q.y * tz - q.z * ty),
        v.y + q.w * ty + (q.z * tx - q.x * tz),
        v.z + q.w * tz + (q.x * ty - q.y * tx),
    )


def rotation_vector(q: Quaternion) -> Vector:
    """Axis times angle.

    With s = 1 - w^2 the original takes 2 sqrt((2 - 2w) / s) times the vector part where s is small,
    2 acos(w) / sqrt(s) elsewhere, and zero where s is none.  (2 - 2w) / s is 2 / (1 + w): written
    so, nothing cancels, and angles that 32 bits would lose are kept.  Near w = -1, a full turn,
    this is as wrong as the original.
    """
    small, full = q.w > SMALL_W, q.w < -SMALL_W
    near = jnp.where(small, q.w, 1.0)
    far = jnp.where(small | full, 0.0, q.w)
    factor = jnp.where(
        small, 2 * jnp.sqrt(2 / (1 + near)), 2 * jnp.arccos(far) / jnp.sqrt(1 - far * far)
    )
    left = jnp.where(full & (q.w > -1), 1 + q.w, jnp.inf)  # to a full turn
    factor = jnp.where(full, 2 * jnp.sqrt(2 / left), factor)
    return Vector(factor * q.x, factor * q.y, factor * q.z)


def to_x_axis(v: Vector) -> Quaternion:
    """The rotation that takes v to the direction of +x; to first order where it is small.

    Otherwise, with n = v / |v| and t its angle to +x, it is (cos(t/2), 0, k n_z, -k n_y) with
    k = sin(t/2) / sin(t), which is 1 / sqrt(2 (1 + n_x)): no angle need be computed.  A vector
    along -x is turned about y.
    """
    small = (jnp.abs(v.y) < SMALL_ANGLE * jnp.abs(v.x)) & (
        jnp.abs(v.z) < SMALL_ANGLE * jnp.abs(v.x)
    )
    per_x = 1 / jnp.where(small, v.x, 1.0)
    first_y, first_z = 0.5 * v.z * per_x, -0.5 * v.y * per_x
    per_length = 1 / norm(v)
    raised = 1 + v.x * per_length  # 1 + cos(t)
    backwards = raised < NEARLY_BACKWARDS
    raised = jnp.where(backwards, 1.0, raised)
    k = per_length / jnp.sqrt(2 * raised)

    def choose(first: Array, exact: Array, turned: float) -> Array:
        return jnp.where(small, first, jnp.where(backwards, turned, exact))

    return Quaternion(
        choose(1 - (first_y * first_y + first_z * first_z) / 2, jnp.sqrt(raised / 2), 0.0),
        jnp.zeros_like(v.x),
        choose(first_y, v.z * k, 1.0),
        choose(first_z, -v.y * k, 0.0),
    )


def normalised(q: Quaternion) -> Quaternion:
    """The unit quaternion of the same rotation."""
    per_length = 1 / jnp.sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z)
    return Quaternion(*(component * per_length for component in q))
