"""Bodies: by name, as text, or as a grid of what is filled.

As text, a layer is a side view: x to the right, z upwards, `#` a voxel and `.` nothing; rows end
with a line's end or `/`.  Layers follow one another in y, parted by an empty line or `|`; empty
ones count for nothing.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Int

from ethogram.core.errors import InvalidSettings

BODIES = {"worm": "####", "biped": "####/#..#", "tripod": "#####/#.#.#"}  # thesis, figure 5.1
MOST_VOXELS = 1000
VOXEL, NOTHING = "#", "."

Body = str | Sequence[Sequence[Sequence[bool]]] | np.ndarray
Cells = tuple[tuple[int, int, int], ...]


def cells_of(body: Body) -> Int[np.ndarray, "voxel 3"]:
    """The cells (x, y, z) of a body, x fastest, from zero on every axis.

    Args:
        body: "worm", "biped", "tripod", text layers, or an array of truth values [x, y, z].

    Raises:
        InvalidSettings: the body is empty, in several parts, too large, or cannot be read.

    """
    grid = _from_text(BODIES.get(body, body)) if isinstance(body, str) else _from_array(body)
    z, y, x = np.nonzero(grid.transpose(2, 1, 0))
    cells = np.stack([x, y, z], 1)
    if not len(cells):
        raise InvalidSettings(f"body {_shown(body)} is empty; it needs at least one voxel.")
    if len(cells) > MOST_VOXELS:
        raise InvalidSettings(
            f"body {_shown(body)} has {len(cells)} voxels; allowed: at most {MOST_VOXELS}."
        )
    _require_one_part(body, cells)
    return cells - cells.min(0)


def layers(cells: Int[np.ndarray, "voxel 3"]) -> str:
    """The body as text, on one line: rows parted by `/`, layers by `|`."""
    grid = np.full(np.asarray(cells).max(0) + 1, NOTHING)
    grid[tuple(np.asarray(cells).T)] = VOXEL
    return "|".join(
        "/".join("".join(row) for row in layer[::-1]) for layer in grid.transpose(1, 2, 0)
    )


def _from_text(text: str) -> Bool[np.ndarray, "x y z"]:
    for character in text:
        if character not in f"{VOXEL}{NOTHING}/|\n":
            raise InvalidSettings(
                f"body {_shown(text)}: {character!r} is no part of one; allowed: "
                f"{', '.join(BODIES)}, or layers of {VOXEL} and {NOTHING} with / after a row and | "
                "after a layer."
            )
    layered = text.replace("\n\n", "|").replace("\n", "/").split("|")
    sides = [rows for side in layered if (rows := [row for row in side.split("/") if row])]
    sizes = {(len(side), len(row)) for side in sides for row in side}
    if len(sizes) > 1:
        found = ", ".join(f"{rows} rows of {length}" for rows, length in sorted(sizes))
        raise InvalidSettings(
            f"body {_shown(text)} has layers or rows of different sizes ({found}); "
            f"fill them up with {NOTHING}."
        )
    filled = np.array([[[c == VOXEL for c in row] for row in side[::-1]] for side in sides], bool)
    return filled.reshape(len(sides), *next(iter(sizes), (0, 0))).transpose(2, 0, 1)


def _from_array(body: Body) -> Bool[np.ndarray, "x y z"]:
    try:
        grid = np.asarray(body)
    except ValueError as error:
        raise InvalidSettings(f"body: a grid needs rows of one length ({error}).") from error
    axes = 3
    if grid.ndim != axes:
        raise InvalidSettings(
            f"body: a grid has three axes, x, y, z; this one has {grid.ndim}: shape {grid.shape}."
        )
    if not np.isin(grid, (0, 1)).all():
        raise InvalidSettings("body: a grid holds true and false (or 1 and 0) only.")
    return grid.astype(bool)


def _require_one_part(body: Body, cells: Int[np.ndarray, "voxel 3"]) -> None:
    left = {tuple(cell) for cell in cells.tolist()}
    parts = []
    while left:
        part, reached = set(), [min(left)]
        while reached:
            cell = reached.pop()
            if cell in left:
                left.remove(cell)
                part.add(cell)
                for axis in range(3):
                    for side in (-1, 1):
                        beside = list(cell)
                        beside[axis] += side
                        reached.append(tuple(beside))
        parts.append(part)
    if len(parts) > 1:
        raise InvalidSettings(
            f"body {_shown(body)} is in {len(parts)} parts that share no face; one of them is at "
            f"(x, y, z) = {min(parts[1])}. Allowed: bodies in one part."
        )


def _shown(body: Body) -> str:
    text = repr(body) if isinstance(body, str) else "given as a grid"
    most = 60
    return text if len(text) <= most else f"{text[:most]}..."
