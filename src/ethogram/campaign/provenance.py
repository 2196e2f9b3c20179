"""Where numbers come from: the versions and the machine that a record carries.

They explain a difference between two machines; a digest leaves them out.
"""

import os
import platform
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, entry_points, version
from types import ModuleType
from typing import Any

_PACKAGES = ("ethogram", "equinox", "jax", "jaxlib", "numpy", "optax", "scipy", "xarray")


def versions() -> dict[str, str]:
    """Versions of Python, Ethogram and the packages that numbers depend on."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def machine() -> str:
    """The kind of machine, without its name."""
    return f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores"


def now() -> str:
    """Date and time to the second, in UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def module_of(study: Any) -> str:
    """The module that a study is, or in which it was made."""
    return study.__name__ if isinstance(study, ModuleType) else type(study).__module__


def package_of(study: Any) -> str:
    """The other package that a study comes from, with its version: "grazing 1.0"; "" for ours."""
    top = module_of(study).partition(".")[0]
    for entry in entry_points(group="ethogram.studies", name=study.NAME):
        if entry.dist is not None and entry.value.partition(".")[0].partition(":")[0] == top:
            return f"{entry.dist.name} {entry.dist.version}"
    return ""
