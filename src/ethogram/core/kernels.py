"""Names of the ways in which a physics does its work, and which of them give the same bits.

A native kernel is compiled for several instruction sets, its variants; where there is none, the work
is done in JAX.  A record says, for each kernel that stands behind its numbers, which it was.
"""

from collections.abc import Mapping

JAX = "jax"  # the way of no kernel
FLAGS = {  # of a processor, by variant, the fastest first; those of x86-64 as its levels define them
    "x86-64-v4": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"},
    "x86-64-v3": {"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"},
    "x86-64": set[str](),
    "portable": set[str](),  # what is built on other processors
}
FLAGS["x86-64-v4"] |= FLAGS["x86-64-v3"]

_FUSED = "fused multiply-add"
_ARITHMETIC = {"x86-64-v4": _FUSED, "x86-64-v3": _FUSED, "x86-64": "portable"}


def arithmetic(ways: Mapping[str, str]) -> dict[str, str]:
    """The kind of arithmetic of each kernel, by the way in which it works: equal kinds, equal bits.

    A kernel that is not named works in JAX, as all did before there were any.
    """
    return {kernel: _ARITHMETIC.get(way, way) for kernel, way in ways.items() if way != JAX}
