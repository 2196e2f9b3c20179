"""Lattices: the rigid bodies of a voxel-based body in the plane, and which voxels they belong to.

A voxel has a square in each corner.  Squares of neighbouring voxels that face each other are welded
into one rigid body of up to four squares about a vertex of the lattice; voxels that meet in nothing
but a vertex keep rigid bodies of their own.  Vertices have four colours, by the parity of their two
coordinates.  A voxel has one square of each colour, and rigid bodies of one colour share no voxel,
so that all of them can be solved for at once.

In a voxel of an odd column or row the colours lie mirrored; `mirror` says so.
"""

from collections.abc import Sequence
from typing import Any

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

    Rigid bodies of a colour are padded to as many as the colour with the most of them has.  All
    arrays have further leading axes where bodies are stacked.
    """

    cell: Int[Array, "*stack voxel 2"]  # column and row
    used: Bool[Array, "*stack voxel"]  # all but padding
    mirror: Float[Array, "*stack 2 voxel"]  # 1, or -1 in odd columns (rows)
    body: Int[
        Array, "*stack colour voxel"
    ]  # the rigid body that a voxel's square of a colour is part of
    voxel: Int[
        Array, "*stack colour body square"
    ]  # of a rigid body's squares; as many as voxels: none
    vertex: Float[Array, "*stack 2 colour body"]  # where the squares meet, in edges
    centre: Float[Array, "*stack 2 colour body"]  # of mass, from the vertex, in sides of squares
    squares: Float[Array, "*stack colour body"]  # how many there are in it; padding has one
    inertia: Float[Array, "*stack colour body"]  # about its centre, in m a^2 of one square

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
    listed = [tuple(cell) for cell in np.asarray(cells).tolist()]
    if not listed or len(set(listed)) < len(listed):
        twice = next((cell for cell in listed if listed.count(cell) > 1), None)
        raise InvalidSettings(
            f"A body needs at least one cell, each once; {twice or 'none is given'}."
        )
    return jax.tree.map(lambda leaf: leaf[0], lattices([np.asarray(cells)]))


def lattices(bodies: Sequence[Int[np.ndarray, "_ 2"]], voxels: int | None = None) -> Lattice:
    """Lattices of many bodies, made equal in size by padding, with bodies as leading axis.

    Padding voxels are lone ones that no rigid body knows, and count nowhere.

    Args:
        bodies: the cells of each (see `lattice`).
        voxels: how many each has, padding included, and rigid bodies of a colour; None is as few of
            both as will do.

    Raises:
        InvalidSettings: there are no bodies, or one has no cells, one twice, or more than `voxels`.

    """
    sizes = [len(body) for body in bodies]
    most = max(sizes, default=0) if voxels is None else voxels
    if not sizes or min(sizes) < 1 or max(sizes) > most:
        raise InvalidSettings(
            f"lattices: bodies of {sizes[:10]} voxels; allowed: at least one body, each of 1 to "
            f"{most} voxels."
        )
    cells, used = np.zeros((len(bodies), most, 2), np.int32), np.zeros((len(bodies), most), bool)
    for index, body in enumerate(bodies):
        cells[index, : len(body)] = body
        used[index, : len(body)] = True
    listed = np.column_stack([np.nonzero(used)[0], cells[used]])
    if len(np.unique(listed, axis=0)) < len(listed):
        raise InvalidSettings("lattices: a body has the same cell twice; allowed: each once.")
    members = np.stack([_welded(cells, used, colour) for colour in range(COLOURS)], 1)
    is_first = (members[..., 0] == np.arange(most)) & used[:, None]  # it stands for a rigid body
    number: np.ndarray = np.take_along_axis(
        is_first.cumsum(-1) - 1, np.minimum(members[..., 0], most - 1), axis=-1
    )
    rigid = int(is_first.sum(-1).max()) if voxels is None else voxels
    parts = _rigid_bodies(cells, members, is_first, number, rigid)
    mirror = np.where(used[..., None], 1.0 - 2 * (cells % 2), 1.0)
    body = np.where(used[:, None], number, 0)
    return Lattice(
        cell=jnp.asarray(cells),
        used=jnp.asarray(used),
        mirror=jnp.asarray(np.moveaxis(mirror, -1, 1)),
        body=jnp.asarray(body, jnp.int32),
        **{name: jnp.asarray(values) for name, values in parts.items()},
    )


def _vertex(cells: Int[np.ndarray, "*at 2"], colour: Any) -> Int[np.ndarray, "*at 2"]:
    """The vertex of a colour of each voxel."""
    return cells + (cells + PLACES[colour]) % 2


def _welded(
    cells: Int[np.ndarray, "body voxel 2"], used: Bool[np.ndarray, "body voxel"], colour: int
) -> Int[np.ndarray, "body voxel square"]:
    """The voxels whose squares are one rigid body with a voxel's of a colour, in order.

    As many as voxels is nobody.
    """
    nobody = used.shape[1]
    place = np.where(used[..., None], cells - cells[used].min(0) + 1, 0)  # nothing lies at 0
    grid = np.full((len(cells), *(place.max((0, 1)) + 2)), nobody)
    body, voxel = np.nonzero(used)
    grid[body, place[body, voxel, 0], place[body, voxel, 1]] = voxel
    (x, y), (to_x, to_y) = (
        np.moveaxis(each, -1, 0) for each in (place, 2 * (_vertex(cells, colour) - cells) - 1)
    )
    of = np.arange(len(cells))[:, None]
    beside, above = grid[of, x + to_x, y], grid[of, x, y + to_y]
    across = np.where(np.minimum(beside, above) < nobody, grid[of, x + to_x, y + to_y], nobody)
    itself = np.broadcast_to(np.arange(nobody), used.shape)
    return np.sort(np.stack([itself, beside, above, across], -1), axis=-1)


def _rigid_bodies(
    cells: Int[np.ndarray, "body voxel 2"],
    members: Int[np.ndarray, "body colour voxel square"],
    is_first: Bool[np.ndarray, "body colour voxel"],
    number: Int[np.ndarray, "body colour voxel"],
    rigid: int,
) -> dict[str, np.ndarray]:
    """The fields of `Lattice` that are about rigid bodies.

    Args:
        cells: of the voxels.
        members: of the rigid body of each voxel's square of a colour.
        is_first: whether a voxel is the first of those members.
        number: of the rigid body.
        rigid: how many of each colour there are, padding included.

    """
    bodies, voxels = len(cells), cells.shape[1]
    body, colour, first = np.nonzero(is_first)
    listed = members[is_first]
    is_there = (listed < voxels)[..., None]
    vertex = _vertex(cells[body, first], colour)
    middles = cells[body[:, None], np.minimum(listed, voxels - 1)] + 0.5
    offset = np.where(is_there, middles - vertex[:, None], 0.0)  # of the squares' centres
    count = is_there.sum((1, 2))
    centre = offset.sum(1) / count[:, None]
    spread = np.where(is_there, offset - centre[:, None], 0.0)
    shape = bodies, COLOURS, rigid
    found: dict[str, np.ndarray] = {
        "voxel": np.full((*shape, COLOURS), voxels, np.int32),
        "vertex": np.zeros((*shape, 2)),
        "centre": np.zeros((*shape, 2)),
        "squares": np.ones(shape),
        "inertia": np.full(shape, SQUARE_INERTIA),
    }
    at = body, colour, number[is_first]
    inertia = count * SQUARE_INERTIA + (spread**2).sum((1, 2))
    for name, values in zip(found, (listed, vertex, centre, count, inertia), strict=True):
        found[name][at] = values
    for name in ("vertex", "centre"):
        found[name] = np.moveaxis(found[name], -1, 1)
    return found
