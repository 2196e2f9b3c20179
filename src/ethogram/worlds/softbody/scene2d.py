"""Scenes of bodies in the plane: every voxel a polygon on its terrain."""

from typing import Any, NamedTuple

import numpy as np

from ethogram.core.scene import COLOURS, BackgroundShape, Scene, Shape, Tint
from ethogram.physics.lattice2d import Lattice, Material, State, Terrain
from ethogram.physics.lattice2d.lattice import COLOURS as CORNERS
from ethogram.physics.lattice2d.lattice import SIGNS
from ethogram.physics.lattice2d.squares import area_ratio, squares

FRAME_SECONDS = 1 / 20  # at normal speed
FRAMES = 200  # of an episode, that are shown after its start
AROUND = (0, 1, 3, 2)  # the corners of a voxel, one after the other
CHANGED = 0.02  # of the area at rest: from here on a voxel counts as contracted or expanded
MARGIN = 3.0  # m, around what is shown
PALETTE = (
    Tint("contracted", COLOURS["blue"]),
    Tint("at rest", COLOURS["silver"]),
    Tint("expanded", COLOURS["vermilion"]),
    Tint("ground", COLOURS["grey"]),
)
CONTRACTED, REST, EXPANDED, GROUND = range(4)


class Outline(NamedTuple):
    """Corners and areas of voxels."""

    corner: Any  # Float "... 2 corner voxel *batch", m
    area: Any  # Float "... voxel *batch", ratio to that at rest


def outline(lattice: Lattice, material: Material, state: State) -> Outline:
    """The voxels of a body as a scene shows them."""
    at = squares(lattice, material, state.moved, state.heading)
    corner = at.corners(range(CORNERS), [(int(x), int(y)) for x, y in SIGNS])
    place = at.moved + at.lever + at.rest + corner
    return Outline(place, area_ratio(material, at))


def polygons(corner: np.ndarray) -> np.ndarray:
    """Corners [frame, axis, corner, voxel] as polygons [frame, voxel, vertex, axis].

    Mirrored voxels are gone round the other way, which draws the same.
    """
    return corner.transpose(0, 3, 2, 1)[:, :, AROUND]


def scene_of_outlines(title: str, frames: Outline, terrain: Terrain, *, seconds: float) -> Scene:
    """The scene of an episode.

    Args:
        title: of the scene.
        frames: of one robot; arrays with the frames as leading axis.
        terrain: that it is on.
        seconds: of simulated time, between two frames.

    """
    corner = polygons(np.asarray(frames.corner))
    area = np.asarray(frames.area)
    middle = corner.mean(2)
    centre = middle.mean(1)
    low, high = corner.min((0, 1, 2)) - MARGIN, corner.max((0, 1, 2)) + MARGIN
    gone = centre - centre[0]
    surfaces = [terrain.ground] + ([] if terrain.ceiling is None else [terrain.ceiling])
    return Scene(
        title=title,
        bounds=(float(low[0]), float(low[1]), float(high[0]), float(high[1])),
        frame_seconds=FRAME_SECONDS,
        palette=PALETTE,
        shapes=tuple(Shape("polygon", 1.0) for _ in range(corner.shape[1])),
        background=tuple(
            BackgroundShape(
                "line", tuple((float(x), float(y)) for x, y in np.asarray(points)), GROUND
            )
            for points in surfaces
        ),
        position=middle,
        tint=REST + (area > 1 + CHANGED) - (area < 1 - CHANGED).astype(int),
        vertices=corner - middle[:, :, None],
        captions=tuple(
            f"{now * seconds:.2f} s: {way:.2f} m ahead, {up:.2f} m up"
            for now, (way, up) in enumerate(gone)
        ),
        series={"ahead (m)": gone[:, :1], "up (m)": gone[:, 1:]},
    )
