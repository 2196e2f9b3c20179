"""Say no before the machine does: compare what a run needs with the memory there is."""

import os
from pathlib import Path

from ethogram.core.errors import TooLarge


def available_memory() -> int:
    """Bytes that a new allocation can count on."""
    info = Path("/proc/meminfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def require_memory(what: str, size: int) -> None:
    """Raise `TooLarge` naming the size needed when `size` bytes are not to be had."""
    available = available_memory()
    if size > available:
        raise TooLarge(
            f"{what} needs {readable_bytes(size)} of memory; {readable_bytes(available)} are free."
        )


def readable_bytes(size: float) -> str:
    """A size for a person: 404 MB, 1.2 TB."""
    for unit in ("bytes", "kB", "MB", "GB", "TB", "PB"):
        if size < 1000 or unit == "PB":
            break
        size /= 1000
    return f"{size:.3g} {unit}" if size < 1000 else f"{size:.3e} {unit}"
