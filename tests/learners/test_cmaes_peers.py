"""CMA-ES beside the packages `cma` and `cmaes`: evaluations to a target, twenty runs each."""

import jax.numpy as jnp
import numpy as np
import pytest
from tests.lacking import lacking
from tests.learners.landscapes import (
    Of,
    ellipsoid,
    rosenbrock,
    rotated_ellipsoid,
    space,
    sphere,
)

from ethogram.core.keys import trial_keys
from ethogram.learners.base import Trials
from ethogram.learners.evolution import CMAES
from ethogram.learners.evolution.cmaes import PRESETS
from ethogram.learners.train import train

RUNS, GENES, SIGMA = 20, 10, 0.5
SIZE = 10  # 4 + floor(3 ln 10), in all packages
TARGET = -1e-6
OLD_RATE = 1.4830 / 1.7330  # `cma` has a quarter more in c_mu's mu_eff - 2 + 1 / mu_eff (eq. 58)
PLATEAU_GENES, RADIUS, DISTANCE = 2, 1.25, 2.0
PLATEAU_SIZE, PLATEAU_EVALUATIONS = 6, 4000

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]  # theirs


@pytest.fixture(scope="module")
def peers():
    try:
        import cma
        import cmaes
    except ImportError as error:
        lacking(f"The packages cma and cmaes are needed: {error}.")

    def of_cma(mean, seed, separable, **changes):
        options = {"CMA_diagonal": separable, "verbose": -9, "seed": seed + 1}
        return cma.CMAEvolutionStrategy(mean, SIGMA, options | changes)

    def without_negative_weights(mean, seed, separable):
        changes = {"CMA_active": False, "CMA_rankmu": OLD_RATE}
        return of_cma(mean, seed, separable, **changes)

    def of_cmaes(mean, seed, separable):
        kind = cmaes.SepCMA if separable else cmaes.CMA
        strategy = kind(np.array(mean), SIGMA, seed=seed)
        return Adapted(strategy)

    return {
        "modern": {"cma": of_cma, "cmaes": of_cmaes},
        "thesis": {"cma": without_negative_weights},
    }


class Adapted:
    """`cmaes` with the interface of `cma`: minimised, a population at a time."""

    def __init__(self, strategy):
        self.strategy = strategy

    def ask(self):
        return [self.strategy.ask() for _ in range(self.strategy.population_size)]

    def tell(self, candidates, values):
        self.strategy.tell(list(zip(candidates, values, strict=True)))


def evaluations(make, function, genes, target, most, separable):
    """Evaluations until the target, of each run; infinite where it is not reached."""
    found = []
    for seed in range(RUNS):
        start = np.random.default_rng(seed).uniform(size=genes)
        start = np.zeros(genes) if function is plateau else start
        strategy, done, reached = make(start, seed, separable), 0, False
        while not reached and done < most:
            candidates = strategy.ask()
            values = -np.asarray(function(np.array(candidates)), float)
            done += len(candidates)
            reached = (values <= -target).any()
            strategy.tell(candidates, values.tolist())
        found.append(done if reached else np.inf)
    return np.array(found)


def our_evaluations(learner, target, most, size, runs=RUNS):
    """The same of ours."""
    best = train(Trials(learner), trial_keys(0, "peers", runs), most // size)[1]["best"]
    reached = best >= target
    return np.where(reached.any(0), (reached.argmax(0) + 1) * size, np.inf)


def interval(found):
    """The mean over runs that reached the target and its 95% interval's half."""
    some = found[np.isfinite(found)]
    return some.mean(), 2.09 * some.std(ddof=1) / np.sqrt(some.size)


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(
    ("function", "kind", "most"),
    [
        (sphere, "full", 4000),
        (ellipsoid, "full", 12_000),
        (rotated_ellipsoid, "full", 12_000),
        (rosenbrock, "full", 15_000),
        (sphere, "separable", 4000),
        (ellipsoid, "separable", 12_000),
    ],
)
def test_targets_are_reached_in_as_few_evaluations_as_by_others(
    peers, function, kind, most, preset
):
    learner = CMAES(space(GENES), Of(function), covariance=kind, **PRESETS[preset])
    ours = our_evaluations(learner, TARGET, most, SIZE)
    mine, my_half = interval(ours)
    print(f"\n{function.__name__} {kind} {preset}: {mine:.0f} +- {my_half:.0f} ", end="")
    for name, make in peers[preset].items():
        theirs = evaluations(make, function, GENES, TARGET, most, kind == "separable")
        mean, half = interval(theirs)
        print(f"| {name} {mean:.0f} +- {half:.0f} ({np.isfinite(theirs).sum()}) ", end="")
        assert np.isfinite(ours).sum() >= np.isfinite(theirs).sum() - 3
        assert mine - my_half <= mean + half


def plateau(genome):
    """0 everywhere but in a ball, in which it rises to the middle."""
    middle = np.array([DISTANCE] + [0.0] * (PLATEAU_GENES - 1))
    away = jnp.sqrt(((genome - middle) ** 2).sum(-1))
    return jnp.maximum(0.0, 1 - away / RADIUS)


@pytest.mark.parametrize("preset", PRESETS)
def test_plateaus_are_escaped_from_as_often_as_by_others(peers, preset):
    start = space(PLATEAU_GENES, low=0.0, high=0.0)
    learner = CMAES(start, Of(plateau), **PRESETS[preset])
    found = our_evaluations(learner, 0.9, PLATEAU_EVALUATIONS, PLATEAU_SIZE, 10 * RUNS)
    ours = np.isfinite(found).sum() / 10  # of twenty
    print(f"\nplateau {preset}: {ours}", end="")
    for name, make in peers[preset].items():
        most = PLATEAU_EVALUATIONS
        found = evaluations(make, plateau, PLATEAU_GENES, 0.9, most, False)
        theirs = np.isfinite(found).sum()
        print(f" | {name} {theirs}", end="")
        assert ours >= 14
        assert ours >= theirs - 4
