import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.learners.landscapes import Diverging, Of, flat, rosenbrock, space, sphere
from tests.oracles import cmaes as oracle

from ethogram.core.errors import InvalidSettings, TooLarge
from ethogram.core.keys import fold_in, trial_keys
from ethogram.learners.base import Trials
from ethogram.learners.evolution import CMAES, WORST_FITNESS, best
from ethogram.learners.evolution.base import best_first
from ethogram.learners.evolution.cmaes import LARGEST_GROWTH, PRESETS, renewed
from ethogram.learners.evolution.cmaes_covariance import Full, Separable
from ethogram.learners.evolution.cmaes_parameters import parameters
from ethogram.learners.evolution.cmaes_restarts import patience
from ethogram.learners.train import train

GENES, RUNS = 5, 3
KEY = jax.random.key(0)
OPEN = space(GENES)


@pytest.mark.parametrize("covariance", ["full", "separable"])
@pytest.mark.parametrize("active", [True, False])
def test_generations_of_every_run_are_those_of_the_tutorial(covariance, active):
    keys = trial_keys(1, "cmaes", RUNS)
    learner = CMAES(OPEN, Of(rosenbrock), sigma0=0.3, covariance=covariance, active=active)
    trials, size = Trials(learner), 8
    state, update = eqx.filter_jit(trials.init)(keys), eqx.filter_jit(trials.update)
    settings = {"separable": covariance == "separable", "active": active}
    plain = [oracle.CMAES(mean, 0.3, size, **settings) for mean in np.asarray(state.mean)]
    fittest = np.full(RUNS, -np.inf)
    for generation in range(4):
        at = fold_in(keys, generation)
        state, metrics = update(at, state)
        for number, (key, run) in enumerate(zip(at, plain, strict=True)):
            for_offspring, _ = jax.random.split(key)
            z = np.asarray(jax.random.normal(for_offspring, (size, GENES)), float)
            candidates = run.generation(z, rosenbrock)
            fittest[number] = max(fittest[number], *(rosenbrock(x) for x in candidates))
            found = jax.tree.map(lambda part, number=number: part[number], state)
            matrix = found.covariance
            matrix = jnp.diag(matrix.diagonal) if settings["separable"] else matrix.matrix
            for mine, theirs in (
                (found.mean, run.mean),
                (found.sigma, run.sigma),
                (found.sigma_path, run.p_sigma),
                (found.path, run.p_c),
                (matrix, run.C),
            ):
                np.testing.assert_allclose(mine, theirs, rtol=1e-5, atol=2e-6)
        np.testing.assert_allclose(metrics["best"], fittest, rtol=1e-5)
    genome, fitness = jax.vmap(best)(state)
    np.testing.assert_allclose(rosenbrock(genome), fitness, rtol=1e-4)


def test_parameters_of_ten_genes_are_those_worked_out_by_hand():
    found = parameters(10, 10, "full", active=True)
    # ln 5.5 - ln 1..5 is 1.7047, 1.0116, 0.6061, 0.3185, 0.0953, in all 3.7362
    np.testing.assert_allclose(
        found.weights[:5], [0.4563, 0.2708, 0.1622, 0.0852, 0.0255], atol=1e-4
    )
    assert found.effective_parents == pytest.approx(3.1673, abs=1e-4)
    assert found.c_sigma == pytest.approx(5.1673 / 18.1673, abs=1e-4)
    assert found.c_1 == pytest.approx(2 / (127.69 + 3.1673), abs=1e-6)
    assert found.c_mu == pytest.approx(2 * (1.1673 + 0.31573) / (144 + 3.1673), abs=1e-5)
    assert found.weights[5:].sum() == pytest.approx(-min(1 + found.c_1 / found.c_mu, 1.4, 9), 0.4)
    separable = parameters(10, 10, "separable", active=False)
    assert (separable.c_1, separable.c_mu) == pytest.approx((4 * found.c_1, 4 * found.c_mu))
    assert (separable.weights[5:] == 0).all()


@pytest.mark.parametrize("covariance", ["full", "separable", "isotropic"])
@pytest.mark.parametrize(
    ("genes", "size"), [(1, 2), (1, 7), (2, 3), (40, 15), (5252, 29), (3, 500)]
)
def test_parameters_keep_the_covariance_positive_definite(covariance, genes, size):
    found = parameters(genes, size, covariance, active=True)
    assert (np.diff(found.weights) <= 0).all()
    assert found.weights[found.weights > 0].sum() == pytest.approx(1)
    assert 0 <= found.c_1 <= 1
    assert 0 <= found.c_mu <= 1 - found.c_1
    negative = -found.weights[found.weights < 0].sum()
    assert found.c_mu * genes * negative <= 1 - found.c_1 - found.c_mu + 1e-12
    assert found.gap >= 1


def test_candidates_that_tie_have_ranks_of_their_own_drawn_at_random():
    fitness = jnp.array([1.0, 2.0, 1.0, 1.0])
    orders = {tuple(best_first(key, fitness).tolist()) for key in jax.random.split(KEY, 60)}
    assert len(orders) == 6, "every order of the three that tie"
    assert all(order[0] == 1 for order in orders)
    learner = CMAES(OPEN, Of(flat))
    state = learner.init(KEY)
    candidates = learner.ask(KEY, state)
    after = learner.tell(KEY, state, candidates, learner.evaluate(KEY, candidates))
    order = best_first(KEY, jnp.zeros(8))
    weights = np.maximum(learner.parameters.weights, 0)
    step = weights @ np.asarray(candidates - state.mean)[order]
    np.testing.assert_allclose(after.mean, state.mean + step, rtol=1e-5, atol=1e-6)
    assert abs(step).max() > 0.05, "weights that are shared would hardly move the mean"


@pytest.mark.parametrize(("tied", "grows"), [(6, True), (5, False)])
def test_sigma_grows_where_at_least_seven_of_ten_tie_for_the_best(tied, grows):
    """6 of 8 is the least count that is 0.7 of them."""
    learner = CMAES(OPEN, Of(flat), flat_share=0.7)
    state = learner.init(KEY)
    candidates = learner.ask(KEY, state)
    evaluation = learner.evaluate(KEY, candidates)
    evaluation = dataclasses.replace(
        evaluation, fitness=jnp.where(jnp.arange(8) < tied, 1.0, -jnp.arange(8.0))
    )
    never = dataclasses.replace(learner, flat_share=None)
    ratio = (
        learner.tell(KEY, state, candidates, evaluation).sigma
        / never.tell(KEY, state, candidates, evaluation).sigma
    )
    of = learner.parameters
    factor = np.exp(0.2 + of.c_sigma / of.d_sigma)
    assert ratio == pytest.approx(factor if grows else 1.0, rel=1e-6)


def test_sigma_does_not_grow_for_candidates_that_have_all_diverged():
    learner = CMAES(OPEN, Of(lambda genome: jnp.nan * genome.sum(-1)), flat_share=0.7)
    state, metrics = train(learner, KEY, 40)
    assert state.sigma < 5
    assert (metrics["diverged"] == 8).all()
    assert (metrics["mean"] == 0).all()
    assert metrics["best"][-1] == np.float32(WORST_FITNESS)


def test_who_diverges_comes_last_is_counted_and_stays_out_of_the_mean():
    learner = CMAES(OPEN, Diverging())
    state = learner.init(KEY)
    candidates = learner.ask(KEY, state)
    after = learner.tell(KEY, state, candidates, learner.fitness(KEY, candidates))
    metrics = learner.metrics(after)
    assert metrics["diverged"] == 3
    np.testing.assert_allclose(metrics["mean"], candidates[3:, 0].mean(), rtol=1e-6)
    order = [*(3 + np.argsort(-candidates[3:, 0])), 0, 1, 2]
    step = np.maximum(learner.parameters.weights, 0) @ np.asarray(candidates - state.mean)[order]
    np.testing.assert_allclose(after.mean, state.mean + step, rtol=1e-5, atol=1e-6)


def test_a_covariance_is_decomposed_only_every_gap_generations_in_all_runs_at_once():
    learner = CMAES(space(60), Of(sphere), population_size=4)
    gap = learner.parameters.gap
    assert gap == 2
    trials, keys = Trials(learner), trial_keys(1, "cmaes", 2)
    state, update = eqx.filter_jit(trials.init)(keys), eqx.filter_jit(trials.update)
    for generation in range(2 * gap):
        before = state.covariance.vectors
        state, _ = update(fold_in(keys, generation), state)
        changed = (state.covariance.vectors != before).any((1, 2))
        assert (changed == ((generation + 1) % gap == 0)).all()
    program = jax.make_jaxpr(trials.update)(keys, state)
    assert " cond[" in str(program), "asked once for all runs, not computed for each and dropped"


def test_roots_of_a_covariance_are_those_of_the_matrix():
    matrix = jnp.array([[4.0, 1.0, 0.0], [1.0, 3.0, 0.5], [0.0, 0.5, 0.2]])
    full = dataclasses.replace(Full.identity(3), matrix=matrix).decomposed()
    root = full.scaled(jnp.eye(3))
    np.testing.assert_allclose(root @ root, matrix, atol=1e-5)
    np.testing.assert_allclose(full.whitened(root), jnp.eye(3), atol=1e-5)
    np.testing.assert_allclose(full.variances(), [4.0, 3.0, 0.2])
    separable = Separable(jnp.array([4.0, 9.0]))
    np.testing.assert_allclose(separable.scaled(jnp.ones(2)), [2.0, 3.0])
    np.testing.assert_allclose(separable.whitened(jnp.ones(2)), [1 / 2, 1 / 3])


def test_what_rounding_makes_of_a_covariance_stays_positive():
    matrix = jnp.array([[1.0, 1.0 + 1e-6], [1.0 + 1e-6, 1.0]])  # one eigenvalue is below 0
    full = dataclasses.replace(Full.identity(2), matrix=matrix).decomposed()
    assert full.values.min() == pytest.approx(2e-7, rel=1e-2)
    assert jnp.isfinite(full.whitened(jnp.ones(2))).all()


def test_a_covariance_out_of_range_changes_its_unit_and_draws_the_same_candidates():
    huge = dataclasses.replace(Full.identity(2), matrix=jnp.diag(jnp.array([4e10, 1e10])))
    found, unit = renewed(huge)
    np.testing.assert_allclose(unit, 2e5, rtol=1e-6)
    np.testing.assert_allclose(found.matrix, np.diag([1.0, 0.25]), rtol=1e-6)
    np.testing.assert_allclose(found.scaled(jnp.ones(2)) * unit, [2e5, 1e5], rtol=1e-5)
    assert renewed(Full.identity(2))[1] == 1


@pytest.mark.parametrize("covariance", ["full", "separable", "isotropic"])
def test_numbers_stay_finite_and_the_axes_short_where_fitness_has_no_top(covariance):
    learner = CMAES(space(2), Of(lambda genome: genome[:, 0]), covariance=covariance)
    state, metrics = train(learner, KEY, 1500)  # raises where they do not
    longest = state.sigma * jnp.sqrt(state.covariance.eigenvalues().max())
    assert longest <= 0.5 * LARGEST_GROWTH * 1.001
    assert metrics["best"][-1] > 1e5
    raised = CMAES(space(2), Of(flat), covariance=covariance, flat_share=0.7)
    end, _ = train(raised, KEY, 300)
    assert jnp.isfinite(end.mean).all()


def test_it_is_at_the_top_of_a_hill_and_never_loses_its_best():
    state, metrics = train(Trials(CMAES(OPEN, Of(sphere))), trial_keys(0, "hill", 3), 120)
    assert (np.diff(metrics["best"], axis=0) >= 0).all()
    assert metrics["best"][-1].min() > -1e-8
    np.testing.assert_allclose(sphere(jax.vmap(best)(state)[0]), state.best_ever.fitness, rtol=1e-4)


def test_a_run_is_the_same_alone_and_among_others():
    keys = trial_keys(0, "alone", 3)
    together, alone = (
        train(Trials(CMAES(OPEN, Of(sphere))), some, 10)[0].mean for some in (keys, keys[:1])
    )
    np.testing.assert_allclose(alone[0], together[0], rtol=1e-4, atol=1e-5)


def test_candidates_beyond_the_limits_are_put_on_them_and_the_top_on_a_limit_is_found():
    limited = space(3, lower=-0.1, upper=1.1)
    learner = CMAES(limited, Of(lambda genome: genome.sum(-1)))
    candidates = learner.ask(KEY, learner.init(KEY))
    assert ((candidates >= np.float32(-0.1)) & (candidates <= np.float32(1.1))).all()
    state, _ = train(learner, KEY, 60)
    np.testing.assert_allclose(best(state)[0], 1.1, rtol=1e-5)
    assert ((state.mean >= -0.1) & (state.mean <= 1.1001)).all()


def test_a_run_that_is_stuck_begins_anew_and_keeps_its_best():
    learner = CMAES(space(2), Of(flat), restarts=True)
    most = patience(2, 6)
    assert most == 110
    trials, keys = Trials(learner), trial_keys(0, "stuck", 2)
    state, metrics = train(trials, keys, most)
    assert (metrics["restarts"] == 0).all()
    assert (state.unimproved == most - 1).all()  # the first generation was an improvement
    after, _ = train(trials, keys, most + 1, state=state, start=most)
    assert (after.restarts == 1).all()
    assert (after.sigma == 0.5).all()
    assert (after.generation == 0).all()
    assert (after.generations == most + 1).all()
    assert ((after.mean >= 0) & (after.mean <= 1)).all()
    assert (after.best_ever.fitness == 0).all()


def test_only_the_run_that_is_over_begins_anew():
    learner = CMAES(space(2), Of(sphere), restarts=True)
    trials, keys = Trials(learner), trial_keys(0, "over", 2)
    state = trials.init(keys)
    stuck = jnp.array([0, 500]), jnp.array([WORST_FITNESS, 1.0])
    state = eqx.tree_at(lambda each: (each.unimproved, each.restart_fitness), state, stuck)
    after, metrics = eqx.filter_jit(trials.update)(keys, state)
    assert metrics["restarts"].tolist() == [0, 1]
    assert after.generation.tolist() == [1, 0]


def test_presets_and_defaults():
    modern = CMAES(OPEN, Of(sphere), **PRESETS["modern"])
    assert (modern.active, modern.flat_share, modern.restarts) == (True, None, False)
    thesis = CMAES(space(20), Of(sphere), **PRESETS["thesis"])
    assert (thesis.active, thesis.restarts, float(thesis.sigma0)) == (False, False, 0.5)
    assert thesis.flat_share == 0.7
    assert (thesis.parameters.weights.size, thesis.parameters.parents) == (12, 6)
    assert isinstance(thesis.init(KEY).covariance, Full)
    assert isinstance(CMAES(space(201), Of(sphere)).init(KEY).covariance, Separable)


def test_what_does_not_fit_is_refused_with_its_size(monkeypatch):
    monkeypatch.setattr("ethogram.core.memory.available_memory", lambda: 10_000_000)
    with pytest.raises(TooLarge, match=r"CMA-ES of 24 candidates of 1000 genes with a full cov"):
        CMAES(space(1000), Of(sphere), covariance="full").init(KEY)


@pytest.mark.parametrize(
    "settings",
    [{"population_size": 1}, {"sigma0": 0.0}, {"covariance": "round"}, {"flat_share": 0.0}],
)
def test_settings_out_of_range_are_refused_by_name(settings):
    with pytest.raises(InvalidSettings, match=next(iter(settings))):
        CMAES(OPEN, Of(sphere), **settings)
