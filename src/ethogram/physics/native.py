"""Native kernels: a library for each instruction set, in `_native`; the best is loaded."""

import ctypes
import os
from functools import cache
from pathlib import Path
from typing import Any

import jax

from ethogram.core.errors import UnknownName

LIBRARIES = Path(__file__).with_name("_native")
VARIANTS = ("x86-64-v4", "x86-64-v3", "x86-64", "portable")


def variant(choice: str = "auto") -> str | None:
    """The variant in use; None for JAX."""
    if choice == "auto":
        choice = os.environ.get("ETHOGRAM_KERNEL", "auto")
    if choice not in ("auto", "none", *VARIANTS):
        raise UnknownName("kernel", choice, ("auto", "none", *VARIANTS))
    if choice == "none":
        return None
    wanted = VARIANTS if choice == "auto" else (choice,)
    return next((v for v in wanted if (LIBRARIES / f"beams3d_{v}.so").exists()), None)


def target(symbol: str, choice: str = "auto") -> str | None:
    """The name of a registered function; None where there is no kernel."""
    found = variant(choice)
    return None if found is None else _registered(symbol, found)


@cache
def _registered(symbol: str, which: str) -> str:
    library = ctypes.CDLL(str(LIBRARIES / f"beams3d_{which}.so"))
    name = f"{symbol}_{which}"
    ffi: Any = jax.ffi
    ffi.register_ffi_target(name, ffi.pycapsule(getattr(library, symbol)), platform="cpu")
    return name
