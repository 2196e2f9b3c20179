"""Labelled arrays as one npz file and one description, and back.

The arrays of all groups lie in the file as "group/variable", without pickle.  Equal data gives
equal bytes on any day: entries are sorted, carry no time, lie in C order and are not compressed
(the output of zlib differs between its versions).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ethogram.campaign import npz
from ethogram.campaign.npz import Malformed

Record = dict[str, xr.Dataset]  # groups: "results", and scenes for replays


@dataclass(frozen=True)
class Variable:
    """What is said of a variable beside its values."""

    dimensions: tuple[str, ...]
    attributes: dict[str, Any]
    coordinate: bool


@dataclass(frozen=True)
class Group:
    """What is said of a dataset beside its values."""

    attributes: dict[str, Any]
    variables: dict[str, Variable]


Layout = dict[str, Group]


class Unfitting(ValueError):
    """Arrays do not go with their description."""


def pack(record: Record) -> tuple[bytes, Layout]:
    """The bytes of all arrays of a record, and the layout that makes them labelled again."""
    arrays = {
        f"{group}/{name}": _storable(f"{group}/{name}", variable.values)
        for group, dataset in record.items()
        for name, variable in dataset.variables.items()
    }
    layout = {group: _described(dataset) for group, dataset in record.items()}
    return npz.write(arrays), layout


def unpack(data: bytes, layout: Layout) -> Record:
    """The record that `pack` was given.

    Raises:
        Unfitting: the bytes are no such file, or its arrays are not those of the layout.

    """
    names = [f"{group}/{name}" for group in layout for name in layout[group].variables]
    try:
        arrays = npz.read(data, names)
    except Malformed as error:
        raise Unfitting(str(error)) from error
    return {group: _labelled(group, description, arrays) for group, description in layout.items()}


def _storable(name: str, values: Any) -> NDArray[Any]:
    array = np.asarray(values, order="C")
    if array.dtype.kind in "OT" and all(isinstance(item, str) for item in array.flat):
        array = array.astype(str)  # pandas and NumPy have younger types of text, npz has one
    if array.dtype.kind not in npz.KINDS:
        raise TypeError(f"{name}: arrays of type {array.dtype} cannot be stored")
    return array


def _described(dataset: xr.Dataset) -> Group:
    variables = {
        str(name): Variable(
            dimensions=tuple(map(str, variable.dims)),
            attributes=_plain(variable.attrs),
            coordinate=name in dataset.coords,
        )
        for name, variable in dataset.variables.items()
    }
    return Group(attributes=_plain(dataset.attrs), variables=variables)


def _labelled(group: str, description: Group, arrays: Mapping[str, NDArray[Any]]) -> xr.Dataset:
    data: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    for name, variable in description.variables.items():
        kind = coordinates if variable.coordinate else data
        values, dimensions = arrays[f"{group}/{name}"], variable.dimensions
        if not len(set(dimensions)) == len(dimensions) == values.ndim:
            raise Unfitting(f"{group}/{name} has {values.ndim} axes, not {len(dimensions)}")
        kind[name] = (dimensions, values, variable.attributes)
    try:
        return xr.Dataset(data, coordinates, description.attributes)
    except Exception as error:  # xarray has no error of its own for what does not fit together
        raise Unfitting(f"{group!r} cannot be put together ({error})") from error


def _plain(value: Any) -> Any:
    """An attribute as JSON has it; what JSON lacks is refused when the manifest is written."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return value
