"""A moving robot as a scene: every voxel a cube that turns, grows and shrinks."""

from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from ethogram.core.scene import Scene, Shape
from ethogram.physics.beams3d import State

FRAME_SECONDS = 0.05  # at normal speed: slow motion
CHANGED = 0.02  # of the edge at rest: from here on a voxel counts as contracted or expanded
PALETTE = ("contracted", "at rest", "expanded")
MILLIMETRES = 1000.0
MOST_STEPS = 200  # of an episode, that are shown after its start


class Pose(NamedTuple):
    """Where the voxels of robots are, how they are turned and how large they are to be."""

    position: Any  # Float "... 3 voxel *batch", m
    orientation: Any  # Float "... 4 voxel *batch", unit quaternions
    edge: Any  # Float "... voxel *batch", m


def pose(state: State) -> Pose:
    """What a scene needs of a state."""
    return Pose(state.position, state.orientation, state.edge)


def shown(before: State, reached: State) -> tuple[Pose, int]:
    """What is shown of an episode, and how many steps lie between two frames.

    The first frame is the start; a robot that breaks is shown as long as it is whole.

    Args:
        before: the states that were left, with the steps as leading axis.
        reached: those that were reached.

    """
    apart = -(-len(reached.steps) // MOST_STEPS)

    def some(start: Any, rest: Any) -> np.ndarray:
        return np.concatenate([start[:1], rest])[::apart]

    frames = jax.tree.map(some, pose(before), pose(reached))
    whole = ~some(before.broken, reached.broken)
    return jax.tree.map(lambda part: part[whole], frames), apart


def record(title: str, frames: Pose, *, resting: float, seconds: float) -> Scene:
    """Draw up a simulation.

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
