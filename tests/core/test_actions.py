"""What a step is given, in numbers wider than those that JAX computes with."""

import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.core.actions import InvalidAction, formed
from ethogram.core.spaces import Discrete
from ethogram.core.world import Role

ROLES = {"agent": Role(2, Discrete(4), Discrete(4))}
WIDE = (
    np.array([2**40, 2**32 + 3]),
    np.array([2**32 - 1, 2**63], np.uint64),
    jnp.array([2**32 - 1, 2**31], jnp.uint32),
)


@pytest.mark.parametrize("wide", WIDE, ids=str)
def test_whole_numbers_beyond_32_bits_are_never_taken_for_small_ones(wide):
    assert (formed("World", ROLES, {"agent": wide})["agent"] == 2**31 - 1).all()


@pytest.mark.parametrize("huge", [[2**70] * 2, 2**70, np.full(2, 1e300)], ids=str)
def test_numbers_that_no_array_holds_are_no_action(huge):
    with pytest.raises(InvalidAction, match=r"int32\[2\]"):
        formed("World", ROLES, {"agent": huge})
