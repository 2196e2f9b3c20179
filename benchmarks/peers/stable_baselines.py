"""Stable-Baselines3's PPO in our traffic world."""

from typing import Any

import gymnasium
import jax
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv

from ethogram.worlds.traffic import Traffic

ROLE = "driver"


class Drivers(VecEnv):
    """The drivers of a world as a vector of environments; a step of the world is one program."""

    def __init__(self, world: Traffic, seed: int) -> None:
        """Take a world; the seed is of all its episodes."""
        role = world.roles[ROLE]
        box = role.observation
        low, high = (
            np.broadcast_to(np.asarray(end, np.float32), box.shape) for end in (box.low, box.high)
        )
        super().__init__(
            role.agents,
            gymnasium.spaces.Box(low, high, dtype=np.float32),
            gymnasium.spaces.MultiDiscrete(role.action.sizes),
        )

        @jax.jit
        def begin(key: Any) -> Any:
            after, key = jax.random.split(key)
            state, observation = world.reset(key)
            return after, state, observation[ROLE]

        @jax.jit
        def advance(key: Any, state: Any, action: Any) -> Any:
            after, key = jax.random.split(key)
            state, outcome = world.step(key, state, {ROLE: action})
            return after, state, (outcome.observation[ROLE], outcome.reward[ROLE])

        self.begin, self.advance, self.horizon = begin, advance, world.horizon
        self.key, self.state, self.step_number = jax.random.key(seed), None, 0

    def reset(self) -> np.ndarray:
        """Begin an episode."""
        self.key, self.state, observation = self.begin(self.key)
        self.step_number = 0
        return np.array(observation)

    def step_async(self, actions: np.ndarray) -> None:
        """Keep what is to be done."""
        self.actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Do it; the end of an episode is a truncation."""
        self.key, self.state, seen = self.advance(self.key, self.state, self.actions)
        observation, reward = map(np.array, seen)  # copies, since they are written to
        self.step_number += 1
        ended = self.step_number == self.horizon
        notes: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if ended:
            for note, last in zip(notes, observation, strict=True):
                note |= {"terminal_observation": last, "TimeLimit.truncated": True}
            observation = self.reset()
        return observation, reward, np.full(self.num_envs, ended), notes

    def close(self) -> None:
        """Nothing is open."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """No environment has anything of its own."""
        del attr_name, indices
        return [None] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """No environment has anything of its own."""
        raise NotImplementedError

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        """No environment has anything of its own."""
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """No environment is."""
        del wrapper_class, indices
        return [False] * self.num_envs


def updates(world: Traffic, minibatch_size: int, seed: int):
    """An update of PPO, playing and learning: how many samples it took.

    An update plays one episode; all that is not said is the package's default: two networks of
    2 x 64 and ten epochs among them.
    """
    torch.set_num_threads(1)
    drivers = Drivers(world, seed)
    learner = PPO(
        "MlpPolicy",
        drivers,
        n_steps=world.horizon,
        batch_size=minibatch_size,
        device="cpu",
        seed=seed,
    )
    samples = world.horizon * drivers.num_envs

    def run() -> int:
        learner.learn(samples, reset_num_timesteps=False)
        if not np.isfinite(learner.logger.name_to_value["train/loss"]):
            raise RuntimeError("Stable-Baselines3 has diverged: the benchmark measures no training")
        return samples

    return run
