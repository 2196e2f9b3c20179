"""Where a long case was when its process was last seen: at most one minute and one chunk ago."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.numpy
from numpy.typing import NDArray

from ethogram.campaign import files
from ethogram.campaign.sealed import sha256

Arrays = dict[str, NDArray[Any]]


class Checkpoints:
    """The checkpoint of one case, whose lock the caller holds.

    The file's name carries the hash of its bytes, so that one step puts both in place.  The one
    before is removed after that: at any moment there is a whole one.
    """

    def __init__(self, folder: Path, case_id: str) -> None:
        self._folder = folder
        self._case_id = case_id

    def save(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Replace the checkpoint."""
        whole = {name: np.asarray(array, order="C") for name, array in arrays.items()}
        data = safetensors.numpy.save(whole)
        path = self._folder / f"{self._case_id}.{sha256(data)}.safetensors"
        earlier = [found for found in self._found() if found != path]
        files.write_whole(path, data, owner=self._case_id)
        for found in earlier:
            files.remove(found)

    def restore(self) -> tuple[Arrays | None, list[str]]:
        """The newest whole checkpoint, if any, and what was wrong with newer ones."""
        notes: list[str] = []
        for path in self._found():
            data = files.read(path) or b""
            if sha256(data) == path.name.split(".")[1]:
                return safetensors.numpy.load(data), notes
            notes.append(f"{path} is damaged: the case goes back to before it.")
        return None, notes

    def newest(self) -> Path | None:
        """The file of the last checkpoint, if any."""
        return next(iter(self._found()), None)

    def clear(self) -> None:
        """Remove the checkpoint: the record is in place."""
        for found in self._found():
            files.remove(found)

    def _found(self) -> list[Path]:
        found = self._folder.glob(f"{self._case_id}.*.safetensors")
        return sorted(found, key=lambda path: path.stat().st_mtime_ns, reverse=True)
