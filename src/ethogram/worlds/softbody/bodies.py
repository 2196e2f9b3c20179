"""Bodies as grids of voxels, of two or three axes: by name, as text, or as an array.

As text, a layer is a side view: x to the right, the last axis upwards, `#` a voxel and `.` nothing;
rows end with a line's end or `/`.  A body in the plane is one layer.  In space, layers follow one
another in y, parted by an empty line or `|`; empty ones count for nothing.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Int

from ethogram.core.errors import InvalidSettings

BODIES = {"worm": "####", "biped": "####/#..#", "tripod": "#####/#.#.#"}  # thesis, figure 5.1
PLANE_BODIES = {  # thesis, figure 6.3: 20 voxels each
    "box": "#####/#####/#####/#####",
    "worm": "##########/##########",
    "biped": "######/######/##..##/##..##",
    "revT": "..##../..##../..##../..##../######/######",
}
MAX_VOXELS = 1000
VOXEL, EMPTY = "#", "."
PLANE, SPACE = 2, 3  # axes
AXES = {PLANE: "x, z", SPACE: "x, y, z"}

Body = str | Sequence[Sequence[Any]] | np.ndarray  # a name, text, or truth values by axis
Cells = Int[np.ndarray, "voxel axis"]


def cells_of(body: Body, *, axes: int = SPACE) -> Cells:
    """The cells of a body, x fastest, from zero on every axis.

    Args:
        body: "worm", "biped", "tripod", text layers, or an array of truth values [x, y, z]
            ([x, z] in the plane).
        axes: of the grid: `PLANE` or `SPACE`.

    Raises:
        InvalidSettings: the body is empty, in several parts, too large, or cannot be read.

    """
    named = BODIES.get(body, body) if isinstance(body, str) else body
    grid = _from_text(named, axes) if isinstance(named, str) else _from_array(named, axes)
    cells = np.argwhere(grid.T)[:, ::-1]
    if not len(cells):
        raise InvalidSettings(f"body {_quoted(body)} is empty; it needs at least one voxel.")
    if len(cells) > MAX_VOXELS:
        raise InvalidSettings(
            f"body {_quoted(body)} has {len(cells)} voxels; allowed: at most {MAX_VOXELS}."
        )
    _require_connected(body, cells)
    return cells - cells.min(0)


def text_of(cells: Cells) -> str:
    """Text layers of a body, on one line: rows parted by `/`, layers by `|`."""
    grid = np.full(np.asarray(cells).max(0) + 1, EMPTY)
    grid[tuple(np.asarray(cells).T)] = VOXEL
    layers = grid.reshape(len(grid), -1, grid.shape[-1]).transpose(1, 2, 0)
    return "|".join("/".join("".join(row) for row in layer[::-1]) for layer in layers)


def name_of(cells: Cells) -> str:
    """The name of a body that has one, else its text."""
    text = text_of(cells)
    return next((name for name, body in BODIES.items() if body == text), text)


def _from_text(text: str, axes: int) -> Bool[np.ndarray, "..."]:
    for character in text:
        if character not in f"{VOXEL}{EMPTY}/|\n":
            raise InvalidSettings(
                f"body {_quoted(text)}: {character!r} is no part of one; allowed: "
                f"{', '.join(BODIES)}, or layers of {VOXEL} and {EMPTY} with / after a row and | "
                "after a layer."
            )
    layered = text.replace("\n\n", "|").replace("\n", "/").split("|")
    sides = [rows for side in layered if (rows := [row for row in side.split("/") if row])]
    sizes = {(len(side), len(row)) for side in sides for row in side}
    if len(sizes) > 1:
        found = ", ".join(f"{rows} rows of {length}" for rows, length in sorted(sizes))
        raise InvalidSettings(
            f"body {_quoted(text)} has layers or rows of different sizes ({found}); "
            f"fill them up with {EMPTY}."
        )
    filled = np.array([[[c == VOXEL for c in row] for row in side[::-1]] for side in sides], bool)
    grid = filled.reshape(len(sides), *next(iter(sizes), (0, 0))).transpose(2, 0, 1)
    if axes == SPACE:
        return grid
    if len(sides) != 1:
        raise InvalidSettings(
            f"body {_quoted(text)} has {len(sides)} layers; allowed in the plane: one."
        )
    return grid[:, 0]


def _from_array(body: Body, axes: int) -> Bool[np.ndarray, "..."]:
    try:
        grid = np.asarray(body)
    except ValueError as error:
        raise InvalidSettings(f"body: a grid needs rows of one length ({error}).") from error
    if grid.ndim != axes:
        raise InvalidSettings(
            f"body: a grid has {axes} axes, {AXES[axes]}; this one has {grid.ndim}: "
            f"shape {grid.shape}."
        )
    if not np.isin(grid, (0, 1)).all():
        raise InvalidSettings("body: a grid holds true and false (or 1 and 0) only.")
    return grid.astype(bool)


def _require_connected(body: Body, cells: Cells) -> None:
    """Refuse bodies in several parts that share no face."""
    left = {tuple(cell) for cell in cells.tolist()}
    parts = []
    while left:
        part, reached = set(), [min(left)]
        while reached:
            cell = reached.pop()
            if cell in left:
                left.remove(cell)
                part.add(cell)
                for axis in range(len(cell)):
                    for side in (-1, 1):
                        beside = list(cell)
                        beside[axis] += side
                        reached.append(tuple(beside))
        parts.append(part)
    if len(parts) > 1:
        raise InvalidSettings(
            f"body {_quoted(body)} is in {len(parts)} parts that share no face; one of them is at "
            f"({AXES[cells.shape[1]]}) = {min(parts[1])}. Allowed: bodies in one part."
        )


def _quoted(body: Body) -> str:
    text = repr(body) if isinstance(body, str) else "given as a grid"
    most = 60
    return text if len(text) <= most else f"{text[:most]}..."
