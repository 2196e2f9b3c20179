"""What every test shares: arrays are checked against their annotated shapes and types.

Hypothesis works without time limits, since JAX compiles on a first call.
"""

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

settings.register_profile("ethogram", deadline=None, derandomize=True)
settings.load_profile("ethogram")


@pytest.fixture
def ethogram(capsys):
    """Runs a command; gives its exit code, its output and its messages."""
    from ethogram.cli import main  # after the hook above

    def run(*arguments):
        code = main(arguments)
        out, said = capsys.readouterr()
        return code, out, said

    return run
