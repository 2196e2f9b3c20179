"""npz files in the one form that Ethogram writes: plain zip, nothing compressed, no pickle.

A file that comes from elsewhere may claim anything, so no number in it is believed: members must
lie one behind the other and fill the file, and each array must have the size that its header says,
before anything is allocated for it.
"""

import io
import math
import re
import struct
import zipfile
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ethogram.campaign.files import LARGEST

KINDS = "biufcSUmM"  # of dtype that npz holds without pickle and without loss

_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time that a zip file can say
_MOST_MEMBERS = 2**16 - 2  # beyond these, and beyond 2 GiB, zip files have another form

# APPNOTE.TXT of PKWARE, 4.3.7, 4.3.12 and 4.3.16
_LOCAL = struct.Struct("<4s5H3L2H")
_ENTRY = struct.Struct("<4s6H3L5H2L")
_END = struct.Struct("<4s4H2LH")
_UTF8 = 0x800  # the only flag that we set: the name is in UTF-8

# the format of npy files, version 1.0; https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html
_MAGIC = b"\x93NUMPY\x01\x00"
_HEADER = re.compile(
    rb"\{'descr': '(?P<dtype>[<>|=][a-zA-Z]\d{1,9}(?:\[\d{0,9}[a-zA-Z]{1,2}\])?)', "
    rb"'fortran_order': False, 'shape': \((?P<shape>(?:\d{1,10},? ?)*)\), \} *\n"
)


class Malformed(ValueError):
    """The bytes are no npz file that Ethogram wrote."""


def write(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """The file that holds these arrays; the same for equal arrays, on any day."""
    if len(arrays) > _MOST_MEMBERS:
        raise ValueError(f"{len(arrays)} arrays; a record has {_MOST_MEMBERS} at most")
    size = sum(array.nbytes for array in arrays.values())
    if size > LARGEST - 2**24:  # the rest is for names and headers
        raise ValueError(f"arrays of {size} bytes; a record has 2 GiB at most")
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(arrays):
            entry = zipfile.ZipInfo(f"{name}.npy", _EPOCH)
            with archive.open(entry, "w", force_zip64=True) as file:
                np.lib.format.write_array(file, arrays[name], allow_pickle=False)
    return buffer.getvalue()


def read(data: bytes, names: Iterable[str]) -> dict[str, NDArray[Any]]:
    """The arrays of a file that holds those of these names and nothing else.

    Raises:
        Malformed: the bytes are anything but such a file.

    """
    try:
        members = _members(memoryview(data), sorted(names))
    except struct.error as error:
        raise Malformed("it is no npz file") from error
    return {name: _array(name, member) for name, member in members.items()}


def _members(data: memoryview, names: list[str]) -> dict[str, memoryview]:
    """The bytes of each member; the members and their directory fill the file."""
    signature, _, _, _, count, _, directory, comment = _END.unpack(data[-_END.size :])
    if signature != b"PK\5\6" or comment:
        raise Malformed("it is no npz file")
    if count != len(names):
        raise Malformed(f"it has {count} arrays instead of {len(names)}")
    first_entry = directory
    members = {}
    begin = 0  # of the next member
    for name in names:
        entry = _ENTRY.unpack(data[directory : directory + _ENTRY.size])
        file_name = f"{name}.npy".encode()
        if bytes(data[directory + _ENTRY.size :][: entry[10]]) != file_name:
            raise Malformed(f"it lacks the array {name!r}")
        flags, method, stored, whole = entry[3], entry[4], entry[8], entry[9]
        if entry[0] != b"PK\1\2" or flags & ~_UTF8 or method or stored != whole:
            raise Malformed(f"its array {name!r} is compressed, encrypted or cut")
        local = _LOCAL.unpack(data[begin : begin + _LOCAL.size])
        if local[0] != b"PK\3\4" or entry[16] != begin:
            raise Malformed("its arrays do not lie one behind the other")
        first = begin + _LOCAL.size + local[9] + local[10]
        begin = first + whole
        members[name] = data[first:begin]
        directory += _ENTRY.size + sum(entry[10:13])
    if begin != first_entry or directory != len(data) - _END.size:
        raise Malformed("its arrays do not fill it")
    return members


def _array(name: str, member: memoryview) -> NDArray[Any]:
    """The array in an npy file, of the size that its header says."""
    start = len(_MAGIC) + 2
    end = start + int.from_bytes(member[len(_MAGIC) : start], "little")
    header = _HEADER.fullmatch(bytes(member[start:end]))
    if bytes(member[: len(_MAGIC)]) != _MAGIC or header is None:
        raise Malformed(f"{name!r} is no array that could have been stored")
    shape = tuple(map(int, re.findall(rb"\d+", header["shape"])))
    try:
        dtype = np.dtype(header["dtype"].decode())
    except (TypeError, ValueError, OverflowError) as error:
        raise Malformed(f"{name!r} is of no type that could have been stored") from error
    if dtype.kind not in KINDS or not dtype.itemsize:
        raise Malformed(f"{name!r} is of type {dtype}, which cannot be stored")
    if math.prod(shape) * dtype.itemsize != len(member) - end:
        raise Malformed(f"{name!r} has {len(member) - end} bytes, not those of {shape} {dtype}")
    try:
        array = np.frombuffer(member[end:], dtype).reshape(shape).copy()
    except (ValueError, OverflowError) as error:  # more axes than there are, an axis without end
        raise Malformed(f"{name!r} cannot have the shape {shape}") from error
    if dtype.kind == "U" and not _is_text(array):
        raise Malformed(f"{name!r} holds what is no text")
    return array


def _is_text(array: NDArray[Any]) -> bool:
    """Whether all characters are such, and no halves of one."""
    codes = array.reshape(-1).view(array.dtype.byteorder + "u4")
    return not ((codes > 0x10FFFF) | ((codes >= 0xD800) & (codes < 0xE000))).any()
