"""Lattices: the rigid bodies of a voxel-based body in the plane, and which voxels they belong to.

A voxel has a square in each corner.  Squares of neighbouring voxels that face each other are welded
into one rigid body of up to four squares about a vertex of the lattice; voxels that meet in nothing
but a vertex keep rigid bodies of their own.  Vertices have four colours, by the parity of their two
coordinates.  A voxel has one square of each colour, and rigid bodies of one colour share no voxel,
so that all of them can be solved for at once.

In a voxel of an odd column or row the colours lie mirrored; `mirror` says so.
"""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float, Int

from ethogram.core.errors import InvalidSettings

COLOURS = 4
PLACES = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])  # of a colour's square, if nothing is mirrored
SIGNS = 2 * PLACES - 1  # from the centre of a voxel, or of a square, towards each corner
SQUARE_INERTIA = 1 / 6  # of a square about its centre, in m a^2


class Lattice(eqx.Module):
    """A body: its voxels, and its rigid bodies by colour; lengths in sides of squares.

    Rigid bodies of a colour are padded to as many as the colour with the most of them has.
    """

    cell: Int[Array, "voxel 2"]  # column and row
    used: Bool[Array, "voxel"]  # all but padding
    mirror: Float[Array, "2 voxel"]  # 1, or -1 in odd columns (rows)
    body: Int[Array, "colour voxel"]  # the rigid body that a voxel's square of a colour is part of
    voxel: Int[Array, "colour body square"]  # of a rigid body's squares; as many as voxels: none
    vertex: Float[Array, "2 colour body"]  # where the squares meet, in edges
    centre: Float[Array, "2 colour body"]  # of mass, from the vertex, in sides of squares
    squares: Float[Array, "colour body"]  # how many there are in it; padding has one
    inertia: Float[Array, "colour body"]  # about its centre, in m a^2 of one square

    def __repr__(self) -> str:
        return f"Lattice(voxels={self.voxels}, bodies={COLOURS} x {self.bodies})"

    @property
    def voxels(self) -> int:
        """Number of voxels, padding included."""
        return self.cell.shape[-2]

    @property
    def bodies(self) -> int:
        """Number of rigid bodies of each colour, padding included."""
        return self.squares.shape[-1]


def lattice(cells: Int[np.ndarray, "voxel 2"]) -> Lattice:
    """Lattice of cells; voxels keep their order.

    Args:
        cells: (column, row) of each voxel, rows upwards.

    Raises:
        InvalidSettings: no cells, or the same one twice.

    """
    cells = np.asarray(cells, int).reshape(-1, 2)
    at = {(int(x), int(y)): voxel for voxel, (x, y) in enumerate(cells)}
    if not at or len(at) < len(cells):
        twice = next((tuple(c) for c in cells.tolist() if cells.tolist().count(c) > 1), None)
        raise InvalidSettings(
            f"A body needs at least one cell, each once; {twice or 'none is given'}."
        )
    parts = _rigid_bodies(at)
    bodies, voxels = max(map(len, parts)), len(cells)
    body = np.zeros((COLOURS, voxels), int)
    voxel = np.full((COLOURS, bodies, COLOURS), voxels)
    vertex, centre = np.zeros((2, 2, COLOURS, bodies))
    squares, inertia = np.ones((COLOURS, bodies)), np.full((COLOURS, bodies), SQUARE_INERTIA)
    for colour, of_colour in enumerate(parts):
        for number, (corner, members) in enumerate(of_colour):
            body[colour, members] = number
            voxel[colour, number, : len(members)] = members
            offset = cells[members] + 0.5 - corner  # of the squares from the vertex
            middle = offset.mean(0)
            vertex[:, colour, number], centre[:, colour, number] = corner, middle
            squares[colour, number] = len(members)
            inertia[colour, number] = len(members) * SQUARE_INERTIA + ((offset - middle) ** 2).sum()
    return Lattice(
        cell=jnp.asarray(cells, jnp.int32),
        used=jnp.ones(voxels, bool),
        mirror=jnp.asarray(1.0 - 2 * (cells.T % 2)),
        body=jnp.asarray(body, jnp.int32),
        voxel=jnp.asarray(voxel, jnp.int32),
        vertex=jnp.asarray(vertex),
        centre=jnp.asarray(centre),
        squares=jnp.asarray(squares),
        inertia=jnp.asarray(inertia),
    )


def _rigid_bodies(
    at: dict[tuple[int, int], int],
) -> list[list[tuple[tuple[int, int], list[int]]]]:
    """Per colour, each rigid body: its vertex, and its voxels."""
    parts: list[list[tuple[tuple[int, int], list[int]]]] = [[] for _ in range(COLOURS)]
    for x, y in sorted({(i + int(dx), j + int(dy)) for i, j in at for dx, dy in PLACES}):
        round_about = [(x - 1, y - 1), (x, y - 1), (x, y), (x - 1, y)]  # neighbours share faces
        there = [cell in at for cell in round_about]
        if there in ([True, False] * 2, [False, True] * 2):  # two that share the vertex alone
            groups = [[cell] for cell in round_about if cell in at]
        else:
            groups = [[cell for cell in round_about if cell in at]]
        colour = x % 2 + 2 * (y % 2)
        parts[colour] += [((x, y), sorted(at[cell] for cell in group)) for group in groups]
    return parts


def pad(body: Lattice, voxels: int, bodies: int) -> Lattice:
    """A body made larger by padding, which counts nowhere.

    A padding voxel is a lone one that no rigid body knows; its squares follow the first rigid
    body of each colour.

    Args:
        body: the lattice.
        voxels: how many the padded one has.
        bodies: how many rigid bodies of each colour it has.

    """
    more, room = voxels - body.voxels, bodies - body.bodies
    none = jnp.where(body.voxel == body.voxels, voxels, body.voxel)

    def wider(values: Array, fill: float = 0) -> Array:
        return jnp.pad(values, [(0, 0)] * (values.ndim - 1) + [(0, room)], constant_values=fill)

    return Lattice(
        cell=jnp.pad(body.cell, ((0, more), (0, 0))),
        used=jnp.pad(body.used, (0, more)),
        mirror=jnp.pad(body.mirror, ((0, 0), (0, more)), constant_values=1),
        body=jnp.pad(body.body, ((0, 0), (0, more))),
        voxel=jnp.pad(none, ((0, 0), (0, room), (0, 0)), constant_values=voxels),
        vertex=wider(body.vertex),
        centre=wider(body.centre),
        squares=wider(body.squares, 1),
        inertia=wider(body.inertia, SQUARE_INERTIA),
    )


def most_bodies(voxels: int) -> int:
    """How many rigid bodies of a colour any body of so many voxels may have: one in each voxel."""
    return voxels


def stack(lattices: Sequence[Lattice]) -> Lattice:
    """Bodies made equal in size by padding, as one lattice with bodies as leading axis."""
    voxels = max(each.voxels for each in lattices)
    bodies = max(each.bodies for each in lattices)
    padded = [pad(each, voxels, bodies) for each in lattices]
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *padded)
