import equinox as eqx
import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from tests.oracles import age_fitness as oracle

from ethogram.core.errors import InvalidSettings
from ethogram.core.keys import fold_in, trial_keys
from ethogram.learners.evolution import WORST, AgeFitness, Evaluated, Genes, Population, best
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


LIMITED = Genes(*(np.full(GENES, bound) for bound in (0.0, 1.0, -0.2, 1.2)))


def learner(function, genes=LIMITED, size=SIZE, **settings):
    def evaluate(candidates):
        fitness = function(candidates)
        return Evaluated(fitness, jnp.zeros(fitness.shape, bool))

    return AgeFitness(genes, evaluate, population=size, **settings)


@pytest.mark.parametrize("function", [sphere, trap, nowhere])
def test_every_generation_of_every_run_is_that_of_the_plain_version(function):
    keys = trial_keys(1, "evolution", RUNS)
    evolution = learner(function)
    population, _ = eqx.filter_jit(evolution.init)(keys)
    update = eqx.filter_jit(evolution.update)
    low, high, lowest, highest = (
        np.asarray(getattr(LIMITED, name)) for name in ("low", "high", "lowest", "highest")
    )
    evaluate = jax.jit(function)
    plain = [oracle.first(key, evaluate, low, high, SIZE) for key in keys]
    compare(population, plain)
    for generation in range(GENERATIONS):
        at = fold_in(keys, generation)
        population, metrics = update(at, population)
        plain = [
            oracle.next_generation(key, one, evaluate, low, high, lowest, highest)
            for key, one in zip(at, plain, strict=True)
        ]
        compare(population, plain)
        fittest = [max(one, key=lambda individual: individual.fitness) for one in plain]
        np.testing.assert_allclose(metrics["best"], [one.fitness for one in fittest], rtol=1e-6)
    assert np.ptp(population.age) >= 3, "old and young are among them"


def compare(population, plain):
    for run, individuals in enumerate(plain):
        genome = np.stack([one.genome for one in individuals])
        np.testing.assert_allclose(population.genome[run], genome, rtol=1e-6, atol=1e-7)
        np.testing.assert_array_equal(population.age[run], [one.age for one in individuals])
        fitness = [one.fitness for one in individuals]
        np.testing.assert_allclose(population.fitness[run], fitness, rtol=1e-5, atol=1e-6)


def evolved(function, generations, genes=LIMITED, size=SIZE, runs=RUNS):
    evolution = learner(function, genes, size)
    keys = trial_keys(2, "evolution", runs)
    population, _ = eqx.filter_jit(evolution.init)(keys)
    metrics = []
    population = train(
        evolution,
        keys,
        population,
        generations,
        after_chunk=lambda done, learned, found: metrics.append(found),
    )
    return population, {name: np.concatenate([m[name] for m in metrics]) for name in metrics[0]}


@pytest.fixture(scope="module")
def solved():
    return evolved(sphere, 150)


def test_it_finds_the_top_of_a_hill_in_every_run(solved):
    genome, fitness = best(solved[0])
    assert fitness.min() > -0.05  # a random genome has -0.4
    np.testing.assert_allclose(sphere(genome), fitness, rtol=1e-5)


def test_the_best_is_never_lost(solved):
    assert (np.diff(solved[1]["best"], axis=0) >= 0).all()
    assert (solved[1]["mean"] <= solved[1]["best"] + 1e-6).all()


def test_a_run_does_not_depend_on_the_others(solved):
    alone, _ = evolved(sphere, 150, runs=1)
    np.testing.assert_array_equal(alone.genome[0], solved[0].genome[0])


def test_newcomers_climb_out_of_a_trap_where_the_old_alone_do_not():
    """What age is for: one gene that nearly always leads away from the best.

    Mutants move by 0.01: none gets from the wrong hill, below 0.9, to the right one above it.
    """
    genes = Genes(np.zeros(1), np.ones(1), np.zeros(1), np.ones(1))
    small = learner(trap, genes, size=4, mutation_scale=0.01)
    keys = trial_keys(3, "evolution", 20)
    start = Population(
        genome=jnp.full((20, 4, 1), 0.1),
        age=jnp.zeros((20, 4), int),
        fitness=jnp.full((20, 4), 0.7),
    )
    end = train(small, keys, start, 60, after_chunk=lambda *_: None)
    assert (best(end)[1] == 1.0).mean() > 0.9


def test_genes_keep_to_their_limits():
    population, _ = evolved(lambda genome: genome.sum(-1), 60)
    assert population.genome.max() == np.float32(1.2)
    assert best(population)[1].min() > GENES * 1.0, "beyond where genes are drawn"


def test_who_breaks_is_the_worst_is_counted_and_stays_out_of_the_mean():
    def evaluate(candidates):
        fitness = candidates[..., 0].at[:, 0].set(jnp.nan).at[:, 1].set(jnp.inf)
        return Evaluated(fitness, jnp.zeros(fitness.shape, bool).at[:, 2].set(True))

    evolution = AgeFitness(LIMITED, evaluate, population=SIZE)
    keys = trial_keys(0, "evolution", RUNS)
    population, metrics = eqx.filter_jit(evolution.init)(keys)
    np.testing.assert_array_equal(population.fitness[:, :3], np.float32(WORST))
    np.testing.assert_array_equal(metrics["broken"], 3)
    np.testing.assert_allclose(metrics["mean"], population.genome[:, 3:, 0].mean(1), rtol=1e-6)
    after, metrics = eqx.filter_jit(evolution.update)(fold_in(keys, 0), population)
    np.testing.assert_array_equal(metrics["broken"], 3)
    assert jnp.isfinite(after.fitness).all()
    assert (after.fitness[:, :3] > WORST).all(), "those that broke come last"


def test_where_all_break_the_mean_is_nought_and_evolution_goes_on():
    evolution = learner(lambda genome: jnp.nan * genome.sum(-1))
    keys = trial_keys(0, "evolution", RUNS)
    population, _ = eqx.filter_jit(evolution.init)(keys)
    _, metrics = eqx.filter_jit(evolution.update)(fold_in(keys, 0), population)
    np.testing.assert_array_equal(metrics["mean"], 0)
    np.testing.assert_array_equal(metrics["broken"], SIZE + 1)


def test_without_mutation_children_are_their_parents_and_newcomers_are_new():
    evolution = learner(sphere, mutation_probability=0.0)
    keys = trial_keys(0, "evolution", RUNS)
    population, _ = evolution.init(keys)
    candidates = evolution.ask(keys, population)
    np.testing.assert_array_equal(candidates[:, :-1], population.genome)
    assert not (candidates[:, -1:] == population.genome).any()


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
    ("bounds", "message"),
    [
        (([0.0, 1.0], [1.0, 0.5], [0.0, 0.0], [1.0, 1.0]), "gene 1 is drawn from 1.0 to 0.5"),
        (([0.0], [1.0], [0.5], [1.0]), "gene 0 .* limited to 0.5 to 1.0"),
        (([0.0], [np.inf], [0.0], [np.inf]), "gene 0 .* finite"),
        (([0.0], [1.0, 1.0], [0.0], [1.0]), "one range for each gene"),
        (([], [], [], []), "at least one"),
    ],
)
def test_ranges_that_no_gene_fits_are_refused(bounds, message):
    with pytest.raises(InvalidSettings, match=message):
        Genes(*map(np.array, bounds))


@pytest.mark.parametrize(
    "settings", [{"population": 0}, {"mutation_scale": -1.0}, {"mutation_probability": 1.5}]
)
def test_settings_out_of_range_are_refused_by_name(settings):
    with pytest.raises(InvalidSettings, match=next(iter(settings))):
        AgeFitness(LIMITED, sphere, **settings)
