"""Squares: where those of all voxels are, and what rigid bodies make of it.

Arrays over rigid bodies are [component, colour, body, *batch], those over squares, of which each
voxel has one of each colour, [component, colour, voxel, *batch].
"""

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Shaped

from ethogram.physics.lattice2d.lattice import COLOURS, SIGNS, Lattice
from ethogram.physics.lattice2d.material import Material

OfBodies = Float[Array, "c colour body *batch"]
OfSquares = Float[Array, "c colour voxel *batch"]


class Squares(eqx.Module):
    """Squares of all voxels, by colour; lengths in m."""

    moved: Float[Array, "2 colour voxel *batch"]  # the rigid body's centre, from its rest
    rest: Float[Array, "2 colour voxel ..."]  # the rigid body's centre at rest
    lever: Float[Array, "2 colour voxel *batch"]  # from the rigid body's centre to the square's
    across: Float[Array, "2 colour voxel *batch"]  # half a side along the square's own x axis
    mirror: Float[Array, "2 voxel ..."]

    def corner(self, colour: int, sign: tuple[int, int]) -> tuple[Array, Array]:
        """From a square's centre to a corner, or to the centre itself if the sign is (0, 0).

        Args:
            colour: of the square.
            sign: of the corner, in a voxel that is not mirrored.

        """
        along = [sign[axis] * self.mirror[axis] for axis in range(2)]
        x, y = self.across[:, colour]
        return along[0] * x - along[1] * y, along[0] * y + along[1] * x

    def between(self, first: int, second: int) -> tuple[Array, Array]:
        """From the centre of one square to that of another one of the same voxel."""
        at = self.moved + self.lever
        x, y = at[:, second] - at[:, first] + (self.rest[:, second] - self.rest[:, first])
        return x, y


def squares(lattice: Lattice, material: Material, moved: Array, heading: Array) -> Squares:
    """Squares of all voxels.

    Args:
        lattice: the body.
        material: of its voxels.
        moved: displacement of each rigid body's centre, m.
        heading: cosine and sine of each rigid body's angle.

    """
    batch = moved.ndim - 3
    turn = of_squares(lattice, heading)
    from_centre = over_batch(square_offset(lattice) * material.square, batch)
    return Squares(
        moved=of_squares(lattice, moved),
        rest=over_batch(of_squares(lattice, rest(lattice, material)), batch),
        lever=rotated(turn, from_centre),
        across=turn * (material.square / 2),
        mirror=over_batch(lattice.mirror, batch),
    )


def square_offset(lattice: Lattice) -> Float[Array, "2 colour voxel"]:
    """From a rigid body's centre to those of its squares at rest, in sides of squares."""
    outward = jnp.asarray(SIGNS.T, float)[:, :, None] * lattice.mirror[:, None]
    return -outward / 2 - of_squares(lattice, lattice.centre)


def rest(lattice: Lattice, material: Material) -> Float[Array, "2 colour body"]:
    """Centres of rigid bodies at rest, from the lower left corner of cell (0, 0), m."""
    return lattice.vertex * material.edge + lattice.centre * material.square


def of_squares(lattice: Lattice, values: Shaped[Array, "c colour body *batch"]) -> Array:
    """What the rigid bodies of squares have."""
    flat = values.reshape(values.shape[0], -1, *values.shape[3:])
    index = lattice.body + lattice.bodies * jnp.arange(COLOURS)[:, None]
    return flat.at[:, index].get(mode="promise_in_bounds", wrap_negative_indices=False)


def of_colour(lattice: Lattice, colour: int, values: Shaped[Array, "c body *batch"]) -> Array:
    """What the rigid bodies of the squares of one colour have."""
    return values.at[:, lattice.body[colour]].get(
        mode="promise_in_bounds", wrap_negative_indices=False
    )


def total(lattice: Lattice, colour: int, values: Shaped[Array, "c voxel *batch"]) -> Array:
    """Per rigid body of a colour, the sum over its squares."""
    padded = jnp.concatenate([values, jnp.zeros_like(values[:, :1])], 1)
    listed = padded.at[:, lattice.voxel[colour].T].get(
        mode="promise_in_bounds", wrap_negative_indices=False
    )
    return listed[:, 0] + listed[:, 1] + listed[:, 2] + listed[:, 3]


def rotated(turn: Float[Array, "2 *at"], vector: Float[Array, "2 *at"]) -> Float[Array, "2 *at"]:
    """A vector turned by an angle, of which cosine and sine are given."""
    (cosine, sine), (x, y) = turn, vector
    return jnp.stack([cosine * x - sine * y, sine * x + cosine * y])


def cross(a: tuple[Array, Array], b: tuple[Array, Array]) -> Array:
    """The product a x b of two vectors in the plane."""
    return a[0] * b[1] - a[1] * b[0]


def over_batch(values: Array, axes: int) -> Array:
    """Values that are the same for all of a batch, with as many axes more."""
    return values.reshape(values.shape + (1,) * axes)


def area_ratio(lattice: Lattice, material: Material, at: Squares) -> Float[Array, "voxel *batch"]:
    """Area of each voxel between its four outermost corners, over that at rest."""
    corners = []
    for colour, sign in enumerate(SIGNS.tolist()):
        x, y = at.corner(colour, sign)
        corners.append(
            (at.moved + at.lever + at.rest)[:, colour] - at.rest[:, 0] + jnp.stack([x, y])
        )
    diagonal, other = corners[3] - corners[0], corners[2] - corners[1]
    handed = at.mirror[0] * at.mirror[1]
    return handed * cross(tuple(diagonal), tuple(other)) / (2 * material.edge**2)
