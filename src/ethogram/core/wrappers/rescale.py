"""Worlds whose boxes reach from -1 to 1."""

import dataclasses
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Key

from ethogram.core.spaces import Box, Space
from ethogram.core.world import Outcome, PerRole, Role
from ethogram.core.wrappers.base import Wrapper
from ethogram.core.wrappers.discretize import require_finite, require_width


class RescaleAction(Wrapper):
    """A world whose boxes of actions reach from -1 to 1; other actions are as they are."""

    def __check_init__(self) -> None:
        """Refuse boxes whose bounds are not finite.

        Raises:
            EthogramError: naming role and space.

        """
        _require_finite(self, {name: role.action for name, role in self.world.roles.items()})

    @property
    def roles(self) -> dict[str, Role]:
        """The other world's, with other boxes."""
        return {
            name: dataclasses.replace(role, action=_rescaled(role.action))
            for name, role in self.world.roles.items()
        }

    def step(self, key: Key[Array, ""], state: Any, action: PerRole) -> tuple[Any, Outcome]:
        """As the other world."""
        roles = self.world.roles
        taken = {name: _from_unit(roles[name].action, each) for name, each in action.items()}
        return self.world.step(key, state, taken)


class RescaleObservation(Wrapper):
    """A world whose boxes of observations reach from -1 to 1; others are as they are."""

    def __check_init__(self) -> None:
        """Refuse boxes whose bounds are not finite, or the same.

        Raises:
            EthogramError: naming role and space.

        """
        spaces = {name: role.observation for name, role in self.world.roles.items()}
        _require_finite(self, spaces)
        for name, space in spaces.items():
            if isinstance(space, Box):
                require_width(type(self).__name__, name, space)

    @property
    def roles(self) -> dict[str, Role]:
        """The other world's, with other boxes."""
        return {
            name: dataclasses.replace(role, observation=_rescaled(role.observation))
            for name, role in self.world.roles.items()
        }

    def reset(self, key: Key[Array, ""]) -> tuple[Any, PerRole]:
        """As the other world."""
        state, observation = self.world.reset(key)
        return state, self._scaled(observation)

    def observe(self, state: Any) -> PerRole:
        """What the other world's agents observe, from -1 to 1."""
        return self._scaled(self.world.observe(state))

    def step(self, key: Key[Array, ""], state: Any, action: PerRole) -> tuple[Any, Outcome]:
        """As the other world."""
        after, outcome = self.world.step(key, state, action)
        scaled = self._scaled(outcome.observation)
        return after, dataclasses.replace(outcome, observation=scaled)

    def _scaled(self, observation: PerRole) -> PerRole:
        return {
            name: _to_unit(role.observation, observation[name])
            for name, role in self.world.roles.items()
        }


def _require_finite(wrapper: Wrapper, spaces: dict[str, Space]) -> None:
    for name, space in spaces.items():
        if isinstance(space, Box):
            require_finite(type(wrapper).__name__, name, space)


def _rescaled(space: Space) -> Space:
    return Box(-1.0, 1.0, space.shape, space.used) if isinstance(space, Box) else space


def _to_unit(space: Space, value: Array) -> Array:
    """A value as the box from -1 to 1 has it; padding stays 0."""
    if not isinstance(space, Box):
        return value
    unit = 2 * (value - space.low) / (space.high - space.low) - 1
    return unit if space.used is None else jnp.where(space.used, unit, 0.0)


def _from_unit(space: Space, unit: Array) -> Array:
    """A value as the world's box has it, within it also after rounding."""
    if not isinstance(space, Box):
        return unit
    return space.nearest(space.low + (unit + 1) / 2 * (space.high - space.low))
