"""Say no before the machine does: compare what a run needs with the memory there is."""

import math
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


def readable_bytes(size: int) -> str:
    """A size for a person: 404 MB, 1.2 TB, 10^120 bytes."""
    units = ("bytes", "kB", "MB", "GB", "TB", "PB")
    thousands = 0 if size < 1 else int(math.log10(size) / 3)
    if thousands >= len(units):
        return f"{readable_count(size)} bytes"
    return f"{size / 1000**thousands:.3g} {units[thousands]}"


def readable_count(number: int) -> str:
    """A count for a person, however large: 126,127 or 10^120."""
    if number < 10**12:
        return f"{number:,}"
    return f"10^{math.floor(math.log10(number))}"
