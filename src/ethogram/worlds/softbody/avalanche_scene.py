"""Scenes of avalanches: a pulse in one voxel of a body, and the voxels that it spreads to."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Int

from ethogram.core.scene import COLOURS, Scene, Shape, Tint
from ethogram.physics.lattice2d import Lattice, Material, at_rest, lattice, simulate
from ethogram.physics.lattice2d.avalanche import pulse
from ethogram.worlds.softbody.criticality import avalanches_of, threshold
from ethogram.worlds.softbody.scene2d import Outline, outline, polygons

FRAME_SECONDS = 0.15  # at normal speed: slow motion
LONGER = 3  # frames after the end of an avalanche
SHOWN = 4  # avalanches of a body
PALETTE = (
    Tint("at rest", COLOURS["silver"]),
    Tint("has been active", COLOURS["blue"]),
    Tint("active", COLOURS["vermilion"]),
    Tint("driven", COLOURS["ochre"]),
)
REST, BEEN, ACTIVE, DRIVEN = range(4)


def avalanche_scene(cells: Int[np.ndarray, "voxel 2"], title: str) -> Scene:
    """Some avalanches of a body, from the smallest to the largest, a chapter for each.

    Args:
        cells: of the body.
        title: of the scene.

    """
    ((size, duration),) = avalanches_of([cells])
    order = np.argsort(size, kind="stable")
    places = np.linspace(0, len(order) - 1, min(SHOWN, len(order))).round().astype(int)
    drives = order[places]
    steps = int(duration[drives].max()) + 1 + LONGER
    found = jax.tree.map(np.asarray, _recorded(lattice(cells), jnp.asarray(drives), steps))
    parts = [
        _chapter(found, place, int(drive), int(duration[drive]), threshold(len(cells)))
        for place, drive in enumerate(drives)
    ]
    frames: dict[str, Any] = {
        name: np.concatenate([part[name] for part in parts])
        for name in ("corner", "tint", "size", "duration", "chapter", "fresh", "caption")
    }
    middle = frames["corner"].mean(2)  # frame, voxel, axis
    low, high = frames["corner"].min((0, 1, 2)) - 1.5, frames["corner"].max((0, 1, 2)) + 1.5
    return Scene(
        title=title,
        bounds=(float(low[0]), float(low[1]), float(high[0]), float(high[1])),
        frame_seconds=FRAME_SECONDS,
        palette=PALETTE,
        shapes=tuple(Shape("polygon", 1.0) for _ in cells),
        position=middle,
        tint=frames["tint"],
        vertices=frames["corner"] - middle[:, :, None],
        fresh=np.repeat(frames["fresh"][:, None], len(cells), 1),
        captions=tuple(frames["caption"].tolist()),
        chapters=tuple(frames["chapter"].tolist()),
        series={
            "size so far": frames["size"][:, None].astype(float),
            "duration so far": frames["duration"][:, None].astype(float),
        },
    )


@eqx.filter_jit
def _recorded(lattice: Lattice, drives: Int[Array, "drive"], steps: int) -> Outline:
    """Voxels of a body that each drive moves, after each step."""
    material = Material.soft()
    state = at_rest(lattice, drives.shape, terrain=False)
    driven = jax.nn.one_hot(drives, lattice.voxels, axis=0, dtype=state.moved.dtype)

    def advance(state: Any, step: Int[Array, ""]) -> tuple[Any, Outline]:
        state = simulate(lattice, material, state, (pulse(step) * driven)[None], gravity=0.0)
        return state, outline(lattice, material, state)

    return lax.scan(advance, state, jnp.arange(steps))[1]


def _chapter(
    found: Outline, place: int, drive: int, duration: int, tau: float
) -> dict[str, np.ndarray]:
    """The frames of one avalanche."""
    steps = duration + 1 + LONGER
    area = found.area[:steps, :, place]
    active = np.abs(np.diff(area, axis=0, prepend=1.0)) > tau
    active[0] = False
    active[duration + 1 :] = False
    ever = np.logical_or.accumulate(active)
    tint = np.where(active, ACTIVE, np.where(ever, BEEN, REST))
    tint[0, drive] = DRIVEN
    size = ever.sum(1)
    lasted = active.any(1).cumsum()
    corner = polygons(found.corner[:steps, ..., place])
    captions = [
        f"step {step}: {now} voxels, {so_far} steps"
        for step, (now, so_far) in enumerate(zip(size, lasted, strict=True), start=1)
    ]
    return {
        "corner": corner,
        "tint": tint,
        "size": size,
        "duration": lasted,
        "fresh": np.arange(steps) == 0,
        "caption": np.array(captions),
        "chapter": np.array([f"voxel {drive + 1} driven"] * steps),
    }
