"""What Ethogram finds on this machine: versions, devices, memory, kernels and optional packages."""

import platform
from dataclasses import dataclass
from importlib.util import find_spec

from ethogram import __version__
from ethogram.core.memory import available_cores, available_memory, readable_bytes
from ethogram.physics import native

_EXTRAS = {"analysis": "sklearn", "video": "imageio_ffmpeg"}  # and a module of each
_REBUILD = (
    "`make kernels` in a checkout, `pip install --force-reinstall --no-deps .` in any other folder "
    "of the sources"
)


@dataclass(frozen=True)
class Kernels:
    """The native kernels of this installation."""

    in_use: str | None  # a variant; None where the physics runs on JAX
    why_none: str | None
    usable: tuple[str, ...]  # the built variants that the processor runs, the fastest first
    built: tuple[str, ...]
    compiler: str
    stale: bool  # older than their sources, in a checkout


@dataclass(frozen=True)
class Diagnosis:
    """All that a report of a problem should say."""

    ethogram: str
    python: str
    system: str
    jax: str
    devices: tuple[str, ...]
    cores: int
    memory: int  # bytes that are free
    kernels: Kernels
    extras: dict[str, bool]


def diagnosis() -> Diagnosis:
    """What there is.

    Raises:
        EthogramError: `ETHOGRAM_KERNEL` asks for what there is not.

    """
    import jax

    return Diagnosis(
        ethogram=__version__,
        python=platform.python_version(),
        system=f"{platform.system()} {platform.machine()}",
        jax=jax.__version__,
        devices=tuple(f"{device.platform}: {device.device_kind}" for device in jax.devices()),
        cores=available_cores(),
        memory=available_memory(),
        kernels=_kernels(jax.default_backend()),
        extras={extra: find_spec(module) is not None for extra, module in _EXTRAS.items()},
    )


def lines(found: Diagnosis) -> list[str]:
    """A diagnosis as text."""
    kernels = found.kernels
    extras = [
        f"{name} {'yes' if there else f'no (pip install ethogram[{name}])'}"
        for name, there in found.extras.items()
    ]
    text = [
        f"Ethogram   {found.ethogram}, Python {found.python}, {found.system}",
        f"JAX        {found.jax}; {', '.join(found.devices)}",
        f"machine    {_count(found.cores, 'core')}, {readable_bytes(found.memory)} of memory free",
        f"kernels    {kernels.in_use or f'none, JAX does the work: {kernels.why_none}'}",
    ]
    if kernels.built:
        text.append(f"           built: {', '.join(kernels.built)}, by {kernels.compiler}")
    if kernels.stale:
        text.append(f"           they are older than their sources; to build them anew: {_REBUILD}")
    return [*text, f"extras     {', '.join(extras)}"]


def _kernels(backend: str) -> Kernels:
    built = native.build()
    in_use = native.variant() if backend == "cpu" else None
    return Kernels(
        in_use=in_use,
        why_none=None if in_use else _why_none(built, backend),
        usable=native.usable(built),
        built=built.variants,
        compiler=built.compiler,
        stale=built.is_stale,
    )


def _why_none(built: native.Build, backend: str) -> str:
    """Why JAX does the work of the kernels, and what to do about it."""
    if backend != "cpu":
        return f"kernels are for the CPU, and JAX computes on {backend}."
    if native.is_turned_off():
        return f"{native.VARIABLE}=none is set."
    if not built.variants:
        return f"{built.why_none} To build them: {_REBUILD}."
    if not native.usable(built):
        return "this processor runs none of those that are built."
    return "they cannot be loaded; the warning says why."


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
