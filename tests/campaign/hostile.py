"""What somebody else may have put in the place of a file of results, hashes and seals made right.

Each content is a function that takes the file and puts itself in its place.
"""

import hashlib
import io
import json
import os
import re
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ethogram.campaign.settings_json import canonical

Content = Callable[[Path], None]
NEST = 900  # levels: few enough for Python, too many for whatever walks a tree


def placed(make: Callable[[Path], None]) -> Content:
    """A content that is no file: made where the file was."""

    def put(path: Path) -> None:
        path.unlink()
        make(path)

    return put


def raw(data: bytes) -> Content:
    """A file with these bytes."""
    return lambda path: _write(path, data)


def sparse(path: Path) -> None:
    """A file of a terabyte, which takes no room on the disk."""
    os.truncate(path, 2**40)


def _write(path: Path, data: bytes) -> None:
    path.write_bytes(data)


def _folder_with_a_file(path: Path) -> None:
    path.mkdir()
    (path / "inside").write_text("mine")


def anything(outside: Path) -> dict[str, Content]:
    """Contents for the place of any file; `outside` is a folder that nothing may touch."""
    victim = outside / "victim"
    return {
        "nothing": lambda path: path.unlink(),
        "an empty file": raw(b""),
        "zeros": raw(bytes(1000)),
        "a word": raw(b"nonsense"),
        "a bracket, 100000 times": raw(b"[" * 100_000),
        "an object in an object, 100000 times": raw(b'{"a":' * 100_000),
        "JSON of another kind": raw(b"[1, 2, 3]\n"),
        "10 MB of text": raw(b'"' + b"x" * 10_000_000 + b'"'),
        "a terabyte of zeros": sparse,
        "a folder": placed(Path.mkdir),
        "a folder with a file": placed(_folder_with_a_file),
        "a pipe": placed(os.mkfifo),
        "a link that leads nowhere": placed(lambda path: path.symlink_to(outside / "nothing")),
        "a link to a file outside": placed(lambda path: path.symlink_to(victim)),
        "a link to a folder outside": placed(lambda path: path.symlink_to(outside)),
        "a link to itself": placed(lambda path: path.symlink_to(path)),
        "a link to zeros without end": placed(lambda path: path.symlink_to("/dev/zero")),
    }


# -- under a right seal ---------------------------------------------------------------------------


def sealed(body: bytes) -> bytes:
    """A JSON object in canonical form with its seal, as the store has it."""
    seal = hashlib.sha256(body).hexdigest().encode()
    return re.sub(rb"\}\Z", b"", body) + b',"seal":"' + seal + b'"}\n'


def resealed(change: Callable[[dict[str, Any]], Any]) -> Content:
    """A content that is made from what was there and has a seal that fits."""

    def put(path: Path) -> None:
        body = json.loads(path.read_bytes())
        del body["seal"]
        change(body)
        _write(path, sealed(canonical(body)))

    return put


def spelled(old: bytes, new: bytes) -> Content:
    """As `resealed`, for what no value stands for: with other bytes in the sealed text."""

    def put(path: Path) -> None:
        body = json.loads(path.read_bytes())
        del body["seal"]
        _write(path, sealed(re.sub(old, new, canonical(body), count=1)))

    return put


def field(name: str, value: Any) -> Content:
    """As `resealed`, with another value of one field."""
    return resealed(lambda body: body["content"].update({name: value}))


def without(name: str) -> Content:
    """As `resealed`, without a field."""
    return resealed(lambda body: body["content"].pop(name))


def nested(levels: int) -> Any:
    """Lists in each other."""
    value: Any = 0
    for _ in range(levels):
        value = [value]
    return value


def named(outside: Path) -> dict[str, Any]:
    """Values that are in no place what is asked for there."""
    return {
        "null": None,
        "a list": [1],
        "an object": {"a": 1},
        "a number without end": 10**400,
        "half a character": "\ud800",
        "a line end and an escape": "a\n\x1b[2J",
        "a path up": f"../../../{outside.name}/victim",
        "a path": str(outside / "victim"),
        "a NUL": "a\0b",
        "a thousand levels": nested(NEST),
    }


SEALED: dict[str, Content] = {
    "no content": resealed(lambda body: body.pop("content")),
    "no format": resealed(lambda body: body.pop("format")),
    "a format that is a word": resealed(lambda body: body.update(format="1")),
    "a format before the first": resealed(lambda body: body.update(format=-1)),
    "a content that is a list": resealed(lambda body: body.update(content=[])),
    "an endless number of seconds": spelled(rb'"seconds":[^,]*', b'"seconds":1e999'),
    "no number of seconds": spelled(rb'"seconds":[^,]*', b'"seconds":NaN'),
    "a start that is a number": field("started", 1),
    "settings 900 deep": resealed(
        lambda body: (
            body["content"].get("case", body["content"]).update(settings={"seed": nested(NEST)})
        )
    ),
}


def manifests(outside: Path) -> dict[str, Content]:
    """Contents for the place of a manifest."""
    paths = {f"arrays: {name}": field("arrays", value) for name, value in named(outside).items()}

    def layout(change: Callable[[dict[str, Any]], Any]) -> Content:
        return resealed(lambda body: change(body["content"]["layout"]))

    return {
        **SEALED,
        **paths,
        "no arrays": without("arrays"),
        "a hash with a line end": resealed(
            lambda body: body["content"].update(arrays=body["content"]["arrays"] + "\n")
        ),
        "arrays that are not there": field("arrays", "0" * 64),
        "another case": resealed(lambda body: body["content"]["case"].update(name="z")),
        "another study": resealed(lambda body: body["content"]["case"].update(study="sharing")),
        "a layout with an array too many": layout(
            lambda groups: groups["results"]["variables"].update(
                extra={"attributes": {}, "coordinate": False, "dimensions": []}
            )
        ),
        "a layout with an array too few": layout(
            lambda groups: groups["results"]["variables"].pop("place")
        ),
        "an axis too many": layout(
            lambda groups: groups["results"]["variables"]["end"].update(dimensions=["step"])
        ),
        "an axis of another length": layout(
            lambda groups: groups["scene-1"].update(variables=groups["results"]["variables"])
        ),
        "a layout without variables": layout(lambda groups: groups["results"].pop("variables")),
    }


def plans(outside: Path) -> dict[str, Content]:
    """Contents for the place of plan.json."""

    def cases(change: Callable[[list[Any]], Any]) -> Content:
        return resealed(lambda body: change(body["content"]["cases"]))

    def swapped(found: list[Any]) -> None:
        found[0][0], found[1][0] = found[1][0], found[0][0]

    return {
        **SEALED,
        **{
            f"a case's name: {name}": cases(
                lambda found, value=value: found.__setitem__(0, ["a", value])
            )
            for name, value in named(outside).items()
        },
        "another study": field("study", "sharing"),
        "cases under each other's names": cases(swapped),
        "a case twice": cases(lambda found: found.append(found[0])),
        "no cases": field("cases", []),
        "trials that are lists": field("grid", {"trials": [[1], [2]]}),
        "a setting with 10000 dots": field("grid", {"a." * 10_000: [1]}),
        "a command that is a number": field("command", 1),
    }


# -- under a right hash ---------------------------------------------------------------------------


def hashed(change: Callable[[bytes], bytes]) -> Content:
    """Other arrays, under the name that their bytes have, and a manifest that names them."""

    def put(path: Path) -> None:
        data = change(path.read_bytes())
        name = hashlib.sha256(data).hexdigest()
        for manifest in path.parents[1].glob("manifests/*.json"):
            if path.stem in manifest.read_text():
                field("arrays", name)(manifest)
        path.unlink()
        _write(path.with_name(f"{name}.npz"), data)

    return put


def _members(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def zipped(members: Mapping[str, bytes], method: int = zipfile.ZIP_STORED) -> bytes:
    """A zip file with these members."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name in sorted(members):
            archive.writestr(name, members[name])
    return buffer.getvalue()


def _with(name: str, change: Callable[[bytes], bytes]) -> Content:
    """Arrays of which one is changed."""

    def changed(data: bytes) -> bytes:
        members = _members(data)
        return zipped({**members, name: change(members[name])})

    return hashed(changed)


def npy(array: Any) -> bytes:
    """An array as an npy file, with pickle where it needs that."""
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=True)
    return buffer.getvalue()


def headed(header: str, data: bytes = b"") -> bytes:
    """An npy file with any header."""
    text = f"{header}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data


def claiming(descr: str, shape: str) -> str:
    """A header of an npy file."""
    return f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}"


END = "results/end.npy"

ARRAYS: dict[str, Content] = {
    "arrays: no zip": hashed(lambda _: b"PK\3\4 nonsense"),
    "arrays: nothing": hashed(lambda _: b""),
    "arrays: an empty zip": hashed(lambda _: zipped({})),
    "arrays: an npy": hashed(lambda _: npy(np.ones(3))),
    "arrays: compressed": hashed(lambda data: zipped(_members(data), zipfile.ZIP_DEFLATED)),
    "arrays: a bomb": hashed(
        lambda data: zipped(
            {**_members(data), END: headed(claiming("'|u1'", "(1000000,)"), bytes(1_000_000))},
            zipfile.ZIP_DEFLATED,
        )
    ),
    "arrays: cut": hashed(lambda data: data[: len(data) // 2]),
    "arrays: with bytes behind them": hashed(lambda data: data + b"more"),
    "arrays: with bytes before them": hashed(lambda data: b"more" + data),
    "arrays: one lacking": hashed(
        lambda data: zipped({k: v for k, v in _members(data).items() if k != END})
    ),
    "arrays: one too many": hashed(lambda data: zipped({**_members(data), "more": b""})),
    "arrays: of objects": _with(END, lambda _: npy(np.array([{}], dtype=object))),
    "arrays: no npy": _with(END, lambda _: b"nonsense"),
    "arrays: of 10^12 numbers": _with(END, lambda _: headed(claiming("'<f8'", f"({10**12},)"))),
    "arrays: of 10^21 numbers": _with(END, lambda _: headed(claiming("'<f8'", f"({10**21},)"))),
    "arrays: of nothing, endless": _with(
        END, lambda _: headed(claiming("'<f8'", "(9999999999, 0)"))
    ),
    "arrays: of 40 axes": _with(
        END, lambda _: headed(claiming("'<f8'", "(1, " * 40 + ")"), bytes(8))
    ),
    "arrays: of 80 axes": _with(
        END, lambda _: headed(claiming("'<f8'", f"({'1, ' * 80})"), bytes(8))
    ),
    "arrays: a header in brackets": _with(END, lambda _: headed("(" * 5000)),
    "arrays: a header that computes": _with(END, lambda _: headed("9**9**9")),
    "arrays: of an unknown type": _with(END, lambda _: headed(claiming("'<f3'", "()"), bytes(3))),
    "arrays: of endless words": _with(END, lambda _: headed(claiming("'<U999999999'", "()"))),
    "arrays: of what is no text": _with(
        END, lambda _: headed(claiming("'<U1'", "()"), b"\xff\xff\xff\x7f")
    ),
    "arrays: of another shape": _with("results/place.npy", lambda _: npy(np.ones(7))),
}
