"""Every registered learner in every registered world, in the wrappers that it asks for.

The page `docs/learners/matrix.md` shows the same for worlds with their default settings.
"""

from itertools import product
from pathlib import Path

import equinox as eqx
import jax
import numpy as np
import pytest

from ethogram.core.errors import EthogramError
from ethogram.core.wrappers import GivenPolicies
from ethogram.learners import LEARNERS
from ethogram.learners.base import undefined_metrics
from ethogram.learners.dynamic_programming import MonteCarloControl
from ethogram.learners.evolution import EvolutionaryLearner
from ethogram.learners.fitness import PolicyFitness
from ethogram.learners.maddpg import MADDPG
from ethogram.learners.ppo import PPO
from ethogram.learners.qlearning import QLearning
from ethogram.learners.wrapping import matrix, wrap_for
from ethogram.worlds import WORLDS
from ethogram.worlds.language import Language
from ethogram.worlds.publishing import Publishing
from ethogram.worlds.publishing.learnable import LearnablePublishing
from ethogram.worlds.publishing.policies import Ranking, Scrutiny
from ethogram.worlds.sharing import Sharing
from ethogram.worlds.softbody import SoftBody2D, SoftBody3D
from ethogram.worlds.traffic import Traffic
from ethogram.worlds.traffic.drivers import IDM, MOBIL

QUICK = {  # to compile, not to run
    "xla_backend_optimization_level": 0,
    "xla_llvm_disable_expensive_passes": True,
}
PAGE = Path(__file__).parents[2] / "docs/learners/matrix.md"
SYSTEM = Publishing(authors=2, journals=2, initial_papers=20, years=1, steps_per_year=3)
SMALL = {
    "language": Language(steps=3),
    "learnable_publishing": LearnablePublishing(SYSTEM, Scrutiny(0.25), ranking=Ranking(2)),
    "publishing": SYSTEM,
    "sharing": Sharing(agents=2, steps=4),
    "softbody2d": SoftBody2D(body="#", steps=4),
    "softbody3d": SoftBody3D(body="#", steps=4),
    "traffic": Traffic(cars=2, max_cars=2, steps=4),
}


def among_human_drivers(**settings):
    """Traffic of which half is learned: a world with a role that follows a given policy."""
    world = Traffic(**settings)
    return GivenPolicies(world, {"human": MOBIL(IDM(world))})


SCRIPTED = "traffic, half of the drivers human"
SMALL[SCRIPTED] = among_human_drivers(cars=2, max_cars=2, humans=2, steps=4)


def knows_spaces(name):
    """What `wrap_for` takes for a learner: evolution knows a world by its fitness only."""
    is_evolution = issubclass(LEARNERS[name], EvolutionaryLearner)
    return PolicyFitness if is_evolution else LEARNERS[name]


def small_learner(name, world):
    match name:
        case "age_fitness" | "cmaes" | "genetic" | "map_elites":
            small = {
                "age_fitness": {"population_size": 3},
                "cmaes": {"population_size": 3, "covariance": "separable"},
                "genetic": {"population_size": 3, "children": 3},
                "map_elites": {"cells": 4, "initial_size": 3, "batch_size": 3},
            }
            fitness = PolicyFitness(world, hidden_size=2)
            return LEARNERS[name](fitness.search_space, fitness, **small[name])
        case "maddpg":
            small = {"batch_size": 2, "learning_starts": 0, "episodes_per_update": 1}
            return MADDPG(world, **small, buffer_size=8, hidden_size=2)
        case "monte_carlo":
            return MonteCarloControl(world)
        case "ppo":
            small = {"episodes_per_update": 2, "minibatch_size": 4, "epochs": 2, "hidden_size": 2}
            return PPO(world, **small)
        case "qlearning":
            return QLearning(world)
    pytest.fail(f"the learner {name!r} has no small instance here: add one")


def fitted(learner_name, world):
    """The world in wrappers, or why there are none that help."""
    try:
        return wrap_for(knows_spaces(learner_name), world)
    except EthogramError as error:
        return str(error)


def takes_long(learner_name, name):
    """All that compiles much; tests of worlds, learners and studies do most of it, too."""
    is_quick = name == "sharing" and learner_name != "maddpg"
    return not is_quick and not isinstance(fitted(learner_name, SMALL[name]), str)


CELLS = [
    pytest.param(*cell, marks=[pytest.mark.slow] if takes_long(*cell) else [])
    for cell in product(LEARNERS, SMALL)
]


@pytest.mark.parametrize(("learner_name", "name"), CELLS)
def test_a_learner_learns_in_a_world_and_acts_in_its_spaces_or_says_why_it_cannot(
    learner_name, name
):
    world = fitted(learner_name, SMALL[name])
    if isinstance(world, str):
        role = next(iter(SMALL[name].roles))
        says = (
            "DiscretizeObservation needs boxes with finite bounds (or give low and high); that of "
        )
        assert world.startswith(f"{says}{role!r}")
        assert f"| no: {says}" in _row(name)
        return
    learner, key = small_learner(learner_name, world), jax.random.key(0)
    init, update = (
        jax.jit(each, compiler_options=QUICK) for each in (learner.init, learner.update)
    )
    state = start = init(key)
    for number in range(2):
        state, metrics = update(jax.random.key(number), state)
        for metric, values in metrics.items():
            finite = [np.isfinite(part).all() for part in jax.tree.leaves(values)]
            assert metric in undefined_metrics(learner) or all(finite)
    numbers = [eqx.filter(each, eqx.is_inexact_array) for each in (start, state)]
    assert not eqx.tree_equal(*numbers)
    observation = {
        role: each.observation.sample(key, each.agents) for role, each in world.roles.items()
    }
    for explore in (False, True):
        world.check(learner.policy(state, explore=explore)(key, observation))


def _row(name):
    (row,) = (row for row in PAGE.read_text().splitlines() if row.startswith(f"| {name} |"))
    return row


def test_every_world_has_a_small_instance():
    assert set(WORLDS) < set(SMALL)


def test_the_page_shows_what_learners_ask_for_in_worlds_as_they_are():
    table = matrix(
        {name: knows_spaces(name) for name in LEARNERS},
        {name: WORLDS[name]() for name in WORLDS}
        | {SCRIPTED: among_human_drivers(cars=20, max_cars=20, humans=20)},
    )
    assert table in PAGE.read_text()
