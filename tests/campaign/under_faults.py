"""Faults and short times between checkpoints where the environment asks for them.

The studies of `tests.campaign.command` import this, so that workers get both as well.
"""

import os

from tests.campaign import faults

from ethogram.campaign import context

faults.from_environment()
context.CHECKPOINT_SECONDS = float(os.environ.get("CHECKPOINT_SECONDS", "60"))
