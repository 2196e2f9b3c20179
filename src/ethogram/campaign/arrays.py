"""Labelled arrays as one npz file and one description, and back.

The arrays of all groups lie in the file as "group/variable", without pickle.  Equal data gives
equal bytes on any day: entries are sorted, carry no time, lie in C order and are not compressed
(the output of zlib differs between its versions).
"""

import io
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time that a zip file can say
_STORABLE = "biufcSUmM"  # kinds of dtype that npz holds without pickle and without loss

Record = dict[str, xr.Dataset]  # groups: "results", and scenes for replays
Layout = dict[str, Any]  # per group: its attributes; per variable: dimensions, attributes, role


def pack(record: Record) -> tuple[bytes, Layout]:
    """The bytes of all arrays of a record, and the layout that makes them labelled again."""
    arrays = {
        f"{group}/{name}": _storable(f"{group}/{name}", variable.values)
        for group, dataset in record.items()
        for name, variable in dataset.variables.items()
    }
    layout = {group: _described(dataset) for group, dataset in record.items()}
    return _npz(arrays), layout


def unpack(data: bytes, layout: Layout) -> Record:
    """The record that `pack` was given."""
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        return {
            group: _labelled(group, description, arrays) for group, description in layout.items()
        }


def _npz(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(arrays):
            entry = zipfile.ZipInfo(f"{name}.npy", _EPOCH)
            with archive.open(entry, "w", force_zip64=True) as file:
                np.lib.format.write_array(file, arrays[name], allow_pickle=False)
    return buffer.getvalue()


def _storable(name: str, values: Any) -> NDArray[Any]:
    array = np.asarray(values, order="C")
    if array.dtype.kind in "OT" and all(isinstance(item, str) for item in array.flat):
        array = array.astype(str)  # pandas and NumPy have younger types of text, npz has one
    if array.dtype.kind not in _STORABLE:
        raise TypeError(f"{name}: arrays of type {array.dtype} cannot be stored")
    return array


def _described(dataset: xr.Dataset) -> Layout:
    return {
        "attributes": _plain(dataset.attrs),
        "variables": {
            str(name): {
                "dimensions": list(variable.dims),
                "attributes": _plain(variable.attrs),
                "coordinate": name in dataset.coords,
            }
            for name, variable in dataset.variables.items()
        },
    }


def _labelled(group: str, description: Layout, arrays: Mapping[str, NDArray[Any]]) -> xr.Dataset:
    data: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    for name, variable in description["variables"].items():
        kind = coordinates if variable["coordinate"] else data
        values = arrays[f"{group}/{name}"]
        kind[name] = (variable["dimensions"], values, variable["attributes"])
    return xr.Dataset(data, coordinates, description["attributes"])


def _plain(value: Any) -> Any:
    """An attribute as JSON has it; what JSON lacks is refused when the manifest is written."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return value
