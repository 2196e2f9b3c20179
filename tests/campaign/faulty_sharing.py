"""The study `sharing`, with faults where the environment asks for them."""

from tests.campaign import under_faults  # noqa: F401 - for what it does

from ethogram.studies.sharing import *  # noqa: F403
