"""A world around another one, which it resembles in all that it does not say."""

import dataclasses
from typing import Any

from jaxtyping import Array, Key

from ethogram.core.errors import EthogramError, shown
from ethogram.core.scene import Scene
from ethogram.core.world import Outcome, PerRole, Role, Transition, World


class Wrapper(World, any_action=True):
    """Another world as it is; what a subclass defines is different.

        class Doubled(Wrapper):
            def step(self, key, state, action):
                state, outcome = self.world.step(key, state, action)
                reward = {role: 2 * earned for role, earned in outcome.reward.items()}
                return state, dataclasses.replace(outcome, reward=reward)

    A wrapper whose state is another than that of the world inside, such as `(inner, count)`, also
    defines `inner_state`, which gives the inner one, and `observe`.  States and outcomes are
    frozen: `dataclasses.replace` makes others of them.
    """

    world: World

    def __check_init__(self) -> None:
        """Refuse what is no world.

        Raises:
            EthogramError: naming what was given.

        """
        if not isinstance(self.world, World):
            raise EthogramError(
                f"{type(self).__name__}: {shown(self.world)} is no world; allowed: one such as "
                "ethogram.make('sharing')."
            )

    @property
    def roles(self) -> dict[str, Role]:
        """The other world's."""
        return self.world.roles

    @property
    def horizon(self) -> int:
        """The other world's."""
        return self.world.horizon

    @property
    def kernels(self) -> dict[str, str]:
        """The other world's."""
        return self.world.kernels

    def reset(self, key: Key[Array, ""]) -> tuple[Any, PerRole]:
        """As the other world."""
        return self.world.reset(key)

    def observe(self, state: Any) -> PerRole:
        """As the other world."""
        return self.world.observe(state)

    def step(self, key: Key[Array, ""], state: Any, action: Any) -> tuple[Any, Outcome]:
        """As the other world."""
        return self.world.step(key, state, action)

    def scene(self, trajectory: Transition) -> Scene:
        """That of the other world."""
        inner = self.inner_state
        return self.world.scene(
            dataclasses.replace(
                trajectory,
                state=inner(trajectory.state),
                next_state=inner(trajectory.next_state),
            )
        )

    def inner_state(self, state: Any) -> Any:
        """The other world's state, of one of this world."""
        return state


def unwrapped(world: World) -> World:
    """The world inside all wrappers."""
    return unwrapped(world.world) if isinstance(world, Wrapper) else world
