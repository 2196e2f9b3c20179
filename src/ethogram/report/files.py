"""The report's files: each is put in place whole, and only what a report wrote is ever removed."""

import contextlib
import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated

from pydantic import Field, TypeAdapter

from ethogram.campaign.files import (
    Unreadable,
    is_file,
    is_there,
    read,
    refuse_link,
    require_folder,
    write_whole,
)
from ethogram.campaign.untrusted import MOST_BYTES, Hash, parsed
from ethogram.core.errors import EthogramError

MARK = '<meta name="generator" content="Ethogram">'  # tells our pages from a user's own
LISTING = "report/files.json"  # path -> sha256 of all that the last report wrote

_HEAD = 2**16  # bytes of a page, among which the mark is
_OURS = r"^(index\.html|report/([a-z0-9_-]+/)?[a-z0-9_-]+\.[a-z0-9]+)$"  # no way out of the folder
_Listing = TypeAdapter(dict[Annotated[str, Field(pattern=_OURS)], Hash])


def publish(folder: Path, files: Mapping[str, str]) -> None:
    """Put `files` (relative path -> text) into `folder` and remove those of earlier reports.

    The listing names what is about to be written before anything is, so that a report cut short
    leaves nothing that the next one would not know as its own.
    """
    contents = {path: text.encode(errors="replace") for path, text in files.items()}
    hashes = {path: hashlib.sha256(content).hexdigest() for path, content in contents.items()}
    require_folder(folder)
    try:
        _refuse_links(folder, [*files, LISTING])
        known = _listed(folder)
        for path in files.keys() - known.keys():
            if path.endswith(".html"):
                _refuse_to_replace_foreign(folder / path)
        _write(folder / LISTING, _json(known | hashes))
        for path, content in contents.items():
            _write(folder / path, content)
        for path in known.keys() - hashes.keys():
            _remove(folder, path, known[path])
        _write(folder / LISTING, _json(hashes))
    except OSError as error:
        reason = error.strerror or str(error)
        raise EthogramError(f"Cannot write the report to {str(folder)!r}: {reason}.") from error


def publish_one(file: Path, text: str) -> None:
    """Put a page of its own in place, whole; one that is not ours is left alone."""
    try:
        _refuse_to_replace_foreign(file)
        _write(file, text.encode(errors="replace"))
    except OSError as error:
        reason = error.strerror or str(error)
        raise EthogramError(f"Cannot write {str(file)!r}: {reason}.") from error


def _listed(folder: Path) -> dict[str, str]:
    """What the last report wrote; a damaged listing says nothing."""
    try:
        data = read(folder / LISTING, most=MOST_BYTES)
        return {} if data is None else _Listing.validate_python(parsed(data), strict=True)
    except (Unreadable, ValueError):
        return {}


def _refuse_links(folder: Path, paths: Iterable[str]) -> None:
    """Refuse to write into another folder than that of the report, to which a link might lead."""
    for below in {parent for path in paths for parent in Path(path).parents}:
        if below != Path():
            refuse_link(folder / below)


def _refuse_to_replace_foreign(page: Path) -> None:
    if is_there(page) and not _is_ours(page):
        raise EthogramError(
            f"{str(page)!r} is there and is no page of Ethogram's: move it, or choose another "
            "place for ours."
        )


def _is_ours(page: Path) -> bool:
    try:
        return MARK.encode() in (read(page, first=_HEAD) or b"")
    except Unreadable:
        return False


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, content)


def _remove(folder: Path, path: str, sha256: str) -> None:
    """Remove what is still as a report wrote it, and its folder when that was the last in it."""
    file = folder / path
    _refuse_links(folder, [path])
    if is_file(file) and hashlib.sha256(read(file) or b"").hexdigest() == sha256:
        file.unlink()
        with contextlib.suppress(OSError):
            file.parent.rmdir()


def _json(entries: Mapping[str, str]) -> bytes:
    return json.dumps(entries, indent=1, sort_keys=True).encode()
