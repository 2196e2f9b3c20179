"""Contacts: corners of squares with the terrain, and squares of a voxel with each other (ropes).

Whatever is in contact has an impulse along the normal n that pushes and never pulls, and with the
terrain one along the tangent t that is at most mu times the other (Coulomb).
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Bool, Float

from ethogram.core.errors import InvalidSettings
from ethogram.core.settings import Number
from ethogram.physics.lattice2d.lattice import SIGNS, Lattice
from ethogram.physics.lattice2d.material import Material
from ethogram.physics.lattice2d.squares import over_batch, rest, rotated

POINTS_OF_SQUARE = 2  # corners that can touch a surface
POINTS = 4 * POINTS_OF_SQUARE  # of a rigid body, of up to four squares
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
            if points is None or isinstance(points, jax.core.Tracer):
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
    return Terrain(jnp.array([(0.0, 0.0), (1.0, 0.0)]))


def height(terrain: Terrain, x: Float[Array, "*at"]) -> Float[Array, "*at"]:
    """Height of the ground at places, m; beyond its ends it goes on as it is."""
    at = jnp.stack([x, jnp.zeros_like(x)])
    normal, reach = _surface(terrain.ground, at, 1.0)
    return (reach - normal[0] * x) / normal[1]


class Contacts(NamedTuple):
    """Corners of the squares of all rigid bodies, and what they touch.

    Of a square two corners can touch a surface: those of the side that faces it most.
    """

    local: Float[Array, "point 2 colour body *batch"]  # from the body's centre, not rotated, m
    normal: Float[Array, "point 2 colour body *batch"]  # out of what is touched
    reach: Float[Array, "point colour body *batch"]  # of the surface along the normal, m
    lever: Float[Array, "point 2 colour body *batch"]  # from the rigid body's centre, m
    rebound: Float[Array, "point colour body *batch"]  # velocity along the normal after, m/s
    touching: Bool[Array, "point colour body *batch"]


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
    batch = moved.ndim - 3
    offset, exists = _squares(lattice, material, batch)  # [2, square, ...]
    centre = moved + over_batch(rest(lattice, material), batch)
    middle = centre[:, None] + rotated(heading[:, None], offset)
    normal, _, _ = _deepest(terrain, middle)
    local = jnp.stack(
        [offset + side for side in _facing(heading[:, None], normal, material.square)]
    )
    local = jnp.moveaxis(local, 1, 0).reshape(2, POINTS, *moved.shape[1:])
    lever = rotated(heading[:, None], local)
    normal, reach, depth = _deepest(terrain, centre[:, None] + lever)
    approach = (normal * (velocity[:2, None] + velocity[2] * _left(lever))).sum(0)
    rebound = jnp.where(approach < -SLOWEST, -material.restitution * approach, 0.0)
    touching = jnp.concatenate([exists] * POINTS_OF_SQUARE) & (depth > 0)
    first = [jnp.moveaxis(each, 1, 0) for each in (local, normal, lever)]
    return Contacts(first[0], first[1], reach, first[2], rebound, touching)


def _left(vector: Float[Array, "2 *at"]) -> Float[Array, "2 *at"]:
    """A vector turned left by a right angle: the velocity at a lever for 1 rad/s."""
    return jnp.stack([-vector[1], vector[0]])


def _squares(
    lattice: Lattice, material: Material, batch: int
) -> tuple[Float[Array, "2 square colour body ..."], Bool[Array, "square colour body ..."]]:
    """Centres of the squares of each rigid body, from its own (m), and which there are."""
    listed = lattice.voxel
    mirror = lattice.mirror[:, jnp.minimum(listed, lattice.voxels - 1)]
    outward = jnp.asarray(SIGNS.T, float)[:, :, None, None] * mirror  # [2, colour, body, square]
    offset = (-outward / 2 - lattice.centre[..., None]) * material.square
    exists = jnp.moveaxis(listed < lattice.voxels, -1, 0)
    return over_batch(jnp.moveaxis(offset, -1, 1), batch), over_batch(exists, batch)


def _facing(
    heading: Float[Array, "2 *#at"], normal: Float[Array, "2 *#at"], side: Number
) -> list[Float[Array, "2 ..."]]:
    """The two corners of a square that face a surface the most, from its centre, not rotated, m."""
    along = rotated(heading * jnp.array([1.0, -1.0]).reshape(2, *[1] * (heading.ndim - 1)), normal)
    is_upright = jnp.abs(along[1]) >= jnp.abs(along[0])
    towards = -jnp.sign(along) * side / 2
    corners = []
    for sign in (-1, 1):
        lateral = jnp.full_like(towards[0], sign * side / 2)
        x = jnp.where(is_upright, lateral, towards[0])
        corners.append(jnp.stack([x, jnp.where(is_upright, towards[1], lateral)]))
    return corners


def _deepest(terrain: Terrain, at: Float[Array, "2 *at"]) -> tuple[Array, Array, Array]:
    """Normal, reach along it and depth of the surface that places are in the deepest."""
    normal, reach = _surface(terrain.ground, at, 1.0)
    depth = reach - (at * normal).sum(0)
    if terrain.ceiling is None:
        return normal, reach, depth
    above, reach_above = _surface(terrain.ceiling, at, -1.0)
    depth_above = reach_above - (at * above).sum(0)
    is_above = depth_above > depth
    return (
        jnp.where(is_above, above, normal),
        jnp.where(is_above, reach_above, reach),
        jnp.maximum(depth, depth_above),
    )


def _surface(
    points: Float[Array, "point 2"], at: Float[Array, "2 *at"], side: float
) -> tuple[Float[Array, "2 *at"], Float[Array, "*at"]]:
    """The normal of a polyline above or below places, and how far along it the line is.

    Args:
        points: of the polyline.
        at: the places.
        side: 1 where the normal points up, -1 down.

    """
    segment = jnp.zeros(at.shape[1:], jnp.int32)
    for x in points[1:-1, 0]:
        segment += (at[0] >= x).astype(jnp.int32)
    along = jnp.diff(points, axis=0)
    length = jnp.sqrt((along**2).sum(1))
    normals = side * jnp.stack([-along[:, 1], along[:, 0]]) / length
    reaches = (normals.T * points[:-1]).sum(1)
    return normals[:, segment], reaches[segment]


class Rows(NamedTuple):
    """Jacobians of contacts along normals and tangents, and what their impulses do."""

    along: Float[Array, "point 3 colour body *batch"]
    across: Float[Array, "point 3 colour body *batch"]
    pushed: Float[Array, "point 3 colour body *batch"]  # velocity for an impulse along the normal
    dragged: Float[Array, "point 3 colour body *batch"]
    mass: Float[Array, "point 2 colour body *batch"]  # of the points, along and across, kg


def rows(contacts: Contacts, inverse: Float[Array, "6 colour body *batch"]) -> Rows:
    """Jacobians of contacts.

    Args:
        contacts: of all rigid bodies.
        inverse: of their mass, springs included.

    """

    def row(direction: Array, lever: Array) -> tuple[Array, Array, Array]:
        jacobian = jnp.concatenate([direction, (_left(lever) * direction).sum(0)[None]])
        response = times(inverse, jacobian)
        return jacobian, response, 1 / (jacobian * response).sum(0)

    def both(normal: Array, lever: Array) -> Rows:
        along, pushed, one = row(normal, lever)
        across, dragged, other = row(-_left(normal), lever)
        return Rows(along, across, pushed, dragged, jnp.stack([one, other]))

    return jax.vmap(both)(contacts.normal, contacts.lever)


class Motion(NamedTuple):
    """Velocities of rigid bodies, and the impulses on each that give them."""

    velocity: Float[Array, "3 colour body *batch"]
    impulse: Float[Array, "3 colour body *batch"]  # of contacts and ropes: N s, N s, N m s


def resolve(
    contacts: Contacts,
    rows: Rows,
    friction: Number,
    motion: Motion,
    impulse: Float[Array, "point 2 colour body *batch"],
) -> tuple[Motion, Float[Array, "point 2 colour body *batch"]]:
    """One sweep over the contacts of each rigid body, point after point.

    Args:
        contacts: of all rigid bodies.
        rows: their Jacobians.
        friction: mu.
        motion: of rigid bodies.
        impulse: so far, along the normal and along the tangent (N s).

    Returns:
        Motion and impulses after.

    """

    def one(
        motion: Motion, contact: tuple[Array, Array, Array, Rows]
    ) -> tuple[Motion, Float[Array, "2 colour body *batch"]]:
        (pushing, sideways), rebound, touching, row = contact
        velocity, on_body = motion
        lacking = rebound - (row.along * velocity).sum(0)
        lifting = jnp.where(touching, jnp.maximum(pushing + row.mass[0] * lacking, 0.0), 0.0)
        velocity = velocity + row.pushed * (lifting - pushing)
        limit = friction * lifting
        slip = (row.across * velocity).sum(0)
        dragging = jnp.clip(sideways - row.mass[1] * slip, -limit, limit)
        velocity = velocity + row.dragged * (dragging - sideways)
        on_body += row.along * (lifting - pushing) + row.across * (dragging - sideways)
        return Motion(velocity, on_body), jnp.stack([lifting, dragging])

    return lax.scan(one, motion, (impulse, contacts.rebound, contacts.touching, rows))


def impulse_of(rows: Rows, impulse: Float[Array, "point 2 colour body *batch"]) -> Array:
    """The impulses of all contacts on each rigid body: N s, N s, N m s."""
    return (rows.along * impulse[:, :1] + rows.across * impulse[:, 1:]).sum(0)


def times(matrix: Float[Array, "6 *at"], vector: Float[Array, "3 *at"]) -> Float[Array, "3 *at"]:
    """A symmetric matrix (xx, xy, yy, xw, yw, ww) times a vector."""
    xx, xy, yy, xw, yw, ww = matrix
    x, y, w = vector
    return jnp.stack([xx * x + xy * y + xw * w, xy * x + yy * y + yw * w, xw * x + yw * y + ww * w])


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

    def one(point: Array, place: tuple[Array, Array]) -> tuple[Array, Array]:
        moved, heading = place
        normal = contacts.normal[point]
        lever = rotated(heading, contacts.local[point])
        depth = contacts.reach[point] - ((moved + at_rest + lever) * normal).sum(0)
        turn = (_left(lever) * normal).sum(0)
        share = jnp.clip(CORRECTED * (depth - SLOP), 0.0, FARTHEST)
        push = jnp.where(contacts.touching[point], share, 0.0) / (1 / mass + turn**2 / moment)
        return moved + normal * (push / mass), turned(heading, turn * push / moment)

    return lax.fori_loop(0, POINTS, one, place)


def turned(heading: Float[Array, "2 *at"], angle: Float[Array, "*at"]) -> Float[Array, "2 *at"]:
    """A heading turned by an angle, of length 1 again."""
    after = rotated(jnp.stack([jnp.cos(angle), jnp.sin(angle)]), heading)
    return after / jnp.sqrt((after**2).sum(0))


def inertia(lattice: Lattice, material: Material, batch: int) -> tuple[Array, Array]:
    """Mass (kg) and moment of inertia (kg m^2) of each rigid body."""
    mass = over_batch(lattice.squares * material.square_mass, batch)
    moment = lattice.inertia * material.square_mass * material.square**2
    return mass, over_batch(moment, batch)
