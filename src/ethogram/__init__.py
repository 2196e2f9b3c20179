"""Ethogram: worlds in which artificial agents learn, and studies of what behaviour emerges.

    import jax
    import ethogram as eg

    world = eg.make("sharing", agents=4)
    learner = eg.QLearning(world)
    state, metrics = eg.train(learner, jax.random.key(0), 1000)
    returns = eg.evaluate(world, learner.policy(state), jax.random.key(1), episodes=10)

The names in `dir(ethogram)` are the public ones, and stay; all others may change.  Each is loaded
when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from ethogram.api import evaluate, load_records, make
    from ethogram.core.errors import EthogramError
    from ethogram.core.rollout import Policy, rollout, watch
    from ethogram.core.scene import Scene
    from ethogram.core.search_space import SearchSpace
    from ethogram.core.spaces import Box, Discrete, MultiDiscrete, Simplex
    from ethogram.core.world import Outcome, Role, Transition, World
    from ethogram.learners import LEARNERS
    from ethogram.learners.base import Learner, Trials
    from ethogram.learners.evolution import AgeFitness
    from ethogram.learners.fitness import PolicyFitness
    from ethogram.learners.maddpg import MADDPG
    from ethogram.learners.qlearning import QLearning
    from ethogram.learners.train import train
    from ethogram.learners.wrapping import wrap_for
    from ethogram.studies import STUDIES
    from ethogram.worlds import WORLDS

_WHERE = {
    "LEARNERS": "learners",
    "STUDIES": "studies",
    "WORLDS": "worlds",
    "AgeFitness": "learners.evolution",
    "Box": "core.spaces",
    "Discrete": "core.spaces",
    "EthogramError": "core.errors",
    "Learner": "learners.base",
    "MADDPG": "learners.maddpg",
    "MultiDiscrete": "core.spaces",
    "Outcome": "core.world",
    "Policy": "core.rollout",
    "PolicyFitness": "learners.fitness",
    "QLearning": "learners.qlearning",
    "Role": "core.world",
    "Scene": "core.scene",
    "SearchSpace": "core.search_space",
    "Simplex": "core.spaces",
    "Transition": "core.world",
    "Trials": "learners.base",
    "World": "core.world",
    "evaluate": "api",
    "load_records": "api",
    "make": "api",
    "rollout": "core.rollout",
    "train": "learners.train",
    "watch": "core.rollout",
    "wrap_for": "learners.wrapping",
}

__all__ = [
    "LEARNERS",
    "MADDPG",
    "STUDIES",
    "WORLDS",
    "AgeFitness",
    "Box",
    "Discrete",
    "EthogramError",
    "Learner",
    "MultiDiscrete",
    "Outcome",
    "Policy",
    "PolicyFitness",
    "QLearning",
    "Role",
    "Scene",
    "SearchSpace",
    "Simplex",
    "Transition",
    "Trials",
    "World",
    "evaluate",
    "load_records",
    "make",
    "rollout",
    "train",
    "watch",
    "wrap_for",
]


def __getattr__(name: str) -> Any:
    """A public name, loaded when it is first used."""
    if name not in _WHERE:
        raise AttributeError(f"module 'ethogram' has no attribute {name!r}")
    found = getattr(import_module(f"ethogram.{_WHERE[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
