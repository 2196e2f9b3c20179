"""A pasture that herders share for a season: the tragedy of the commons (Hardin 1968)."""

import jax.numpy as jnp
from jax import Array, random

from ethogram import Discrete, Outcome, Role, World
from ethogram.core.settings import Count, Fraction, Number, setting


class Pasture(World):
    """Herders that graze lightly (action 0) or hard (1); they observe nothing (0).

    Attributes:
        pooled: share of what is eaten that all divide, from 0 to 1.
        herders: how many there are, 1 or more.

    """

    pooled: Number = setting(0.0, Fraction)
    herders: int = setting(4, Count, static=True)
    horizon = 1  # steps of an episode

    @property
    def roles(self) -> dict[str, Role]:
        return {"herder": Role(self.herders, Discrete(1), Discrete(2))}

    def reset(self, key: Array) -> tuple[Array, dict[str, Array]]:
        grass = random.uniform(key, minval=0.8, maxval=1.2)  # as a share of a mean year's
        return grass, self.observe(grass)

    def observe(self, state: Array) -> dict[str, Array]:
        return {"herder": jnp.zeros(self.herders, int)}

    def step(self, key: Array, state: Array, action: dict[str, Array]) -> tuple[Array, Outcome]:
        grass = state - 0.75 * action["herder"].mean()
        eaten = (1 + action["herder"]) * grass
        reward = (1 - self.pooled) * eaten + self.pooled * eaten.mean()
        over = jnp.ones(self.herders, bool)  # terminated; nobody is truncated
        mine = [{"herder": each} for each in (reward, over, ~over)]
        return grass, Outcome(self.observe(grass), mine[0], mine[1], mine[2], {"grass": grass})
