"""Policy gradient with tables: REINFORCE with the mean return as its baseline (Williams 1992)."""

import jax
import jax.numpy as jnp
from jax import Array

from ethogram import Policy, World
from ethogram.core.module import Module
from ethogram.core.settings import Count, Number, Positive, setting
from ethogram.learners.base import Metrics
from ethogram.learners.episodes import episode_returns, learned_steps, play_episodes, role_keys
from ethogram.learners.tables import Tables, blank_tables, rows


class PolicyGradient(Module):
    """Each agent, by itself, makes likelier what it did in episodes that brought it more.

    Attributes:
        world: one whose observations and actions are `Discrete`.
        learning_rate: alpha, above 0.
        episodes: played in an update, 1 or more.

    """

    world: World
    learning_rate: Number = setting(0.5, Positive)
    episodes: int = setting(16, Count, static=True)

    def init(self, key: Array) -> Tables:
        return blank_tables(self.world, "Policy gradient")  # logits of the actions

    def update(self, key: Array, state: Tables) -> tuple[Tables, Metrics]:
        played = play_episodes(self.world, self.policy(state, explore=True), key, self.episodes)
        returns, counts = episode_returns(played), learned_steps(played)

        def gain(logits: Array, seen: Array, action: Array, counts: Array, earned: Array) -> Array:
            log_chance = jax.nn.log_softmax(logits)[jnp.arange(len(logits)), seen, action]
            return ((log_chance * counts).sum(1) * (earned - earned.mean(0))).mean(0).sum()

        up = jax.tree.map(jax.grad(gain), state, played.observation, played.action, counts, returns)
        after = jax.tree.map(lambda logits, up: logits + self.learning_rate * up, state, up)
        return after, {"episode_return": returns}

    def policy(self, state: Tables, *, explore: bool = False) -> Policy:
        def choose(key: Array, logits: Array) -> Array:
            return jax.random.categorical(key, logits) if explore else logits.argmax(-1)

        return lambda key, seen: jax.tree.map(choose, role_keys(state, key), rows(state, seen))
