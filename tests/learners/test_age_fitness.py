import equinox as eqx
import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from tests.learners.landscapes import Of
from tests.learners.landscapes import space as box
from tests.oracles import age_fitness as oracle

from ethogram.core.errors import EthogramError, InvalidSettings
from ethogram.core.keys import fold_in, trial_keys
from ethogram.core.search_space import SearchSpace
from ethogram.learners.base import Trials
from ethogram.learners.evolution import WORST_FITNESS, AgeFitness, Evaluation, Population, best
from ethogram.learners.evolution.pareto import dominance, fronts
from ethogram.learners.train import train

RUNS, SIZE, GENES, GENERATIONS = 3, 8, 5, 12


def sphere(genome):
    """Best at a half everywhere; in steps, lest the last bits tell apart who is the same."""
    return -jnp.round(((genome - 0.5) ** 2).sum(-1), 4)


def trap(genome):
    """Deceptive: each gene does better the lower it is, and best of all above 0.9 (Deb, 1993)."""
    low = 0.8 * (0.9 - genome) / 0.9
    return jnp.round(jnp.where(genome > 0.9, 1.0, low).sum(-1), 1)


def nowhere(genome):
    """Everyone ties: only age and chance decide."""
    return 0 * genome.sum(-1)


LIMITED = box(GENES, lower=-0.2, upper=1.2)


def learner(function, space=LIMITED, size=SIZE, **settings):
    return AgeFitness(space, Of(function), population_size=size, **settings)


@pytest.mark.parametrize("function", [sphere, trap, nowhere])
def test_every_generation_of_every_run_is_that_of_the_plain_version(function):
    keys = trial_keys(1, "evolution", RUNS)
    evolution = Trials(learner(function))
    population = eqx.filter_jit(evolution.init)(keys)
    update = eqx.filter_jit(evolution.update)
    low, high, lower, upper = (
        np.asarray(getattr(LIMITED, name)) for name in ("low", "high", "lower", "upper")
    )
    evaluate = jax.jit(function)
    plain = [oracle.first(key, evaluate, low, high, SIZE) for key in keys]
    compare(population, plain)
    for generation in range(GENERATIONS):
        at = fold_in(keys, generation)
        population, metrics = update(at, population)
        plain = [
            oracle.next_generation(key, one, evaluate, low, high, lower, upper)
            for key, one in zip(at, plain, strict=True)
        ]
        compare(population, plain)
        fittest = [max(one, key=lambda individual: individual.fitness) for one in plain]
        for name in ("best", "episode_return"):
            np.testing.assert_allclose(metrics[name], [one.fitness for one in fittest], rtol=1e-6)
    assert np.ptp(population.age) >= 3, "old and young are among them"


def compare(population, plain):
    for run, individuals in enumerate(plain):
        genome = np.stack([one.genome for one in individuals])
        np.testing.assert_allclose(population.genome[run], genome, rtol=1e-6, atol=1e-7)
        np.testing.assert_array_equal(population.age[run], [one.age for one in individuals])
        fitness = [one.fitness for one in individuals]
        np.testing.assert_allclose(population.fitness[run], fitness, rtol=1e-5, atol=1e-6)


def evolved(function, generations, space=LIMITED, size=SIZE, runs=RUNS):
    evolution = Trials(learner(function, space, size))
    keys = trial_keys(2, "evolution", runs)
    start = eqx.filter_jit(evolution.init)(keys)
    return train(evolution, keys, generations, state=start)


best_of_each = jax.vmap(best)


@pytest.fixture(scope="module")
def solved():
    return evolved(sphere, 150)


def test_it_finds_the_top_of_a_hill_in_every_run(solved):
    genome, fitness = best_of_each(solved.state)
    assert fitness.min() > -0.05  # a random genome has -0.4
    np.testing.assert_allclose(sphere(genome), fitness, rtol=1e-5)


def test_the_best_is_never_lost(solved):
    assert (np.diff(solved.metrics["best"], axis=0) >= 0).all()
    assert (solved.metrics["mean"] <= solved.metrics["best"] + 1e-6).all()


def test_a_run_does_not_depend_on_the_others(solved):
    alone = evolved(sphere, 150, runs=1).state
    np.testing.assert_array_equal(alone.genome[0], solved.state.genome[0])


def test_newcomers_climb_out_of_a_trap_where_the_old_alone_do_not():
    """What age is for: one gene that nearly always leads away from the best.

    Mutants move by 0.01: none gets from the wrong hill, below 0.9, to the right one above it.
    """
    space = SearchSpace(np.zeros(1), np.ones(1), np.zeros(1), np.ones(1))
    small = Trials(learner(trap, space, size=4, mutation_scale=0.01))
    keys = trial_keys(3, "evolution", 20)
    one = Population(
        genome=jnp.full((4, 1), 0.1, float),
        age=jnp.zeros(4, int),
        fitness=jnp.full(4, 0.7, float),
        diverged=jnp.int32(0),
    )
    start = jax.tree.map(lambda part: jnp.stack([part] * 20), one)
    end = train(small, keys, 60, state=start).state
    assert (best_of_each(end)[1] == 1.0).mean() > 0.9


def test_genes_keep_to_their_limits():
    population = evolved(lambda genome: genome.sum(-1), 60).state
    assert population.genome.max() == np.float32(1.2)
    assert best_of_each(population)[1].min() > GENES * 1.0, "beyond where genes are drawn"


class Diverging(eqx.Module):
    """Fitness of which the first three candidates have none."""

    deterministic: bool = eqx.field(static=True, default=True)

    def __call__(self, key, genomes):
        del key
        fitness = genomes[:, 0].at[0].set(jnp.nan).at[1].set(jnp.inf)
        return Evaluation(fitness, jnp.zeros(fitness.shape, bool).at[2].set(True))


def test_who_diverges_is_the_worst_is_counted_and_stays_out_of_the_mean():
    evolution = AgeFitness(LIMITED, Diverging(), population_size=SIZE)
    key = jax.random.key(0)
    population = eqx.filter_jit(evolution.init)(key)
    np.testing.assert_array_equal(population.fitness[:3], np.float32(WORST_FITNESS))
    metrics = evolution.metrics(population)
    assert metrics["diverged"] == 3
    np.testing.assert_allclose(metrics["mean"], population.genome[3:, 0].mean(), rtol=1e-6)
    after, metrics = eqx.filter_jit(evolution.update)(key, population)
    assert metrics["diverged"] == 3
    assert jnp.isfinite(after.fitness).all()
    assert (after.fitness[:3] > WORST_FITNESS).all(), "those that diverged come last"


def test_where_all_diverge_the_mean_is_nought_and_evolution_goes_on():
    evolution = learner(lambda genome: jnp.nan * genome.sum(-1))
    key = jax.random.key(0)
    population = eqx.filter_jit(evolution.init)(key)
    _, metrics = eqx.filter_jit(evolution.update)(key, population)
    assert metrics["mean"] == 0
    assert metrics["diverged"] == SIZE + 1


def test_without_mutation_children_are_their_parents_and_newcomers_are_new():
    evolution = learner(sphere, mutation_probability=0.0)
    key = jax.random.key(0)
    population = evolution.init(key)
    candidates = evolution.ask(key, population)
    np.testing.assert_array_equal(candidates[:-1], population.genome)
    assert not (candidates[-1:] == population.genome).any()


class Noisy(eqx.Module):
    """The first gene, and a draw for all alike: the old cannot live on a lucky one."""

    deterministic: bool = eqx.field(static=True, default=False)

    def __call__(self, key, genomes):
        fitness = genomes[:, 0] + jax.random.normal(key)
        return Evaluation(fitness, jnp.zeros(len(genomes), bool))


def test_who_stays_is_evaluated_again_where_fitness_is_not_deterministic():
    evolution = AgeFitness(LIMITED, Noisy(), population_size=SIZE)
    update = eqx.filter_jit(evolution.update)
    population, draws = evolution.init(jax.random.key(0)), set()
    for generation in range(3):
        population, _ = update(jax.random.key(generation), population)
        draw = np.asarray(population.fitness - population.genome[:, 0])
        np.testing.assert_allclose(draw, draw[0], atol=1e-6)
        draws.add(round(float(draw[0]), 4))
    assert population.age.max() > 0, "some have stayed"
    assert len(draws) == 3


def test_a_fitness_that_does_not_say_whether_it_is_deterministic_is_refused():
    with pytest.raises(InvalidSettings, match="does not say whether it is deterministic"):
        AgeFitness(LIMITED, Of(sphere, deterministic=None))


def test_a_policy_is_made_of_the_fittest_by_the_fitness_or_refused():
    class Acting(Of):
        def policy(self, genome):
            return lambda key, observation: {"robot": genome}

    acting = AgeFitness(LIMITED, Acting(sphere), population_size=SIZE)
    population = acting.init(jax.random.key(0))
    action = acting.policy(population, explore=True)(jax.random.key(0), {})
    np.testing.assert_array_equal(action["robot"], best(population)[0])
    with pytest.raises(EthogramError, match="Of makes no policy of a genome"):
        learner(sphere).policy(population)


# Fronts


@jax.jit
def peeled(fitness, age):
    return fronts(dominance(fitness, age))


def test_fronts_worked_by_hand():
    # fitness and age; 0 and 1 tie in all, 2 is younger, 3 is worse than both, 4 worse than 3
    fitness, age = jnp.array([5.0, 5.0, 3.0, 4.0, 2.0]), jnp.array([2, 2, 0, 3, 3])
    assert peeled(fitness, age).tolist() == [0, 0, 0, 1, 2]


@given(
    st.lists(st.tuples(st.integers(-3, 3), st.integers(0, 4)), min_size=6, max_size=6),
)
def test_fronts_are_those_of_peeling_one_by_one(individuals):
    everyone = [oracle.Individual(None, age, float(fitness)) for fitness, age in individuals]
    expected = np.empty(len(everyone), int)
    for number, front in enumerate(oracle.fronts(everyone)):
        expected[front] = number
    fitness, age = (jnp.array(column) for column in zip(*individuals, strict=True))
    assert peeled(fitness.astype(float), age).tolist() == expected.tolist()


# Settings


@pytest.mark.parametrize(
    "settings", [{"population_size": 0}, {"mutation_scale": -1.0}, {"mutation_probability": 1.5}]
)
def test_settings_out_of_range_are_refused_by_name(settings):
    with pytest.raises(InvalidSettings, match=next(iter(settings))):
        AgeFitness(LIMITED, Of(sphere), **settings)
