import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.learners.landscapes import Of, space, sphere
from tests.oracles import map_elites as oracle

from ethogram.core.errors import InvalidSettings, TooLarge
from ethogram.core.keys import fold_in, trial_keys
from ethogram.learners.base import Trials
from ethogram.learners.evolution import WORST_FITNESS, Evaluation, MAPElites, best
from ethogram.learners.evolution.map_elites import drawn_where
from ethogram.learners.train import train

RUNS, GENES, CELLS, BATCH, UPDATES = 2, 3, 4, 6, 12
LIMITED = space(GENES, lower=-0.2, upper=1.2)
KEY = jax.random.key(0)


def hill(genome):
    """Best at a half everywhere; in steps, so that some tie."""
    return -jnp.round(((genome - 0.5) ** 2).sum(-1), 1)


class Described(eqx.Module):
    """Genomes behave as their first two genes say."""

    function: object = eqx.field(static=True, default=hill)
    deterministic: bool = eqx.field(static=True, default=True)

    def __call__(self, key, genomes):
        del key
        fitness = self.function(genomes)
        return Evaluation(fitness, jnp.zeros(fitness.shape, bool), genomes[:, :2])


def learner(fitness=None, **settings):
    small = {"cells": CELLS, "initial_size": BATCH, "batch_size": BATCH, "mutation_scale": 0.1}
    return MAPElites(LIMITED, Described() if fitness is None else fitness, **small | settings)


@pytest.mark.parametrize("line_scale", [0.0, 0.3])
def test_every_update_of_every_run_is_that_of_the_plain_version(line_scale):
    keys = trial_keys(1, "elites", RUNS)
    elites = Trials(learner(line_scale=line_scale))
    state, update = eqx.filter_jit(elites.init)(keys), eqx.filter_jit(elites.update)

    def evaluate(genome):
        return float(hill(jnp.asarray(genome))), genome[:2]

    plain = [oracle.Archive(LIMITED, CELLS) for _ in keys]
    for key, run in zip(keys, plain, strict=True):
        run.add(key, np.asarray(LIMITED.sample(key, BATCH)), evaluate)
    compare(state, plain)
    for number in range(UPDATES):
        at = fold_in(keys, number)
        state, metrics = update(at, state)
        for key, run in zip(at, plain, strict=True):
            for_offspring, for_ties = jax.random.split(key)
            run.add(for_ties, run.children(for_offspring, BATCH, 0.1, line_scale), evaluate)
        compare(state, plain)
        filled = [len(run.elites) / CELLS**2 for run in plain]
        np.testing.assert_allclose(metrics["coverage"], filled)
        score = [sum(elite[1] for elite in run.elites.values()) for run in plain]
        np.testing.assert_allclose(metrics["qd_score"], score, atol=1e-5)
    assert min(filled) > 0.4


def compare(state, plain):
    for number, run in enumerate(plain):
        cells = [cell[0] * CELLS + cell[1] for cell in run.numbered()]
        assert np.flatnonzero(state.filled[number]).tolist() == cells
        elites = [run.elites[cell] for cell in run.numbered()]
        for part, expected in zip(
            (state.genome, state.fitness, state.descriptor), zip(*elites, strict=True), strict=True
        ):
            np.testing.assert_allclose(part[number][np.array(cells)], expected, atol=1e-6)


def told(elites, state, genomes):
    genomes = jnp.asarray(genomes, jnp.float32)
    return elites.tell(KEY, state, genomes, elites.fitness(KEY, genomes))


@pytest.fixture(scope="module")
def empty():
    """An archive of one descriptor's four cells and nobody in it."""
    elites = learner(Described(lambda genome: jnp.nan * genome.sum(-1)))
    state = elites.init(KEY)
    assert not state.filled.any()
    return state


def test_a_cell_keeps_the_fittest_of_a_batch_and_the_first_of_those_as_fit(empty):
    elites = learner(Described(lambda genome: genome[:, 2]))
    state = told(elites, empty, [[0.1, 0.1, 0.3], [0.2, 0.2, 0.7], [0.9, 0.1, 0.5]])
    assert np.flatnonzero(state.filled).tolist() == [0, 12]
    np.testing.assert_allclose(state.fitness[jnp.array([0, 12])], [0.7, 0.5])
    np.testing.assert_allclose(state.descriptor[0], [0.2, 0.2])
    after = told(elites, state, [[0.05, 0.05, 0.7], [0.9, 0.1, 0.6], [0.9, 0.1, 0.4]])
    np.testing.assert_allclose(after.genome[0], [0.2, 0.2, 0.7], rtol=1e-6)
    np.testing.assert_allclose(after.fitness[12], 0.6, rtol=1e-6)
    assert best(after)[1] == np.float32(0.7)


def test_descriptors_fall_into_equal_cells_and_beyond_the_limits_into_those_at_the_border():
    elites = learner(descriptor_low=-1.0, descriptor_high=1.0)
    places = [-9.0, -1.0, -0.51, -0.5, 0.0, 0.49, 0.5, 1.0, 9.0]
    descriptor = jnp.stack([jnp.full(9, -1.0), jnp.array(places)], -1)
    assert elites.cell_of(descriptor).tolist() == [0, 0, 0, 1, 2, 2, 3, 3, 3]
    assert elites.cell_of(descriptor[:, ::-1]).tolist() == [0, 0, 0, 4, 8, 8, 12, 12, 12]


def test_who_diverges_or_has_no_descriptor_enters_no_cell(empty):
    class Broken(Described):
        def __call__(self, key, genomes):
            found = super().__call__(key, genomes)
            return Evaluation(
                found.fitness.at[0].set(jnp.nan),
                found.diverged.at[1].set(True),
                found.descriptor.at[2, 0].set(jnp.nan),
            )

    elites = learner(Broken(), batch_size=4)
    state = told(elites, empty, [[0.1, 0.1, 0.1], [0.4, 0.1, 0.1], [0.6, 0.1, 0.1], [0.9] * 3])
    assert np.flatnonzero(state.filled).tolist() == [15]
    assert elites.metrics(state)["diverged"] == 2


def test_where_nobody_is_sound_genomes_are_drawn_anew(empty):
    elites = learner(batch_size=50)
    candidates = elites.ask(KEY, empty)
    np.testing.assert_allclose(candidates.mean(0), 0.5, atol=0.15)
    metrics = elites.metrics(empty)
    assert (metrics["coverage"], metrics["qd_score"], metrics["mean"]) == (0, 0, 0)
    assert metrics["best"] == np.float32(WORST_FITNESS)


def test_parents_are_drawn_from_all_filled_cells_alike():
    flags = jnp.array([False, True, False, True, True])
    drawn = np.bincount(drawn_where(KEY, flags, 3000), minlength=5)
    assert drawn[[0, 2]].tolist() == [0, 0]
    np.testing.assert_allclose(drawn[[1, 3, 4]], 1000, atol=130)  # 5 standard deviations


def test_it_fills_its_map_and_finds_the_best_of_every_cell():
    elites = learner(Described(sphere), cells=3, batch_size=50, line_scale=0.2)
    state, metrics = train(elites, KEY, 150)
    assert metrics["coverage"][-1] == 1
    assert (np.diff(metrics["qd_score"][metrics["coverage"] == 1]) >= 0).all()
    # the best of a cell is its corner nearest to 0, with nothing in the third gene
    nearest = -np.array([[a**2 + b**2 for b in (0, 1 / 3, 2 / 3)] for a in (0, 1 / 3, 2 / 3)])
    np.testing.assert_allclose(state.fitness.reshape(3, 3), nearest, atol=0.06)


def test_a_fitness_that_describes_nothing_is_refused_by_name():
    with pytest.raises(InvalidSettings, match="the fitness Of describes no behaviour"):
        learner(Of(sphere)).init(KEY)


def test_too_many_cells_are_refused(monkeypatch):
    with pytest.raises(InvalidSettings, match="cells = 10000 of each of 2 descriptors"):
        learner(cells=10_000).init(KEY)
    monkeypatch.setattr("ethogram.core.memory.available_memory", lambda: 1_000_000)
    with pytest.raises(TooLarge, match="MAP-Elites with 1,000,000 cells for 3 genes"):
        learner(cells=1000).init(KEY)


@pytest.mark.parametrize(
    "settings",
    [
        {"cells": 0},
        {"initial_size": 0},
        {"batch_size": 0},
        {"mutation_scale": -1.0},
        {"line_scale": -1.0},
        {"descriptor_high": 0.0},
    ],
)
def test_settings_out_of_range_are_refused_by_name(settings):
    with pytest.raises(InvalidSettings, match=next(iter(settings))):
        learner(**settings)
