"""What every test shares: arrays are checked against their annotated shapes and types.

Hypothesis works without time limits, since JAX compiles on a first call.
"""

import tests.typechecking
from hypothesis import settings
from jaxtyping import install_import_hook

ARRAYS = (
    "ethogram.core.keys",
    "ethogram.core.rollout",
    "ethogram.learners",
    "ethogram.physics",
    "ethogram.worlds",
)

install_import_hook(ARRAYS, f"{tests.typechecking.__name__}.check")

settings.register_profile("ethogram", deadline=None, derandomize=True)
settings.load_profile("ethogram")
