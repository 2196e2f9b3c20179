"""Where numbers come from: the versions and the machine that a record carries.

They explain a difference between two machines; a digest leaves them out.
"""

import os
import platform
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

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
