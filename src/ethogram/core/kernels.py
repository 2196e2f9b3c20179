"""What can do the work of a physics, and which of it gives the same bits.

A native kernel is compiled for several instruction sets, its variants; where there is none, JAX
does the work.  A record says, for each kernel that stands behind its numbers, which it was.
"""

from collections.abc import Mapping

JAX = "jax"  # where no kernel does it
_V3 = frozenset({"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"})
FLAGS = {  # that a processor needs, by variant, the fastest first: the levels of x86-64
    "x86-64-v4": _V3 | {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"},
    "x86-64-v3": _V3,
    "x86-64": frozenset[str](),
    "portable": frozenset[str](),  # the one on other processors
}

_FUSED = "fused multiply-add"
_ARITHMETIC = {"x86-64-v4": _FUSED, "x86-64-v3": _FUSED, "x86-64": "portable"}


def arithmetic(kernels: Mapping[str, str]) -> dict[str, str]:
    """The arithmetic of each kernel, by what does its work: equal arithmetic, equal bits.

    Of a kernel that is not named JAX does the work, as of all before there were any.
    """
    return {name: _ARITHMETIC.get(by, by) for name, by in kernels.items() if by != JAX}
