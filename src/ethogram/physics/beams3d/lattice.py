"""Lattices: which voxels of a body are joined, and which could touch, as index arrays."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Bool, Int, Shaped

from ethogram.core.errors import InvalidSettings

NEIGHBOURS = 6
TOUCH_BEYOND = 3  # bonds along the shortest path: nearer voxels never collide
UNROLLED = 16  # slots: beyond, as of pairs in large bodies, a loop compiles faster


class Ends(eqx.Module):
    """Index of one end of items (bonds, or pairs): their voxels, and each voxel's items.

    A voxel's items stand in slots; slots that are not needed name an item that is always zero.
    """

    voxel: Int[Array, "item"]
    items: Int[Array, "slot voxel"]

    def of(self, value: Shaped[Array, "c voxel *batch"]) -> Shaped[Array, "c item *batch"]:
        """The values of the voxels at this end."""
        return _take(value, self.voxel)

    def total(self, value: Shaped[Array, "c item *batch"]) -> Shaped[Array, "c voxel *batch"]:
        """Per voxel, the sum over the items that have it at this end."""
        padded = jnp.concatenate([value, jnp.zeros_like(value[:, :1])], 1)
        start = jnp.zeros_like(value, shape=(value.shape[0], self.items.shape[1], *value.shape[2:]))
        if len(self.items) > UNROLLED:
            return lax.scan(
                lambda so_far, items: (so_far + _take(padded, items), None), start, self.items
            )[0]
        return sum((_take(padded, self.items[slot]) for slot in range(len(self.items))), start)


def _take(value: Shaped[Array, "c voxel *batch"], index: Int[Array, "item"]) -> Array:
    """Entries along the second axis, unchecked: for the inner loop."""
    return value.at[:, index].get(mode="promise_in_bounds", wrap_negative_indices=False)


class Lattice(eqx.Module):
    """A body: its cells, the bonds between neighbours, and the pairs that could collide."""

    cell: Int[Array, "voxel 3"]  # place in the grid, in edges
    used: Bool[Array, "voxel"]  # all but padding
    first: Ends  # of bonds: the voxel at the lower end of the axis
    second: Ends
    axis: Int[Array, "bond"]  # 0, 1, 2: along x, y, z
    left: Ends  # of pairs of surface voxels that could touch
    right: Ends
    is_padded: bool = eqx.field(static=True, default=False)  # whether some may not be used

    def __repr__(self) -> str:
        return f"Lattice(voxels={self.voxels}, bonds={self.bonds}, pairs={self.pairs})"

    @property
    def voxels(self) -> int:
        """Number of voxels, padding included."""
        return self.cell.shape[-2]

    @property
    def bonds(self) -> int:
        """Number of bonds, padding included."""
        return self.axis.shape[-1]

    @property
    def pairs(self) -> int:
        """Number of pairs, padding included."""
        return self.left.voxel.shape[-1]

    @property
    def bond_used(self) -> Bool[Array, "bond"]:
        """All bonds but padding: those that some voxel has."""
        listed = self.first.items.ravel()
        return jnp.zeros(self.bonds + 1, bool).at[listed].set(True)[: self.bonds]


def lattice(cells: Int[np.ndarray, "voxel 3"]) -> Lattice:
    """Lattice of cells, every two face-adjacent ones joined; voxels keep their order.

    A bond's first voxel is that at the lower end of its axis.  The original takes the one with the
    lower index, which is the same for cells in its order, x fastest.

    Self-collision is between surface voxels (fewer than six bonds) more than three bonds apart,
    along the shortest path through the body.

    Args:
        cells: (i, j, k) of each voxel.

    Raises:
        InvalidSettings: no cells, or the same one twice.

    """
    order = [(int(i), int(j), int(k)) for i, j, k in cells]
    index = {cell: voxel for voxel, cell in enumerate(order)}
    if not order or len(index) < len(order):
        twice = next((cell for cell in order if order.count(cell) > 1), None)
        raise InvalidSettings(
            f"A body needs at least one cell, each once; {'none is given' if not order else twice}."
        )
    bonds = [
        (voxel, index[beyond], axis)
        for axis in range(3)
        for cell, voxel in index.items()
        if (beyond := tuple(c + (a == axis) for a, c in enumerate(cell))) in index
    ]
    ends = np.array(bonds, int).reshape(-1, 3)
    pairs = _pairs(len(order), ends[:, :2])
    voxels = len(order)
    return Lattice(
        cell=jnp.asarray(np.array(order), jnp.int32),
        used=jnp.ones(voxels, bool),
        first=_ends(ends[:, 0], voxels),
        second=_ends(ends[:, 1], voxels),
        axis=jnp.asarray(ends[:, 2], jnp.int32),
        left=_ends(pairs[:, 0], voxels),
        right=_ends(pairs[:, 1], voxels),
    )


class Size(NamedTuple):
    """Sizes of a lattice's arrays."""

    voxels: int
    bonds: int
    pairs: int
    first: int  # slots of each kind of end
    second: int
    left: int
    right: int

    @classmethod
    def of(cls, body: Lattice) -> "Size":
        """The size of a lattice, without the bodies that it stacks."""
        slots = (end.items.shape[-2] for end in (body.first, body.second, body.left, body.right))
        return cls(body.voxels, body.bonds, body.pairs, *slots)

    @classmethod
    def for_voxels(cls, voxels: int) -> "Size":
        """Sizes that hold every body of as many voxels, in one part.

        Such a body has at most 3 (n - n^(2/3)) bonds: a bond less than voxels in each row, and by
        Loomis and Whitney (1949) at least 3 n^(2/3) rows.  At least three others are within three
        bonds of each voxel.
        """
        bonds = int(3 * (voxels - voxels ** (2 / 3)) + 1e-9)
        partners = max(0, voxels - 1 - TOUCH_BEYOND)
        axes = 3
        return cls(voxels, bonds, voxels * partners // 2, axes, axes, partners, partners)


def pad(body: Lattice, size: Size) -> Lattice:
    """A body made larger by padding, which counts nowhere.

    A padding voxel lies beside the body and belongs to nothing.  A padding bond or pair repeats
    another, or joins voxels of no use, and no voxel receives its forces.
    """
    body = jax.tree.map(np.asarray, body)
    more, bonds = size.voxels - body.voxels, size.bonds - body.bonds
    row = np.zeros((more, body.cell.shape[1]), body.cell.dtype)
    row[:, 0] = body.cell[:, 0].max() + 2 * np.arange(1, more + 1)

    def ends(old: Ends, items: int, slots: int, *, far: bool) -> Ends:
        nothing = np.where(old.items == len(old.voxel), items, old.items)
        room = ((0, slots - len(old.items)), (0, more))
        padding = old.voxel[-1] if len(old.voxel) else (size.voxels - 1 if far else 0)
        return Ends(
            jnp.asarray(np.append(old.voxel, [padding] * (items - len(old.voxel))), jnp.int32),
            jnp.asarray(np.pad(nothing, room, constant_values=items), jnp.int32),
        )

    axis = np.append(body.axis, [body.axis[-1] if body.bonds else 0] * bonds)
    return Lattice(
        cell=jnp.asarray(np.concatenate([body.cell, row])),
        used=jnp.asarray(np.pad(body.used, (0, more))),
        first=ends(body.first, size.bonds, size.first, far=False),
        second=ends(body.second, size.bonds, size.second, far=True),
        axis=jnp.asarray(axis, jnp.int32),
        left=ends(body.left, size.pairs, size.left, far=False),
        right=ends(body.right, size.pairs, size.right, far=True),
        is_padded=True,
    )


def stack(lattices: Sequence[Lattice]) -> Lattice:
    """Bodies made equal in size by padding, as one lattice with bodies as leading axis."""
    size = Size(*map(max, zip(*map(Size.of, lattices), strict=True)))
    padded = [pad(body, size) for body in lattices]
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *padded)


def _ends(voxel: Int[np.ndarray, "item"], voxels: int) -> Ends:
    ending = [np.flatnonzero(voxel == v) for v in range(voxels)]
    slots = max(map(len, ending))
    items = np.full((slots, voxels), len(voxel))
    for v, found in enumerate(ending):
        items[: len(found), v] = found
    return Ends(jnp.asarray(voxel, jnp.int32), jnp.asarray(items, jnp.int32))


def _pairs(voxels: int, bonds: Int[np.ndarray, "bond 2"]) -> Int[np.ndarray, "pair 2"]:
    """Pairs of surface voxels that are too far apart to be held apart by bonds."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    graph: Any = coo_array((np.ones(len(bonds)), (bonds[:, 0], bonds[:, 1])), (voxels, voxels))
    reach = dijkstra(graph.tocsr(), directed=False, unweighted=True, limit=TOUCH_BEYOND)
    surface = np.bincount(bonds.ravel(), minlength=voxels) < NEIGHBOURS
    apart = np.isinf(reach) & surface[:, None] & surface[None, :]
    return np.argwhere(np.triu(apart, 1))
