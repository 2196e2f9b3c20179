"""One thread for each process, so that numbers are the same in every engine."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "NPROC": "1"}
_ONE_XLA_THREAD = "--xla_cpu_multi_thread_eigen=false"


def limit_threads() -> None:
    """Give numerical libraries one thread; they read this when they are imported.

    Cases are computed side by side, so that more threads would only be in each other's way.
    Processes that are started later inherit it.
    """
    os.environ.update(_ONE_THREAD)
    flags = os.environ.get("XLA_FLAGS", "").split()
    if _ONE_XLA_THREAD not in flags:
        os.environ["XLA_FLAGS"] = " ".join([*flags, _ONE_XLA_THREAD])


@contextmanager
def one_thread() -> Iterator[None]:
    """The same for the length of a context, after which the environment is as it was before."""
    before = {name: os.environ.get(name) for name in (*_ONE_THREAD, "XLA_FLAGS")}
    limit_threads()
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
