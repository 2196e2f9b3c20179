import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.learners.landscapes import Diverging, Noisy, Of, flat, space
from tests.oracles import genetic as oracle

from ethogram.core.errors import EthogramError, InvalidSettings, TooLarge
from ethogram.core.keys import fold_in, trial_keys
from ethogram.learners.base import Trials
from ethogram.learners.evolution import WORST_FITNESS, Evaluation, Genetic, best
from ethogram.learners.evolution.genetic import tournaments
from ethogram.learners.train import train

RUNS, SIZE, CHILDREN, GENES, GENERATIONS = 3, 6, 8, 4, 10
LIMITED = space(GENES, lower=-0.2, upper=1.2)
KEY = jax.random.key(0)


def hill(genome):
    """Best at a half everywhere; in steps, lest the last bits tell apart who is the same."""
    return -jnp.round(((genome - 0.5) ** 2).sum(-1), 4)


def learner(fitness, **settings):
    small = {"population_size": SIZE, "children": CHILDREN, "tournament_size": 3}
    return Genetic(LIMITED, fitness, **small | {"mutation_scale": 0.3} | settings)


@pytest.mark.parametrize("function", [hill, flat])
def test_every_generation_of_every_run_is_that_of_the_plain_version(function):
    keys = trial_keys(1, "genetic", RUNS)
    genetic = Trials(learner(Of(function)))
    state, update = eqx.filter_jit(genetic.init)(keys), eqx.filter_jit(genetic.update)
    evaluate = jax.jit(function)
    plain = [oracle.first(key, evaluate, LIMITED, SIZE) for key in keys]
    fittest = [max(one.fitness for one in run) for run in plain]
    for generation in range(GENERATIONS):
        at = fold_in(keys, generation)
        state, metrics = update(at, state)
        plain = [
            oracle.next_generation(key, run, evaluate, LIMITED, CHILDREN, 3, 0.8, 0.3)
            for key, run in zip(at, plain, strict=True)
        ]
        for number, run in enumerate(plain):
            genome, fitness = (np.stack(column) for column in zip(*run, strict=True))
            np.testing.assert_allclose(state.genome[number], genome, rtol=1e-6, atol=1e-7)
            np.testing.assert_allclose(state.fitness[number], fitness, rtol=1e-5, atol=1e-6)
        fittest = [max(ever, run[0].fitness) for ever, run in zip(fittest, plain, strict=True)]
        np.testing.assert_allclose(metrics["best"], fittest, rtol=1e-6)
    alone = Trials(learner(Of(function)))
    single = train(alone, keys[:1], GENERATIONS, state=eqx.filter_jit(alone.init)(keys[:1])).state
    np.testing.assert_array_equal(single.genome[0], state.genome[0])


def test_the_defaults_are_those_of_the_thesis():
    genetic = Genetic(LIMITED, Of(hill))
    assert (genetic.population_size, genetic.children, genetic.tournament_size) == (1000, 1000, 10)
    assert genetic.crossover_probability == np.float32(0.8)
    assert genetic.mutation_scale == np.float32(0.01)


def test_it_climbs_a_hill_and_never_loses_its_best():
    genetic = learner(Of(hill), mutation_scale=0.05)
    state, metrics = train(genetic, KEY, 100)
    assert (np.diff(metrics["best"]) >= 0).all()
    assert metrics["best"][-1] > -0.01
    genome, fitness = best(state)
    np.testing.assert_allclose(hill(genome), fitness, rtol=1e-5)


def test_large_tournaments_are_won_by_the_fittest_and_those_of_one_by_anyone():
    fitness = jnp.array([0.0, 3.0, 1.0, 2.0])
    assert (tournaments(KEY, fitness, 50, 100) == 1).all()
    won = np.bincount(tournaments(KEY, fitness, 4000, 1), minlength=4)
    np.testing.assert_allclose(won, 1000, atol=150)  # 5 standard deviations
    # who wins of two: (2 r + 1) in 16, r the number of those less fit
    won = np.bincount(tournaments(KEY, fitness, 4000, 2), minlength=4)
    np.testing.assert_allclose(won, [250, 1750, 750, 1250], atol=160)


def test_a_child_has_each_gene_of_one_parent_or_is_a_mutant_of_all_genes():
    crossed = learner(Of(hill), crossover_probability=1.0)
    state = crossed.init(KEY)
    child = crossed.ask(KEY, state)
    assert (child[:, None] == state.genome).any(1).all()
    assert not (child[:, None] == state.genome).all(2).any(1).all(), "not all are copies"
    mutants = learner(Of(hill), crossover_probability=0.0).ask(KEY, state)
    inside = (mutants > -0.2) & (mutants < 1.2)
    assert not (mutants[:, None] == state.genome).any(1)[inside].any()
    assert ((mutants >= np.float32(-0.2)) & (mutants <= np.float32(1.2))).all()


def test_who_diverges_is_the_worst_is_counted_and_stays_out_of_the_mean():
    genetic = learner(Diverging())
    state = genetic.init(KEY)
    np.testing.assert_array_equal(state.fitness[:3], np.float32(WORST_FITNESS))
    metrics = genetic.metrics(state)
    assert metrics["diverged"] == 3
    np.testing.assert_allclose(metrics["mean"], state.genome[3:, 0].mean(), rtol=1e-6)
    after, metrics = eqx.filter_jit(genetic.update)(KEY, state)
    assert metrics["diverged"] == 3
    assert (after.fitness > WORST_FITNESS).all()
    assert jnp.isfinite(metrics["best"])


def test_who_stays_is_evaluated_again_where_fitness_is_not_deterministic():
    genetic = learner(Noisy())
    state, update = genetic.init(KEY), eqx.filter_jit(genetic.update)
    for generation in range(3):
        ever = state.best_ever.fitness
        state, _ = update(jax.random.key(generation), state)
        draw = np.asarray(state.fitness - state.genome[:, 0])
        np.testing.assert_allclose(draw, draw[0], atol=1e-6)
        assert state.best_ever.fitness >= ever


def test_a_fitness_that_makes_no_policies_is_refused_where_one_is_asked_for():
    genetic = learner(Of(hill))
    with pytest.raises(EthogramError, match="Of makes no policy of a genome"):
        genetic.policy(genetic.init(KEY))


def test_what_does_not_fit_is_refused_with_its_size(monkeypatch):
    monkeypatch.setattr("ethogram.core.memory.available_memory", lambda: 1_000_000)
    with pytest.raises(TooLarge, match=r"Evolution of 1,000 individuals and 100,000 children of 4"):
        Genetic(LIMITED, Of(hill), children=100_000).init(KEY)


@pytest.mark.parametrize(
    "settings",
    [
        {"population_size": 0},
        {"children": 0},
        {"tournament_size": 0},
        {"crossover_probability": 1.5},
        {"mutation_scale": -1.0},
    ],
)
def test_settings_out_of_range_are_refused_by_name(settings):
    with pytest.raises(InvalidSettings, match=next(iter(settings))):
        Genetic(LIMITED, Of(hill), **settings)


@pytest.mark.parametrize(
    "found",
    [Evaluation(jnp.zeros(SIZE - 1), jnp.zeros(SIZE - 1, bool)), jnp.zeros(SIZE)],
    ids=["one too few", "an array"],
)
def test_a_fitness_that_is_no_evaluation_of_all_candidates_is_refused(found):
    class Odd(eqx.Module):
        deterministic: bool = eqx.field(static=True, default=True)

        def __call__(self, key, genomes):
            del key, genomes
            return found

    with pytest.raises(InvalidSettings, match=r"fitness Odd gives .* the shape \(6,\)"):
        learner(Odd()).init(KEY)
