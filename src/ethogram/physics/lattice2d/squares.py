"""Squares: where those of all voxels are, and what rigid bodies make of it.

Arrays over rigid bodies are [component, colour, body, *batch], those over squares, of which each
voxel has one of each colour, [component, colour, voxel, *batch].
"""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Int, Shaped

from ethogram.physics.lattice2d.lattice import COLOURS, SIGNS, Lattice
from ethogram.physics.lattice2d.material import Material

Colours = Sequence[int] | Int[Array, "square"]


class Squares(eqx.Module):
    """Squares of all voxels, by colour; lengths in m."""

    moved: Float[Array, "2 colour voxel *batch"]  # the rigid body's centre, from its rest
    rest: Float[Array, "2 colour voxel ..."]  # the rigid body's centre at rest
    lever: Float[Array, "2 colour voxel *batch"]  # from the rigid body's centre to the square's
    across: Float[Array, "2 colour voxel *batch"]  # half a side along the square's own x axis
    mirror: Float[Array, "2 voxel ..."]

    def corners(
        self, colour: Colours, signs: Sequence[tuple[int, int]]
    ) -> Float[Array, "2 corner voxel *batch"]:
        """From the centres of squares to corners of them, m.

        Args:
            colour: of the square, for each corner.
            signs: of each corner, in a voxel that is not mirrored; (0, 0) is the centre itself.

        """
        sign = over_batch(jnp.asarray(signs, self.across.dtype), self.across.ndim - 2)
        along, beside = (sign[:, axis] * self.mirror[axis] for axis in range(2))
        x, y = _at(self.across, colour)
        return jnp.stack([along * x - beside * y, along * y + beside * x])

    def levers(self, colour: Colours) -> Float[Array, "2 square voxel *batch"]:
        """From the centres of rigid bodies to those of squares of these colours, m."""
        return _at(self.lever, colour)

    def between(self, first: Colours, second: Colours) -> Float[Array, "2 pair voxel *batch"]:
        """From the centres of squares of these colours to others of the same voxels, m."""
        at = self.moved + self.lever
        return _at(at, second) - _at(at, first) + (_at(self.rest, second) - _at(self.rest, first))


def _at(values: Shaped[Array, "c colour ..."], colour: Colours) -> Array:
    """The values of colours, one after the other."""
    return jnp.stack([values[:, each] for each in colour], 1)


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
    return _total(lattice.voxel[colour], values)


def of_bodies(lattice: Lattice, values: Shaped[Array, "c colour voxel *batch"]) -> Array:
    """Per rigid body, the sum over its squares."""
    first = values.shape[2] * jnp.arange(COLOURS)[:, None, None]
    nothing = values.shape[2] * COLOURS
    index = jnp.where(lattice.voxel < values.shape[2], lattice.voxel + first, nothing)
    return _total(index, values.reshape(values.shape[0], -1, *values.shape[3:]))


def _total(index: Int[Array, "*body square"], values: Shaped[Array, "c item *batch"]) -> Array:
    """Sums over the items of each body; an index beyond the last is no item."""
    padded = jnp.concatenate([values, jnp.zeros_like(values[:, :1])], 1)
    one, *others = (
        padded.at[:, index[..., square]].get(mode="promise_in_bounds", wrap_negative_indices=False)
        for square in range(index.shape[-1])
    )
    return sum(others, one)


def rotated(turn: Float[Array, "2 *#at"], vector: Float[Array, "2 *#at"]) -> Float[Array, "2 ..."]:
    """A vector turned by an angle, of which cosine and sine are given."""
    (cosine, sine), (x, y) = turn, vector
    return jnp.stack([cosine * x - sine * y, sine * x + cosine * y])


def cross(a: Float[Array, "2 *#at"], b: Float[Array, "2 *#at"]) -> Float[Array, "..."]:
    """The product a x b of two vectors in the plane."""
    return a[0] * b[1] - a[1] * b[0]


def over_batch(values: Array, axes: int) -> Array:
    """Values that are the same for all of a batch, with as many axes more."""
    return values.reshape(values.shape + (1,) * axes)


def area_ratio(material: Material, at: Squares) -> Float[Array, "voxel *batch"]:
    """Area of each voxel between its four outermost corners, over that at rest."""
    corner = at.corners(range(COLOURS), [(int(x), int(y)) for x, y in SIGNS])
    at_corner = at.moved + at.lever + (at.rest - at.rest[:, :1]) + corner
    diagonal = at_corner[:, 3] - at_corner[:, 0]
    other = at_corner[:, 2] - at_corner[:, 1]
    handed = at.mirror[0] * at.mirror[1]
    return handed * cross(diagonal, other) / (2 * material.edge**2)
