"""The kernels that this machine can run, for tests that force each in turn."""

from typing import get_args

from ethogram.core.errors import EthogramError
from ethogram.physics import native
from ethogram.physics.beams3d import Kernel


def _can_be_used(kernel: str) -> bool:
    try:
        return native.variant(kernel) == kernel
    except EthogramError:
        return False


USABLE = [each for each in get_args(Kernel) if each not in ("auto", "none") and _can_be_used(each)]
