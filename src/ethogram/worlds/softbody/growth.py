"""Bodies in the plane from numbers: what genes make of a grid, and bodies drawn at random.

The genotype of a body has a gene for each cell of a square grid (thesis, section 6.4.1).  Cells
become voxels in the order of their genes, the greatest first, until the largest set of voxels that
hang together by their sides has as many as are wanted; that set is the body.  Two sets that are
joined at last may have more.

`rnd` bodies come from genes that are drawn at random; `psrnd` bodies are the cells that a random
walk visits (section 6.4.2).
"""

import numpy as np
from jaxtyping import Float, Int

from ethogram.core.errors import InvalidSettings

SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1))

Cells = Int[np.ndarray, "_ 2"]


def grown(genes: Float[np.ndarray, "cell"], voxels: int = 20) -> Cells:
    """The body that genes make, of at least so many voxels: bottom row first, left to right.

    Args:
        genes: of the cells of a square grid, row after row from below.
        voxels: how many are wanted.

    Raises:
        InvalidSettings: the grid is no square, or has fewer cells than are wanted.

    """
    side = require_room(len(genes), voxels)
    width = side + 2  # an empty cell all around spares a look at the bounds
    part_of: list[list[int] | None] = [None] * (width * width)  # the voxels joined with a voxel
    for gene in np.argsort(-np.asarray(genes), kind="stable").tolist():
        cell = width + 1 + gene + 2 * (gene // side)
        together = part_of[cell] = [cell]
        for beside in (cell - 1, cell + 1, cell - width, cell + width):
            other = part_of[beside]
            if other is None or other is together:
                continue
            smaller, together = sorted((other, together), key=len)
            together += smaller
            for each in smaller:
                part_of[each] = together
        if len(together) >= voxels:
            return _cropped([divmod(each, width)[::-1] for each in together])
    raise AssertionError("the voxels of a full grid hang together")


def random_body(rng: np.random.Generator, voxels: int = 20, side: int = 20) -> Cells:
    """A body from genes that are drawn at random (`rnd`).

    Args:
        rng: consumed.
        voxels: how many are wanted.
        side: of the grid, in cells.

    """
    return grown(rng.random(side * side), voxels)


def walked_body(rng: np.random.Generator, voxels: int = 20) -> Cells:
    """The cells that a random walk visits, until there are so many (`psrnd`).

    Args:
        rng: consumed.
        voxels: how many.

    Raises:
        InvalidSettings: less than one voxel is wanted.

    """
    if voxels < 1:
        raise InvalidSettings(f"voxels = {voxels}; allowed: at least 1.")
    x, y = 0, 0
    visited = {(x, y)}
    while len(visited) < voxels:
        dx, dy = SIDES[rng.integers(len(SIDES))]
        x, y = x + dx, y + dy
        visited.add((x, y))
    return _cropped(list(visited))


def require_room(cells: int, voxels: int) -> int:
    """The side of a grid in which a body can be found.

    Raises:
        InvalidSettings: the cells make no square, or are fewer than the voxels that are wanted.

    """
    side = round(cells**0.5)
    if side * side != cells or not 1 <= voxels <= cells:
        raise InvalidSettings(
            f"A grid of {cells} cells cannot hold a body of {voxels} voxels; allowed: squares of "
            "at least as many cells as voxels, and at least one voxel."
        )
    return side


def _cropped(cells: list[tuple[int, int]]) -> Cells:
    """Cells from zero on both axes, bottom row first, left to right."""
    found = np.array(sorted(cells, key=lambda cell: cell[::-1]), np.int32)
    return found - found.min(0)
