"""`ethogram` with the toy among its studies and faults where the environment asks for them.

Spawned workers import this module anew, so that they get both as well.
"""

import os
import sys

from tests.campaign import faults

import ethogram.studies
from ethogram.campaign import context
from ethogram.cli import main
from ethogram.core.registry import Registry

STUDIES = {"toy": "tests.campaign.toy", "sharing": "ethogram.studies.sharing"}

faults.from_environment()
ethogram.studies.STUDIES = Registry("study", "ethogram.studies", STUDIES)
context.CHECKPOINT_SECONDS = float(os.environ.get("CHECKPOINT_SECONDS", "60"))

if __name__ == "__main__":
    sys.exit(main())
