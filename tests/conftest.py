"""What every test shares: Hypothesis without time limits (JAX compiles on a first call)."""

from hypothesis import settings

settings.register_profile("ethogram", deadline=None, derandomize=True)
settings.load_profile("ethogram")
