"""Native kernels: libraries compiled from `kernels/`, one of them chosen for the processor at hand.

A library `_native/KERNEL_VARIANT.so` holds the functions `ethogram_KERNEL_TYPE` of one kernel, as
XLA calls them; `hatch_build.py` makes it, for each instruction set.  Where none was built or can be
used, the physics runs on JAX.  The environment variable `ETHOGRAM_KERNEL` chooses: `auto` (the
fastest), `none` (JAX), or a variant by name, which then must be there.  Nothing is loaded before it
is asked for.
"""

import ctypes
import hashlib
import json
import os
import warnings
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Literal

from ethogram.core.errors import EthogramError, UnknownName
from ethogram.core.kernels import FLAGS, JAX

VARIABLE = "ETHOGRAM_KERNEL"
AUTO, NONE = "auto", "none"
Kernel = Literal["auto", "none", "x86-64-v4", "x86-64-v3", "x86-64", "portable"]  # a choice
FOLDER = Path(__file__).with_name("_native")
CHECKOUT = Path(__file__).parents[3]  # of the sources, where Ethogram is used in place
_CPUINFO = Path("/proc/cpuinfo")


@dataclass(frozen=True)
class Build:
    """What the installation has of kernels."""

    compiler: str = ""
    variants: tuple[str, ...] = ()
    why_none: str = "nothing was built for this copy of Ethogram."
    sources: dict[str, str] = field(default_factory=dict)  # sha256 by file

    @property
    def is_stale(self) -> bool:
        """Whether the sources lie beside and have changed since."""
        there = {name: CHECKOUT / name for name in self.sources if (CHECKOUT / name).is_file()}
        return any(
            hashlib.sha256(path.read_bytes()).hexdigest() != self.sources[name]
            for name, path in there.items()
        )


def variant(choice: str = AUTO) -> str | None:
    """The variant of the kernels that is in use; None where the physics runs on JAX.

    Args:
        choice: `auto` for what `ETHOGRAM_KERNEL` says or else the fastest, `none`, or a variant.

    Raises:
        UnknownName: there is no such choice.
        EthogramError: the variant is not built, or this processor or system cannot run it.

    """
    wanted = _wanted() if choice == AUTO else choice
    if wanted not in (AUTO, NONE, *FLAGS):
        raise UnknownName(f"kernel ({VARIABLE})", wanted, (AUTO, NONE, *FLAGS))
    if wanted == NONE:
        return None
    if wanted == AUTO:
        return _fastest(FOLDER)
    built = build()
    if wanted not in built.variants:
        has = f"built are {', '.join(built.variants)}" if built.variants else "none is built"
        raise EthogramError(f"The kernel {wanted!r} ({VARIABLE}) is not built: {has}.")
    missing = FLAGS[wanted] - processor_flags()
    if missing:
        raise EthogramError(
            f"The kernel {wanted!r} ({VARIABLE}) needs a processor with "
            f"{', '.join(sorted(missing))}; allowed here: {', '.join(usable(built))}."
        )
    if trouble := _trouble(FOLDER, wanted):
        raise EthogramError(f"The kernel {wanted!r} ({VARIABLE}) cannot be loaded: {trouble}.")
    return wanted


def target(symbol: str, choice: str = AUTO) -> str | None:
    """The name under which `jax.ffi.ffi_call` finds a function of a kernel on CPUs.

    Args:
        symbol: of the function: `ethogram_beams3d_f32`.
        choice: as of `variant`.

    Returns:
        The name; None where the physics runs on JAX.

    Raises:
        EthogramError: as `variant` does.

    """
    found = variant(choice)
    return None if found is None else _registered(FOLDER, symbol, found)


def implementation(kernel: str, choice: str = AUTO) -> str:
    """What does the work of a kernel in this process, for a record: a variant, or JAX.

    Args:
        kernel: its name.
        choice: as of `variant`.

    """
    import jax

    found = variant(choice) if jax.default_backend() == "cpu" else None
    return found if found and _library(FOLDER, kernel, found).is_file() else JAX


def build() -> Build:
    """What was built when Ethogram was installed."""
    return _build(FOLDER)


def is_turned_off() -> bool:
    """Whether the environment variable asks for JAX."""
    return _wanted() == NONE


def usable(built: Build) -> tuple[str, ...]:
    """The built variants that this processor runs, the fastest first."""
    flags = processor_flags()
    return tuple(name for name in FLAGS if name in built.variants and FLAGS[name] <= flags)


def processor_flags() -> frozenset[str]:
    """What the processor can do, as Linux names it; nothing elsewhere."""
    return _flags(_CPUINFO)


def _wanted() -> str:
    return os.environ.get(VARIABLE) or AUTO


@cache
def _fastest(folder: Path) -> str | None:
    """The fastest variant that the processor runs; None, with a warning, if it cannot be loaded."""
    found = next(iter(usable(_build(folder))), None)
    if found is not None and (trouble := _trouble(folder, found)):
        warnings.warn(
            f"The kernel {found!r} cannot be loaded ({trouble}); the physics runs on JAX, slower.",
            stacklevel=3,
        )
        return None
    return found


def _trouble(folder: Path, variant: str) -> str:
    """Why a library of a variant cannot be loaded, or nothing."""
    try:
        for library in folder.glob(f"*_{variant}.so"):
            _loaded(library)
    except OSError as error:
        return str(error)
    return ""


def _library(folder: Path, kernel: str, variant: str) -> Path:
    return folder / f"{kernel}_{variant}.so"


@cache
def _loaded(library: Path) -> ctypes.CDLL:
    return ctypes.CDLL(str(library))


@cache
def _registered(folder: Path, symbol: str, variant: str) -> str:
    """The name of a function in XLA, which is told of it the first time."""
    import jax

    kernel = symbol.split("_")[1]
    function = getattr(_loaded(_library(folder, kernel, variant)), symbol)
    name = f"{symbol}_{variant.replace('-', '_')}"
    capsule = jax.ffi.pycapsule(function)  # type: ignore[no-untyped-call]
    jax.ffi.register_ffi_target(name, capsule, platform="cpu")
    return name


@cache
def _build(folder: Path) -> Build:
    try:
        found = json.loads((folder / "build.json").read_text())
    except OSError:
        return Build()
    return Build(**found | {"variants": tuple(found["variants"])})


@cache
def _flags(cpuinfo: Path) -> frozenset[str]:
    try:
        lines = cpuinfo.read_text().splitlines()
    except OSError:
        return frozenset()
    words = (line.partition(":")[2].split() for line in lines if line.startswith("flags"))
    return frozenset(next(words, ()))
