"""What every test shares: arrays are checked against their annotated shapes and types.

Hypothesis works without time limits, since JAX compiles on a first call.  Most of the time of the
fast tests is that of compiling small programs that run for a moment, so XLA is told not to optimise
them and to emit them by its older, faster emitters; slow tests and benchmarks get what users get.
"""

import os

import pytest
import tests.typechecking
from hypothesis import settings
from jaxtyping import install_import_hook

ARRAYS = (
    "ethogram.core.keys",
    "ethogram.core.rollout",
    "ethogram.core.wrappers",
    "ethogram.learners",
    "ethogram.physics",
    "ethogram.worlds",
)

install_import_hook(ARRAYS, f"{tests.typechecking.__name__}.check")

UNOPTIMISED = "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false"
QUICK = {"campaign", "cli", "core", "report"}  # folders of tests that compile little

settings.register_profile("ethogram", deadline=None, derandomize=True)
settings.load_profile("ethogram")


def pytest_configure(config):
    if config.option.markexpr == "not slow":
        os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {UNOPTIMISED}".strip()


def pytest_collection_modifyitems(items):
    """Quick files come last, so that processes that share the tests end together."""
    items.sort(key=lambda item: not QUICK.isdisjoint(item.path.parts))


@pytest.fixture
def ethogram(capsys):
    """Runs a command; gives its exit code, its output and its messages."""
    from ethogram.cli import main  # after the hook above

    def run(*arguments):
        code = main(arguments)
        out, said = capsys.readouterr()
        return code, out, said

    return run
