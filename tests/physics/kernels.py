"""The kernels that this machine can run, for tests that force each in turn."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import get_args

import jax
from tests.lacking import lacking

from ethogram.core.errors import EthogramError
from ethogram.physics import native
from ethogram.physics.native import Kernel


def _can_be_used(kernel: str) -> bool:
    try:
        return native.variant(kernel) == kernel
    except EthogramError:
        return False


USABLE = [each for each in get_args(Kernel) if each not in ("auto", "none") and _can_be_used(each)]
FUSED = [name for name in USABLE if name in ("x86-64-v4", "x86-64-v3")]  # of equal bits

_CHECKED = """
import ctypes, sys
import jax, pytest
from ethogram.physics import native

library = ctypes.CDLL(sys.argv[1])
prefix, plain = f"ethogram_{sys.argv[2]}_", native.target
registered = set()

def target(symbol, choice):
    found = plain(symbol, choice)
    if found is None or not symbol.startswith(prefix):
        return found
    if symbol not in registered:
        function = jax.ffi.pycapsule(getattr(library, symbol))
        jax.ffi.register_ffi_target(f"checked_{symbol}", function, platform="cpu")
        registered.add(symbol)
    return f"checked_{symbol}"

native.target = target
imported = "ignore::pytest.PytestAssertRewriteWarning"  # jaxtyping, before pytest could
sys.exit(pytest.main([sys.argv[3], "-k", "not derivatives", "-W", imported]))
"""


def assert_sound(kernel: str, tests: str, tmp_path: Path) -> None:
    """All fast tests of a file pass under the address and the undefined behaviour sanitizer.

    Args:
        kernel: its name.
        tests: the file.
        tmp_path: a folder to build in.

    """
    root = Path(__file__).parents[2]
    source, compiler = root / "kernels" / f"{kernel}.cpp", shutil.which("g++")
    if compiler is None or not source.is_file():
        lacking("there is no g++, or no source of the kernel")
    library, march = tmp_path / "checked.so", FUSED[-1] if FUSED else "x86-64"
    sanitize = ("-fsanitize=address,undefined", "-fno-sanitize-recover=undefined", "-O1", "-g")
    flags = ("-std=c++17", "-ffp-contract=off", "-fno-exceptions", "-fno-rtti", "-shared", "-fPIC")
    include = ("-I", str(root / "kernels" / "vendored"), "-I", jax.ffi.include_dir())
    build = [compiler, *sanitize, *flags, "-Wno-psabi", f"-march={march}", *include, str(source)]
    subprocess.run([*build, "-o", str(library)], check=True, timeout=300)
    first = [  # the second for the exceptions of others, which the first looks for at the start
        subprocess.check_output([compiler, f"-print-file-name={name}"], text=True).strip()
        for name in ("libasan.so", "libstdc++.so")
    ]
    environment = os.environ | {
        "LD_PRELOAD": " ".join(first),
        "ASAN_OPTIONS": "detect_leaks=0",
        "PYTHONPATH": os.pathsep.join([str(root / "src"), str(root)]),
    }
    script = tmp_path / "checked.py"
    script.write_text(_CHECKED)
    run = subprocess.run(
        [sys.executable, str(script), str(library), kernel, tests],
        env=environment,
        cwd=root,
        capture_output=True,
        text=True,
        timeout=1800,
    )
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-3000:]
    assert "passed" in run.stdout
