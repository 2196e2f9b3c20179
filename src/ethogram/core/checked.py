"""A world that refuses actions out of their spaces, to find who gives them."""

from typing import Any

from jaxtyping import Array, Key

from ethogram.core.scene import Scene
from ethogram.core.world import Outcome, PerRole, Role, Transition, World


class Checked(World, any_action=True):
    """Another world, whose steps check every value of an action, also in compiled programs.

    It takes the other's place with any policy and any learner: `rollout(Checked(world), ...)`.  A
    program then ends with an error (`equinox.error_if`) at the first step with an action that the
    other world would have taken for another one.
    """

    world: World

    @property
    def roles(self) -> dict[str, Role]:
        """The other world's."""
        return self.world.roles

    @property
    def horizon(self) -> int:
        """The other world's."""
        return self.world.horizon

    def reset(self, key: Key[Array, ""]) -> tuple[Any, PerRole]:
        """As the other world."""
        return self.world.reset(key)

    def observe(self, state: Any) -> PerRole:
        """As the other world."""
        return self.world.observe(state)

    def step(self, key: Key[Array, ""], state: Any, action: PerRole) -> tuple[Any, Outcome]:
        """As the other world, after a check of the action."""
        return self.world.step(key, state, self.world.check(action))

    def scene(self, trajectory: Transition) -> Scene:
        """As the other world."""
        return self.world.scene(trajectory)
