"""Where a long case was when its process was last seen: at most one minute and one chunk ago."""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.numpy
from numpy.typing import NDArray

from ethogram.campaign import files
from ethogram.campaign.manifests import Damaged, sha256

Arrays = dict[str, NDArray[Any]]

_PLAIN: Mapping[str, str] = {}  # no native kernel
_NAME = re.compile(r"(?P<case>\w+)\.(?P<hash>[0-9a-f]{64})\.safetensors")


class Checkpoints:
    """The checkpoint of one case, whose lock the caller holds.

    The file's name carries the hash of its bytes, so that one step puts both in place.  The one
    before is removed after that: at any moment there is a whole one.  It says in which arithmetic
    it was computed (see `ethogram.core.kernels`); work in another does not go on from it.
    """

    def __init__(self, folder: Path, case_id: str) -> None:
        self._folder = folder
        self._case_id = case_id

    def save(
        self, arrays: Mapping[str, NDArray[Any]], arithmetic: Mapping[str, str] = _PLAIN
    ) -> None:
        """Replace the checkpoint."""
        whole = {name: np.asarray(array, order="C") for name, array in arrays.items()}
        data = safetensors.numpy.save(whole, dict(arithmetic))
        path = self._folder / f"{self._case_id}.{sha256(data)}.safetensors"
        earlier = [found for found in self._found() if found != path]
        files.write_whole(path, data)
        for found in earlier:
            files.remove(found)

    def restore(self, arithmetic: Mapping[str, str] = _PLAIN) -> tuple[Arrays | None, list[str]]:
        """The newest whole checkpoint, if any, and what was wrong with newer ones."""
        notes: list[str] = []
        for path in self._found():
            found = _content_of(path)
            if found is None:
                notes.append(f"{path} is damaged: the case goes back to before it.")
            elif found[1] != arithmetic:
                before, now = _shown(found[1]), _shown(arithmetic)
                notes.append(
                    f"{path} was computed by {before}, and this run is by {now}, which gives other "
                    "bits: the case goes back to before it."
                )
            else:
                return found[0], notes
        return None, notes

    def newest(self) -> Path | None:
        """The file of the last checkpoint, if any."""
        return next(iter(self._found()), None)

    def clear(self) -> None:
        """Remove the checkpoint: the record is in place."""
        for found in self._found():
            files.remove(found)

    def unusable(self) -> list[Damaged]:
        """What has the name of a checkpoint of this case and is no file."""
        return [Damaged(path, "it is no file") for path in self._named() if not files.is_file(path)]

    def _found(self) -> list[Path]:
        """The checkpoints, the newest first."""
        return sorted(filter(files.is_file, self._named()), key=files.changed, reverse=True)

    def _named(self) -> list[Path]:
        names = map(_NAME.fullmatch, files.names_in(self._folder))
        return [self._folder / name[0] for name in names if name and name["case"] == self._case_id]


def _content_of(path: Path) -> tuple[Arrays, dict[str, str]] | None:
    """The arrays of a checkpoint and its arithmetic, or None if it is damaged."""
    try:
        data = files.read(path) or b""
        if sha256(data) != path.name.split(".")[1]:
            return None
        header = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])
        return safetensors.numpy.load(data), header.get("__metadata__", {})
    except Exception:  # whatever is wrong with it, the case can do without
        return None


def _shown(arithmetic: Mapping[str, str]) -> str:
    """The arithmetic of a case, for a person."""
    kernels = (f"the kernel {name} ({kind})" for name, kind in sorted(arithmetic.items()))
    return " and ".join(kernels) or "JAX"
