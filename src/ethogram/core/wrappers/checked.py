"""A world that refuses actions out of their spaces, to find who gives them."""

from typing import Any

from jaxtyping import Array, Key

from ethogram.core.world import Outcome
from ethogram.core.wrappers.base import Wrapper


class Checked(Wrapper, any_action=True):
    """Another world, whose steps check every value of an action, also in compiled programs.

    It takes the other's place with any policy and any learner: `rollout(Checked(world), ...)`.  A
    program then ends with an error (`equinox.error_if`) at the first step with an action that the
    other world would have taken for another one.
    """

    def step(self, key: Key[Array, ""], state: Any, action: Any) -> tuple[Any, Outcome]:
        """As the other world, after a check of the action."""
        return self.world.step(key, state, self.world.check(action))
