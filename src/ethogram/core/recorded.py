"""Which scenes a record holds, and under which names."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from ethogram.core.scene import Scene

if TYPE_CHECKING:  # slow to load
    import xarray as xr

GROUP = "scene"  # of a record
RECORDED = 3  # trials of a case whose scenes are kept, the first ones


def grouped(scenes: Sequence[Scene]) -> "dict[str, xr.Dataset]":
    """Scenes of a case's first trials as groups of its record: scene, scene-2, scene-3, ..."""
    return {
        GROUP if trial == 1 else f"{GROUP}-{trial}": scene.to_dataset()
        for trial, scene in enumerate(scenes, start=1)
    }


def groups_by_trial(groups: Iterable[str]) -> dict[int, str]:
    """Those groups of a record that hold scenes, by the number of the trial."""
    found = {}
    for name in groups:
        stem, _, trial = name.partition("-")
        if stem == GROUP and (trial.isdecimal() or not trial):
            found[int(trial or 1)] = name
    return dict(sorted(found.items()))
