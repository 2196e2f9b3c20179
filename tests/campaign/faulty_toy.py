"""The toy, with faults where the environment asks for them."""

from tests.campaign import under_faults  # noqa: F401 - for what it does
from tests.campaign.toy import *  # noqa: F403
