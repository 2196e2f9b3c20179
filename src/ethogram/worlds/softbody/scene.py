"""Scenes of soft robots: every voxel a cube that turns, grows and shrinks."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ethogram.core.scene import GRADED_COLOURS, Scene, Shape, Tint

FRAME_SECONDS = 0.05  # at normal speed: slow motion
CHANGED = 0.02  # of the edge at rest: from here on a voxel counts as contracted or expanded
PALETTE = tuple(map(Tint, ("contracted", "at rest", "expanded"), GRADED_COLOURS))
MILLIMETRES = 1000.0
MAX_STEPS = 200  # of an episode, that are shown after its start


class Pose(NamedTuple):
    """Positions, orientations and commanded edges of robots' voxels."""

    position: Any  # Float "... 3 voxel *batch", m
    orientation: Any  # Float "... 4 voxel *batch", unit quaternions
    edge: Any  # Float "... voxel *batch", m


def episode_frames(
    left: Pose, reached: Pose, diverged: Bool[np.ndarray, "frame"]
) -> tuple[Pose, int]:
    """The frames that show an episode, and how many steps lie between two of them.

    The first frame is the start; a robot is shown until its simulation diverges.

    Args:
        left: poses before each step, with the steps as leading axis.
        reached: those after it.
        diverged: whether the simulation has, at the start and after each step.

    """
    apart = -(-len(reached.position) // MAX_STEPS)
    kept = np.arange(len(diverged))[::apart]
    kept = kept[~diverged[kept]]
    start_and_rest = zip(left, reached, strict=True)
    return Pose(*(np.concatenate([one[:1], rest])[kept] for one, rest in start_and_rest)), apart


def scene_of_poses(title: str, frames: Pose, *, resting: float, seconds: float) -> Scene:
    """The scene of a simulation.

    Args:
        title: of the scene.
        frames: of one robot; arrays with the frames as leading axis.
        resting: the edge of a voxel at rest (m).
        seconds: of simulated time, between two frames.

    """
    position = np.asarray(frames.position).transpose(0, 2, 1)  # frame, voxel, axis
    scale = np.asarray(frames.edge) / resting
    centre = position.mean(1)
    gone = MILLIMETRES * (centre - centre[0])
    time = np.arange(len(position)) * seconds
    return Scene(
        title=title,
        bounds=_bounds(position, resting),
        frame_seconds=FRAME_SECONDS,
        palette=PALETTE,
        shapes=tuple(Shape("cube", resting / 2) for _ in range(position.shape[1])),
        position=position,
        scale=scale,
        orientation=np.asarray(frames.orientation).transpose(0, 2, 1),
        tint=1 + (scale > 1 + CHANGED) - (scale < 1 - CHANGED).astype(int),
        captions=tuple(
            f"{now:.3f} s: {way:.1f} mm" for now, way in zip(time, gone[:, 0], strict=True)
        ),
        series={"distance (mm)": gone[:, :1], "height (mm)": MILLIMETRES * centre[:, 2:]},
    )


def _bounds(
    position: Float[np.ndarray, "frame voxel 3"], edge: float
) -> tuple[float, float, float, float]:
    """What a view from the side shows: x and z, and the floor."""
    (left, _, bottom), (right, _, top) = position.min((0, 1)), position.max((0, 1))
    return (
        float(left) - edge,
        min(0.0, float(bottom) - edge),
        float(right) + edge,
        float(top) + edge,
    )
