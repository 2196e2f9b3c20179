"""Say no before the machine does: compare what a run needs with the memory and cores there are.

A container or a batch job may have less than its machine: its control group, or one above it, says
so in `/sys/fs/cgroup` (man 7 cgroups).
"""

import math
import os
from collections.abc import Iterator
from pathlib import Path

from ethogram.core.errors import TooLarge

_ROOT = Path("/")


def available_memory(root: Path = _ROOT) -> int:
    """Bytes that a new allocation can count on."""
    groups = [
        limit - used
        for folder in _groups(root, "memory")
        for limit, used in [_memory_of(folder)]
        if limit is not None
    ]
    return max(0, min([_machine_memory(root), *groups]))


def available_cores(root: Path = _ROOT) -> int:
    """Processors that this process may use; a part of one counts as one."""
    affinity = getattr(os, "sched_getaffinity", None)
    allowed = len(affinity(0)) if affinity else os.cpu_count() or 1
    shares = [math.ceil(share) for folder in _groups(root, "cpu") if (share := _cores_of(folder))]
    return max(1, min([allowed, *shares]))


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


def _machine_memory(root: Path) -> int:
    for line in _text(root / "proc/meminfo").splitlines():
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) * 1024
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def _groups(root: Path, controller: str) -> Iterator[Path]:
    """The folders of this process' control group and of all above it, in both versions.

    A container may see its own group as the top, under the name that it has outside: folders that
    are not there are passed over.
    """
    mounts = root / "sys/fs/cgroup"
    for line in _text(root / "proc/self/cgroup").splitlines():
        number, controllers, path = line.split(":", 2)
        if number != "0" and controller not in controllers.split(","):
            continue
        for mount in (mounts / "unified", mounts) if number == "0" else (mounts / controller,):
            place = mount / path.strip("/")
            yield from (above for above in (place, *place.parents) if above.is_relative_to(mount))


def _memory_of(group: Path) -> tuple[int | None, int]:
    """The limit of a control group, if any, and the bytes in use that cannot be freed at once."""
    for limit, used, cache in (
        ("memory.max", "memory.current", "inactive_file"),
        ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
    ):
        most, now = _numbers(group / limit), _numbers(group / used)
        if most and now:
            fields = (line.partition(" ") for line in _text(group / "memory.stat").splitlines())
            freed = {name: value for name, _, value in fields}.get(cache, "0")
            return int(most[0]), int(now[0]) - int(freed)
    return None, 0


def _cores_of(group: Path) -> float | None:
    """The share of processors that a control group may use, if that is limited."""
    limit = _numbers(group / "cpu.max")
    if not limit:
        limit = _numbers(group / "cpu.cfs_quota_us") + _numbers(group / "cpu.cfs_period_us")
    quota, period = limit if len(limit) == 2 else (0, 0)
    return quota / period if quota > 0 and period > 0 else None


def _numbers(file: Path) -> list[int]:
    """The whole numbers in a file: none where it is missing or its first word is "max"."""
    words = _text(file).split()
    return [] if words[:1] == ["max"] else [int(word) for word in words]


def _text(file: Path) -> str:
    try:
        return file.read_text()
    except OSError:
        return ""
