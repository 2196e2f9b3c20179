"""Which voxels are joined, and which could touch: a body's lattice as index arrays."""

from collections.abc import Sequence
from typing import Any

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
    """The voxels at one end of items (bonds, or pairs), and back: the items that end at a voxel.

    A voxel's items stand in slots; slots that are not needed name an item that is always zero.
    """

    voxel: Int[Array, "item"]
    items: Int[Array, "slot voxel"]

    def of(self, value: Shaped[Array, "c voxel *batch"]) -> Shaped[Array, "c item *batch"]:
        """The values of the voxels at this end."""
        return value[:, self.voxel]

    def total(self, value: Shaped[Array, "c item *batch"]) -> Shaped[Array, "c voxel *batch"]:
        """Per voxel, the sum over the items that have it at this end."""
        padded = jnp.concatenate([value, jnp.zeros_like(value[:, :1])], 1)
        start = jnp.zeros_like(value, shape=(value.shape[0], self.items.shape[1], *value.shape[2:]))
        if len(self.items) > UNROLLED:
            return lax.scan(
                lambda so_far, items: (so_far + padded[:, items], None), start, self.items
            )[0]
        return sum((padded[:, self.items[slot]] for slot in range(len(self.items))), start)


class Lattice(eqx.Module):
    """A body: its cells, the bonds between neighbours, and the pairs that could collide."""

    cell: Int[Array, "voxel 3"]  # place in the grid, in edges
    used: Bool[Array, "voxel"]  # all but padding
    first: Ends  # of bonds: the voxel at the lower end of the axis
    second: Ends
    axis: Int[Array, "bond"]  # 0, 1, 2: along x, y, z
    left: Ends  # of pairs of surface voxels that could touch
    right: Ends

    @property
    def voxels(self) -> int:
        """How many voxels there are, padding included."""
        return self.cell.shape[-2]

    @property
    def bonds(self) -> int:
        """How many bonds there are, padding included."""
        return self.axis.shape[-1]


def lattice(cells: Int[np.ndarray, "voxel 3"]) -> Lattice:
    """Join every two face-adjacent cells; voxels keep the order of the cells.

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


def stack(lattices: Sequence[Lattice]) -> Lattice:
    """Make bodies equal in size by padding, as one lattice with bodies as leading axis.

    A padding voxel belongs to nothing: it falls, and counts nowhere.  A padding bond or pair
    repeats another, and no voxel receives its forces.
    """
    voxels = max(body.voxels for body in lattices)
    bonds = max(body.bonds for body in lattices)
    pairs = max(len(body.left.voxel) for body in lattices)
    slots = {
        name: max(len(getattr(body, name).items) for body in lattices)
        for name in ("first", "second", "left", "right")
    }

    def padded(body: Lattice) -> Lattice:
        def ends(name: str, items: int) -> Ends:
            old = getattr(body, name)
            nothing = jnp.where(old.items == len(old.voxel), items, old.items)
            room = ((0, slots[name] - len(old.items)), (0, voxels - body.voxels))
            return Ends(
                voxel=_repeated(old.voxel, items),
                items=jnp.pad(nothing, room, constant_values=items),
            )

        return Lattice(
            cell=jnp.pad(body.cell, ((0, voxels - body.voxels), (0, 0))),
            used=jnp.pad(body.used, (0, voxels - body.voxels)),
            first=ends("first", bonds),
            second=ends("second", bonds),
            axis=_repeated(body.axis, bonds),
            left=ends("left", pairs),
            right=ends("right", pairs),
        )

    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *map(padded, lattices))


def _repeated(values: Array, length: int) -> Array:
    missing = length - len(values)
    return jnp.pad(values, (0, missing), mode="edge" if len(values) else "constant")


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
