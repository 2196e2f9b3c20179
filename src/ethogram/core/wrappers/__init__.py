"""Worlds around worlds: other spaces, other time, roles that follow a given policy.

Each is a world itself, so that wrappers can be put around each other.
"""

from ethogram.core.wrappers.base import Wrapper, unwrapped
from ethogram.core.wrappers.checked import Checked
from ethogram.core.wrappers.discretize import DiscretizeAction, DiscretizeObservation
from ethogram.core.wrappers.rescale import RescaleAction, RescaleObservation
from ethogram.core.wrappers.roles import GivenPolicies, RolePolicies, RolePolicy, completed
from ethogram.core.wrappers.time import RepeatAction, TimeLimit

__all__ = [
    "Checked",
    "DiscretizeAction",
    "DiscretizeObservation",
    "GivenPolicies",
    "RepeatAction",
    "RescaleAction",
    "RescaleObservation",
    "RolePolicies",
    "RolePolicy",
    "TimeLimit",
    "Wrapper",
    "completed",
    "unwrapped",
]
