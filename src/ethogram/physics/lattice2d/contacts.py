"""Contacts: corners of squares with the terrain, and squares of a voxel with each other (ropes).

Whatever is in contact has an impulse along the normal n that pushes and never pulls, and with the
terrain one along the tangent t that is at most mu times the other (Coulomb).
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Bool, Float

from ethogram.core.errors import InvalidSettings
from ethogram.physics.lattice2d.lattice import COLOURS, SIGNS, Lattice
from ethogram.physics.lattice2d.material import Material
from ethogram.physics.lattice2d.squares import over_batch, rest, rotated

CORNERS = 4 * COLOURS  # of the squares of a rigid body
SLOWEST = 1.0  # m/s: what approaches more slowly does not bounce
SLOP = 0.005  # m, that may overlap
CORRECTED = 0.2  # share of the rest of an overlap that a pass removes (Baumgarte)
FARTHEST = 0.2  # m, that a pass moves something
PASSES = 10


class Terrain(eqx.Module):
    """Ground and ceiling as polylines from left to right; their ends go on as they are.

    Attributes:
        ground: points (x, y), m, x increasing; below is solid.
        ceiling: points (x, y), m, x increasing; above is solid.  None is no ceiling.

    """

    ground: Float[Array, "point 2"] = eqx.field(converter=jnp.asarray)
    ceiling: Float[Array, "point 2"] | None = eqx.field(
        converter=lambda points: None if points is None else jnp.asarray(points), default=None
    )

    def __check_init__(self) -> None:
        """Refuse what is no polyline.

        Raises:
            InvalidSettings: fewer than two points, a point that is not finite, or x that does not
                increase.

        """
        for name in ("ground", "ceiling"):
            points = getattr(self, name)
            if points is None or not eqx.is_concrete(points):
                continue
            points = np.asarray(points)
            if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 2:
                raise InvalidSettings(
                    f"Terrain: {name} has the shape {points.shape}; allowed: two points (x, y) or "
                    "more."
                )
            if not (np.isfinite(points).all() and (np.diff(points[:, 0]) > 0).all()):
                raise InvalidSettings(
                    f"Terrain: {name} = {points.tolist()}; allowed: finite points, x increasing."
                )


def flat() -> Terrain:
    """Level ground at y = 0, without end."""
    return Terrain(np.array([(0.0, 0.0), (1.0, 0.0)]))


class Contacts(NamedTuple):
    """Corners of all rigid bodies and what they touch; [..., corner, colour, body, *batch]."""

    local: Float[Array, "2 corner colour body ..."]  # from the rigid body's centre, not rotated, m
    normal: Float[Array, "2 corner colour body *batch"]  # out of what is touched
    reach: Float[Array, "corner colour body *batch"]  # of the surface along the normal, m
    lever: Float[Array, "2 corner colour body *batch"]  # from the rigid body's centre, m
    rebound: Float[Array, "corner colour body *batch"]  # velocity along the normal after, m/s
    touching: Bool[Array, "corner colour body *batch"]


def terrain_contacts(
    lattice: Lattice,
    material: Material,
    terrain: Terrain,
    place: tuple[Array, Array],
    velocity: Float[Array, "3 colour body *batch"],
) -> Contacts:
    """What touches the terrain.

    Args:
        lattice: the body.
        material: of its voxels.
        terrain: what there is to touch.
        place: displacement and heading of rigid bodies.
        velocity: of rigid bodies, before any impulse.

    """
    moved, heading = place
    local, exists = _corners(lattice, material, moved.ndim - 3)
    lever = rotated(heading[:, None], local)
    centre = moved + over_batch(rest(lattice, material), moved.ndim - 3)
    at = centre[:, None] + lever
    normal, reach = _surface(terrain.ground, at, 1.0)
    depth = reach - (at * normal).sum(0)
    if terrain.ceiling is not None:
        above, reach_above = _surface(terrain.ceiling, at, -1.0)
        depth_above = reach_above - (at * above).sum(0)
        is_above = depth_above > depth
        normal = jnp.where(is_above, above, normal)
        reach = jnp.where(is_above, reach_above, reach)
        depth = jnp.maximum(depth, depth_above)
    approach = (normal * (velocity[:2, None] + velocity[2] * _left(lever))).sum(0)
    rebound = jnp.where(approach < -SLOWEST, -material.restitution * approach, 0.0)
    return Contacts(local, normal, reach, lever, rebound, exists & (depth > 0))


def _left(vector: Float[Array, "2 *at"]) -> Float[Array, "2 *at"]:
    """A vector turned left by a right angle: the velocity at a lever for 1 rad/s."""
    return jnp.stack([-vector[1], vector[0]])


def _corners(
    lattice: Lattice, material: Material, batch: int
) -> tuple[Float[Array, "2 corner colour body ..."], Bool[Array, "corner colour body ..."]]:
    """Corners of the squares of each rigid body, from its centre (m), and which there are."""
    listed = lattice.voxel
    exists = listed < lattice.voxels
    mirror = lattice.mirror[:, jnp.minimum(listed, lattice.voxels - 1)]
    outward = jnp.asarray(SIGNS.T, float)[:, :, None, None] * mirror  # [2, colour, body, square]
    square = jnp.moveaxis(-outward / 2 - lattice.centre[..., None], -1, 1)
    corner = square[:, :, None] + jnp.asarray(SIGNS.T, float)[:, None, :, None, None] / 2
    corner = corner.reshape(2, CORNERS, *corner.shape[3:]) * material.square
    there = jnp.repeat(jnp.moveaxis(exists, -1, 0), COLOURS, 0)
    return over_batch(corner, batch), over_batch(there, batch)


def _surface(
    points: Float[Array, "point 2"], at: Float[Array, "2 *at"], side: float
) -> tuple[Float[Array, "2 *at"], Float[Array, "*at"]]:
    """The normal of a polyline above or below places, and how far along it the line is.

    Args:
        points: of the polyline.
        at: the places.
        side: 1 where the normal points up, -1 down.

    """
    segment = sum((at[0] >= x).astype(jnp.int32) for x in points[1:-1, 0]) + jnp.zeros(
        at.shape[1:], jnp.int32
    )
    along = jnp.diff(points, axis=0)
    length = jnp.sqrt((along**2).sum(1))
    normals = side * jnp.stack([-along[:, 1], along[:, 0]]) / length
    reaches = (normals.T * points[:-1]).sum(1)
    return normals[:, segment], reaches[segment]


def resolve(
    contacts: Contacts,
    colour: int,
    friction: Array,
    inverse: Float[Array, "6 body *batch"],
    velocity: Float[Array, "3 body *batch"],
    impulse: Float[Array, "2 corner body *batch"],
) -> tuple[Float[Array, "3 body *batch"], Float[Array, "2 corner body *batch"]]:
    """One sweep over the contacts of the rigid bodies of a colour.

    Args:
        contacts: of all rigid bodies.
        colour: of those.
        friction: mu.
        inverse: of their mass, springs included.
        velocity: of those rigid bodies.
        impulse: so far, along the normal and along the tangent (N s).

    Returns:
        Velocities and impulses after.

    """

    def one(velocity: Array, contact: tuple[Array, ...]) -> tuple[Array, Array]:
        normal, lever, rebound, touching, (pushing, sideways) = contact
        limit = friction * pushing
        along, across = _row(normal, lever), _row(-_left(normal), lever)
        velocity, sideways = _impelled(inverse, velocity, across, 0.0, sideways, (-limit, limit))
        most = jnp.where(touching, jnp.inf, 0.0)
        velocity, pushing = _impelled(inverse, velocity, along, rebound, pushing, (0.0, most))
        return velocity, jnp.stack([pushing, sideways])

    listed = (
        jnp.moveaxis(contacts.normal[:, :, colour], 1, 0),
        jnp.moveaxis(contacts.lever[:, :, colour], 1, 0),
        contacts.rebound[:, colour],
        contacts.touching[:, colour],
        jnp.moveaxis(impulse, 1, 0),
    )
    velocity, after = lax.scan(one, velocity, listed)
    return velocity, jnp.moveaxis(after, 0, 1)


def _row(direction: Float[Array, "2 *at"], lever: Float[Array, "2 *at"]) -> Float[Array, "3 *at"]:
    """The Jacobian of a velocity along a direction: (d, r x d)."""
    return jnp.concatenate([direction, (_left(lever) * direction).sum(0)[None]])


def _impelled(
    inverse: Float[Array, "6 *at"],
    velocity: Float[Array, "3 *at"],
    row: Float[Array, "3 *at"],
    wanted: Any,
    impulse: Float[Array, "*at"],
    limits: tuple[Any, Any],
) -> tuple[Float[Array, "3 *at"], Float[Array, "*at"]]:
    """A rigid body's velocity with the impulse, within its limits, that brings it to a velocity."""
    response = times(inverse, row)
    lacking = (wanted - (row * velocity).sum(0)) / (row * response).sum(0)
    after = jnp.clip(impulse + lacking, *limits)
    return velocity + response * (after - impulse), after


def times(matrix: Float[Array, "6 *at"], vector: Float[Array, "3 *at"]) -> Float[Array, "3 *at"]:
    """A symmetric matrix (xx, xy, yy, xw, yw, ww) times a vector."""
    xx, xy, yy, xw, yw, ww = matrix
    x, y, w = vector
    return jnp.stack([xx * x + xy * y + xw * w, xy * x + yy * y + yw * w, xw * x + yw * y + ww * w])


def impulse_of(
    contacts: Contacts, colour: int, impulse: Float[Array, "2 corner body *batch"]
) -> Float[Array, "3 body *batch"]:
    """The impulses of all contacts on each rigid body of a colour: N s, N s, N m s."""
    pushing, sideways = impulse
    normal, lever = contacts.normal[:, :, colour], contacts.lever[:, :, colour]
    return (_row(normal, lever) * pushing + _row(-_left(normal), lever) * sideways).sum(1)


def lifted(
    lattice: Lattice, material: Material, contacts: Contacts, place: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Rigid bodies moved out of what they overlap, contact after contact, by a share.

    Args:
        lattice: the body.
        material: of its voxels.
        contacts: of this step.
        place: displacement and heading of rigid bodies.

    """
    mass, moment = inertia(lattice, material, place[0].ndim - 3)
    at_rest = over_batch(rest(lattice, material), place[0].ndim - 3)

    def one(place: tuple[Array, Array], contact: tuple[Array, ...]) -> Any:
        moved, heading = place
        local, normal, reach, touching = contact
        lever = rotated(heading, jnp.broadcast_to(local, heading.shape))
        depth = reach - ((moved + at_rest + lever) * normal).sum(0)
        turn = _row(normal, lever)[2]
        share = jnp.clip(CORRECTED * (depth - SLOP), 0.0, FARTHEST)
        push = jnp.where(touching, share, 0.0) / (1 / mass + turn**2 / moment)
        return (moved + normal * (push / mass), turned(heading, turn * push / moment)), None

    listed = (
        jnp.moveaxis(contacts.local, 1, 0),
        jnp.moveaxis(contacts.normal, 1, 0),
        contacts.reach,
        contacts.touching,
    )
    return lax.scan(one, place, listed)[0]


def turned(heading: Float[Array, "2 *at"], angle: Float[Array, "*at"]) -> Float[Array, "2 *at"]:
    """A heading turned by an angle, of length 1 again."""
    after = rotated(jnp.stack([jnp.cos(angle), jnp.sin(angle)]), heading)
    return after / jnp.sqrt((after**2).sum(0))


def inertia(lattice: Lattice, material: Material, batch: int) -> tuple[Array, Array]:
    """Mass (kg) and moment of inertia (kg m^2) of each rigid body."""
    mass = over_batch(lattice.squares * material.square_mass, batch)
    moment = lattice.inertia * material.square_mass * material.square**2
    return mass, over_batch(moment, batch)
