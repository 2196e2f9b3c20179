"""Native kernels at build time: each `kernels/NAME.cpp` becomes a library per instruction set.

They need a C++ compiler: $CXX, c++, g++ or clang++; else that of the package `ziglang`, which is
fetched for this one purpose where it is not installed.  One that will not do gives way to the next.
Without any the package is pure Python, and simulations run on JAX.  A library needs the C library
and no Python, so that one wheel serves every version of Python.

Tried on Linux with x86-64; macOS and other processors should work, and Windows gets no kernels.

`ETHOGRAM_BUILD_KERNEL=none` builds none.  `python hatch_build.py` builds them for the checkout.
"""

import ctypes
import hashlib
import json
import os
import platform
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

VARIABLE = "ETHOGRAM_BUILD_KERNEL"
LIBRARIES = "ethogram/physics/_native"  # in the wheel, and in `src`
BUILD = "build.json"  # beside the libraries: what was built of what, or why nothing was
ZIGLANG = "ziglang==0.17.1"  # the one that is fetched
ZIG_GLIBC = "2.17"  # the oldest that its libraries run with
INSTALL = (
    "Install a C++ compiler (Debian and Ubuntu: apt-get install g++; Fedora: dnf install gcc-c++; "
    "macOS: xcode-select --install) or the package ziglang, and then Ethogram again."
)

FLAGS = (
    *("-std=c++17", "-O3", "-shared", "-fPIC", "-fvisibility=hidden", "-fno-exceptions"),
    *("-fno-rtti", "-Wno-psabi"),
    # the same operations in every variant, so that those with fused multiply-adds give equal bits
    *("-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"),
)
VARIANTS = {
    "x86-64-v4": ("-march=x86-64-v4", "-mprefer-vector-width=512"),
    "x86-64-v3": ("-march=x86-64-v3",),
    "x86-64": ("-march=x86-64",),
}
PORTABLE = {"portable": ()}  # on other processors


class NoCompiler(Exception):
    """A compiler cannot be had, or is of no use here; says why in a line."""


class BrokenSource(NoCompiler):
    """A compiler that works refuses a kernel; `output` is all that it says."""

    def __init__(self, reason: str, output: str) -> None:
        super().__init__(reason)
        self.output = output


@dataclass(frozen=True)
class Compiler:
    """A command that compiles C++, and how it is told an instruction set."""

    name: str  # for a person
    command: tuple[str, ...]
    is_zig: bool = False

    def flags(self, variant: tuple[str, ...]) -> list[str]:
        """The flags of a variant, as this compiler spells them."""
        if not self.is_zig:
            # nothing of the C++ library is used, and so it is not to be needed
            unneeded = ["-Wl,--as-needed"] if sys.platform == "linux" else []
            return [*variant, *unneeded]
        spelled = [flag.replace("-march=x86-64", "-mcpu=x86_64") for flag in variant]
        return [
            "-nostdlib++",
            "-s",
            *_zig_target(),
            *(flag.replace("64-v", "64_v") for flag in spelled),
        ]


class Kernels(BuildHookInterface):  # type: ignore[type-arg]
    """Puts the libraries into a wheel, or beside the sources where these are used in place."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build what can be built before the wheel is packed."""
        root = Path(self.root)
        if version == "editable":
            build(root, root / "src" / LIBRARIES, self.app.display_warning)
            return
        self._folder = Path(tempfile.mkdtemp(prefix="ethogram-"))
        if build(root, self._folder, self.app.display_warning):
            build_data["pure_python"] = False
            build_data["tag"] = f"py3-none-{_platform_tag()}"
        for file in self._folder.iterdir():
            build_data["force_include"][str(file)] = f"{LIBRARIES}/{file.name}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove what is in the wheel by now."""
        del build_data, artifact_path
        if version != "editable":
            shutil.rmtree(self._folder, ignore_errors=True)


def build(root: Path, folder: Path, say: Callable[[str], None], *, strict: bool = False) -> bool:
    """Fill a folder with the libraries of all kernels and variants; False where there are none.

    What was in it before is removed, unless it was made of these very sources.

    Args:
        root: of the sources.
        folder: for the libraries.
        say: is told, in one message, why nothing was built.
        strict: whether `BrokenSource` is an error of the sources, not a reason to go on without.

    """
    wanted = os.environ.get(VARIABLE, "auto")
    if wanted not in ("auto", "none"):
        raise ValueError(f"{VARIABLE} is {wanted!r}; auto and none are allowed.")
    sources = hashes(root)
    if wanted == "auto" and _is_made_of(sources, folder):
        return True
    about: dict[str, Any] = {"compiler": "", "variants": [], "why_none": "", "sources": {}}
    with tempfile.TemporaryDirectory(prefix="ethogram-") as scratch:
        made: list[Path] = []
        try:
            if wanted == "none":
                raise NoCompiler(f"{VARIABLE}=none was set. Install Ethogram again without it.")
            compiler, made = _compiled(root / "kernels", Path(scratch), strict)
        except BrokenSource:
            raise
        except NoCompiler as reason:
            about["why_none"] = str(reason)
            say(f"No native kernel was built, so soft bodies will run on JAX, slower: {reason}")
        else:
            about |= {"compiler": compiler.name, "variants": list(_variants()), "sources": sources}
        folder.mkdir(parents=True, exist_ok=True)
        for file in folder.iterdir():
            file.unlink()
        for library in made:
            shutil.move(library, folder / library.name)
    (folder / BUILD).write_text(json.dumps(about, indent=1))
    return bool(made)


def hashes(root: Path) -> dict[str, str]:
    """The sha256 of each file that the libraries are made of."""
    kernels = (path for path in (root / "kernels").rglob("*") if path.suffix in (".cpp", ".h"))
    return {
        path.relative_to(root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted([*kernels, root / "hatch_build.py"])
    }


def _is_made_of(sources: dict[str, str], folder: Path) -> bool:
    try:
        return bool(json.loads((folder / BUILD).read_text())["sources"] == sources)
    except (OSError, ValueError, LookupError):
        return False


def _compiled(kernels: Path, scratch: Path, strict: bool) -> tuple[Compiler, list[Path]]:
    """The first compiler that will do, and the libraries that it made."""
    if os.name != "posix":
        raise NoCompiler(f"kernels are not built on {platform.system()} yet.")
    sources = sorted(kernels.glob("*.cpp"))
    reasons = []
    for number, find in enumerate(_compilers()):
        folder = scratch / str(number)
        folder.mkdir()
        try:
            with find() as compiler:
                _require_fit(compiler, folder)
                return compiler, _libraries(compiler, sources, folder)
        except NoCompiler as reason:
            if strict and isinstance(reason, BrokenSource):
                raise
            reasons.append(str(reason))
    raise NoCompiler(f"{'; '.join(dict.fromkeys(reasons))}. {INSTALL}")


def _require_fit(compiler: Compiler, folder: Path) -> None:
    """Raise `NoCompiler` unless a compiler makes libraries of the newest variant that load here."""
    source, library = folder / "fit.cpp", folder / "fit.so"
    source.write_text('extern "C" int fit() { return 0; }\n')
    _compile(compiler, source, library, next(iter(_variants().values())))
    try:
        ctypes.CDLL(str(library))
    except OSError as error:
        raise NoCompiler(f"{compiler.name}: what it makes does not load ({error})") from error


def _libraries(compiler: Compiler, sources: list[Path], folder: Path) -> list[Path]:
    """Every kernel in every variant, compiled side by side."""
    tasks = [
        (source, folder / f"{source.stem}_{variant}.so", flags)
        for source in sources
        for variant, flags in _variants().items()
    ]

    def library(task: tuple[Path, Path, tuple[str, ...]]) -> Path:
        try:
            _compile(compiler, *task)
        except NoCompiler as error:
            output = getattr(error.__cause__, "stderr", "")
            raise BrokenSource(str(error), output) from error
        return task[1]

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(library, tasks))


def _compile(compiler: Compiler, source: Path, library: Path, variant: tuple[str, ...]) -> None:
    cache = str(library.parent / "cache")  # zig's, which is not to stay in anybody's home
    environment = os.environ | {"ZIG_GLOBAL_CACHE_DIR": cache, "ZIG_LOCAL_CACHE_DIR": cache}
    headers = ("-I", str(source.parent), "-I", str(source.parent / "vendored"))
    flags = (*FLAGS, *compiler.flags(variant), *headers)
    _run(compiler.name, [*compiler.command, *flags, str(source), "-o", str(library)], environment)


def _compilers() -> Iterator[Callable[[], Any]]:
    """How to get at each compiler, in the order in which they are tried."""
    for words in dict.fromkeys(filter(None, (os.environ.get("CXX"), "c++", "g++", "clang++"))):
        yield lambda words=words: _on_the_path(words)
    yield _zig_installed
    yield _zig_fetched


@contextmanager
def _on_the_path(words: str) -> Iterator[Compiler]:
    name, *options = shlex.split(words)
    if shutil.which(name) is None:
        raise NoCompiler(f"{name}: not found")
    version = _run(name, [name, *options, "--version"]).partition("\n")[0].strip()
    yield Compiler(version or name, (name, *options))


@contextmanager
def _zig_installed() -> Iterator[Compiler]:
    """That of the package where Ethogram is installed, also for a build in isolation from it."""
    # -E: without the search path by which pip isolates a build
    found = subprocess.run(
        [sys.executable, "-E", "-c", "import ziglang; print(*ziglang.__path__)"],
        capture_output=True,
        text=True,
        check=False,
    )
    if found.returncode:
        raise NoCompiler("ziglang: not installed")
    yield _zig_in(Path(found.stdout.strip()))


@contextmanager
def _zig_fetched() -> Iterator[Compiler]:
    """That of the package, in a folder of its own for as long as it is needed."""
    with tempfile.TemporaryDirectory(prefix="ethogram-") as folder:
        wheel = ("--quiet", "--no-deps", "--only-binary", ":all:", "--target", folder, ZIGLANG)
        pip = [sys.executable, "-E", "-m", "pip", "install", "--disable-pip-version-check"]
        uv = [os.environ.get("UV") or "uv", "pip", "install", "--python", sys.executable]
        try:
            _run("pip", [*pip, "--retries", "1", *wheel])
        except NoCompiler as without_pip:
            try:
                _run("uv", [*uv, *wheel])
            except NoCompiler as without_uv:
                raise NoCompiler(
                    f"{ZIGLANG} cannot be fetched ({without_pip}; {without_uv})"
                ) from without_uv
        yield _zig_in(Path(folder) / "ziglang")


def _zig_in(package: Path) -> Compiler:
    zig = str(package / "zig")
    return Compiler(f"zig {_run('zig', [zig, 'version']).strip()}", (zig, "c++"), is_zig=True)


def _zig_target() -> list[str]:
    """The target on Linux; elsewhere this machine, which zig knows itself."""
    if sys.platform != "linux":
        return []
    libc = f"gnu.{ZIG_GLIBC}" if platform.libc_ver()[0] == "glibc" else "musl"
    return ["-target", f"{platform.machine()}-linux-{libc}"]


def _run(name: str, command: list[str], environment: dict[str, str] | None = None) -> str:
    """What a command prints, or `NoCompiler` with the line that says what went wrong."""
    try:
        return subprocess.run(
            command, env=environment, capture_output=True, text=True, errors="replace", check=True
        ).stdout
    except OSError as error:
        raise NoCompiler(f"{name}: {error.strerror}") from error
    except subprocess.CalledProcessError as error:
        lines = [line.strip() for line in error.stderr.splitlines() if line.strip()]
        telling = [line for line in lines if "error" in line.lower()] or lines[-1:]
        raise NoCompiler(f"{name}: {telling[0][:200] if telling else 'it fails'}") from error


def _variants() -> dict[str, tuple[str, ...]]:
    """What is built on this kind of processor."""
    is_x86 = sysconfig.get_platform().endswith(("x86_64", "amd64"))
    return VARIANTS if is_x86 else PORTABLE


def _platform_tag() -> str:
    """The platform of the libraries, as a wheel's name spells it."""
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")


if __name__ == "__main__":
    checkout = Path(__file__).parent
    try:
        build(checkout, checkout / "src" / LIBRARIES, print, strict=True)
    except BrokenSource as error:
        sys.exit(error.output)
