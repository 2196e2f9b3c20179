import dataclasses
from functools import partial

import equinox as eqx
import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from tests.studies.contexts import Halted, Halting, Remembering
from tests.studies.fuzzing import MESSAGES, drawn, fuzz, misdrawn

from ethogram.campaign.context import Context
from ethogram.core.errors import InvalidSettings, TooLarge
from ethogram.core.scene import Scene
from ethogram.learners.evolution import WORST_FITNESS
from ethogram.learners.evolution.base import with_worst
from ethogram.physics import native
from ethogram.studies import sensing as study
from ethogram.studies import training
from ethogram.studies.sensing import compute
from ethogram.studies.sensing.plan import (
    Settings,
    condition_of,
    controller_of,
    training_starts,
    validation_starts,
    world_of,
)
from ethogram.studies.sensing.results import VALIDATED
from ethogram.worlds.softbody.gravity import schedule
from ethogram.worlds.softbody.simulation import simulate
from ethogram.worlds.softbody.starts import StartDistribution

# one case of the smoke plan, small; in all tests the same shapes, hence few compiled programs
SMALL = {"world.steps": 50, "world.body": "worm", "law": "unbounded", "surface": "uneven"}
ONE = [f"{key}={value}" for key, value in SMALL.items()]


def cases(plan, *changes):
    return study.cases(study.PLANS[plan].override(changes))


@pytest.fixture(scope="module", autouse=True)
def _checkpoint_after_every_generation():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training, "train", partial(training.train, seconds=0))
        yield


@pytest.fixture(scope="module")
def ran():
    """A case that was run, what it left behind, and its checkpoints."""
    (case,) = cases("smoke", *ONE)
    context = Remembering()
    return case, study.run(case, context), context.saved


def test_the_thesis_plan_is_section_5_4():
    found = cases("thesis")
    conditions = {condition_of(case.parsed(Settings)) for case in found}
    assert len(found) == len(conditions) == len({case.name for case in found}) == 18
    assert {(at.controller, at.law) for at in conditions} == {
        ("non-sensing", "shrink_limited"),
        ("sensing", "tanh"),
        ("sensing", "unbounded"),
    }
    evaluations = 0
    for case in found:
        chosen = case.parsed(Settings)
        learner = chosen.learner
        assert (chosen.trials, chosen.generations, chosen.world.steps) == (30, 200, 10_000)
        assert (learner.population_size, learner.mutation_probability) == (30, None)
        assert (learner.mutation_scale, chosen.world.frequency) == (1.0, 40.0)
        evaluations = learner.population_size + chosen.generations * (learner.population_size + 1)
    assert evaluations == 6230


def test_a_record_names_what_did_the_work_of_the_physics(monkeypatch):
    monkeypatch.setattr(native, "implementation", lambda kernel, _: f"{kernel} by hand")
    (case,) = cases("smoke", *ONE)
    context = Halting()
    with pytest.raises(Halted):
        study.run(case, context)
    assert context.kernels == {"beams3d": "beams3d by hand"}


def test_a_record_holds_what_the_pages_need(ran):
    case, record, _ = ran
    results, settings = record["results"], case.parsed(Settings)
    assert dict(results.sizes) == {
        "trial": settings.trials,
        "generation": settings.generations + 1,
        "gene": 51,
        "scenario": 4,
        "axis": 2,
        "sample": 2,
    }
    assert list(results.scenario.values) == ["fitness", "flat", "step", "sin"]
    assert results.attrs["layers"] == "####"
    assert (np.diff(results.fitness.values, axis=1) >= 0).all(), "the best is never lost"
    assert np.isfinite(results.distance.values).all()
    groups = ["scene", "scene-2", "scene-3"][: settings.trials]
    assert [group for group in record if group != "results"] == groups
    for group in groups:
        assert Scene.from_dataset(record[group]).position.shape == (2, 4, 3)


def test_the_first_trials_are_shown_in_their_order(ran):
    _, record, _ = ran
    first = record["results"].path.sel(scenario="fitness", axis="x").values[:, -1]
    shown = [
        record[group].position.values[-1, :, 0].mean() for group in record if group != "results"
    ]
    np.testing.assert_allclose(shown, first[: len(shown)], rtol=1e-4)


def test_the_best_travels_its_fitness_when_it_is_simulated_again(ran):
    _, record, _ = ran
    results = record["results"]
    last = results.fitness.values[:, -1]
    np.testing.assert_array_equal(results.distance.sel(scenario="fitness"), last)


def test_distances_and_paths_are_those_of_the_stored_genomes(ran):
    case, record, _ = ran
    results, settings = record["results"], case.parsed(Settings)
    world, controller = world_of(settings), controller_of(settings)
    for name, gravity in (("flat", "flat"), ("fitness", "evolution")):
        alone = eqx.filter_jit(simulate)(
            world,
            controller,
            jnp.asarray(results.genome.values.T),
            schedule(gravity, settings.world.steps),
        )
        np.testing.assert_array_equal(results.distance.sel(scenario=name), alone.distance)
    rest = results.path.sel(scenario="flat").isel(sample=0)
    np.testing.assert_allclose(rest.sel(axis="x"), 0.02, rtol=1e-6)  # the middle of 40 mm
    np.testing.assert_allclose(rest.sel(axis="z"), 0.005, rtol=1e-6)


@pytest.mark.parametrize("generation", [0, 1])
def test_a_run_taken_up_from_any_checkpoint_ends_with_the_same_bytes(ran, generation):
    case, record, saved = ran
    again = study.run(case, Remembering(saved[generation]))
    for name, array in record["results"].data_vars.items():
        np.testing.assert_array_equal(again["results"][name].values, array.values)


@pytest.fixture(scope="module")
def ran_from_starts():
    """The same case with a fitness over starts, and others to validate the best."""
    (case,) = cases("smoke", *ONE, "starts=2", "validation_starts=3")
    return case, study.run(case, Context())["results"]


def fitness_over(starts):
    """The fitness of four random worms over starts, and who diverged."""
    (case,) = cases("smoke", *ONE)
    made = compute.learner_of(case.parsed(Settings))
    fitness = eqx.tree_at(lambda at: at.starts, made.fitness, starts, is_leaf=lambda x: x is None)
    genomes = made.search_space.sample(jax.random.key(3), 4)
    return eqx.filter_jit(lambda fitness, genomes: fitness(jax.random.key(0), genomes))(
        fitness, genomes
    )


def test_the_fitness_over_equal_starts_is_that_of_one():
    start = StartDistribution().sample(jax.random.key(0), 1)
    four = jax.tree.map(lambda part: jnp.repeat(part, 4, -1), start)
    one, same = fitness_over(start), fitness_over(four)
    np.testing.assert_array_equal(one.fitness, same.fitness)
    assert np.ptp(one.fitness) > 0


def test_the_fitness_over_starts_is_the_mean_of_each():
    both = StartDistribution().sample(jax.random.key(0), 2)
    apart = [
        fitness_over(jax.tree.map(lambda part, at=at: part[..., at : at + 1], both)).fitness
        for at in range(2)
    ]
    np.testing.assert_allclose(fitness_over(both).fitness, np.mean(apart, 0), rtol=1e-5)


def test_who_diverges_from_one_start_is_the_worst():
    starts = StartDistribution().sample(jax.random.key(0), 2)
    starts = eqx.tree_at(lambda at: at.height, starts, starts.height.at[1].set(jnp.nan))
    found = with_worst(fitness_over(starts))
    assert found.diverged.all()
    np.testing.assert_array_equal(found.fitness, np.float32(WORST_FITNESS))


def test_one_start_is_the_one_at_rest_however_others_would_differ(ran):
    _, record, _ = ran
    (case,) = cases("smoke", *ONE, "starts=1", "start.height=0.002")
    again = study.run(case, Context())["results"]
    xr.testing.assert_identical(again, record["results"])
    assert "start" not in again.dims


def test_validation_starts_are_others_than_those_of_training():
    (case,) = cases("smoke", *ONE, "starts=5", "validation_starts=5")
    settings = case.parsed(Settings)
    seen, fresh = training_starts(settings), validation_starts(settings)
    assert not np.isin(fresh.phase, seen.phase).any()
    assert not np.isin(fresh.height, seen.height).any()


def test_the_best_is_validated_from_every_start_in_every_scenario(ran_from_starts):
    case, results = ran_from_starts
    settings = case.parsed(Settings)
    world, controller = world_of(settings), controller_of(settings)
    found = results[VALIDATED]
    assert dict(found.sizes) == {"trial": settings.trials, "scenario": 4, "start": 3}
    for trial, scenario, gravity in ((0, "flat", "flat"), (1, "fitness", "evolution")):
        alone = eqx.filter_jit(simulate)(
            world,
            controller,
            jnp.repeat(jnp.asarray(results.genome.values[trial])[:, None], 3, -1),
            schedule(gravity, settings.world.steps),
            start=validation_starts(settings),
        )
        there = found.isel(trial=trial).sel(scenario=scenario)
        np.testing.assert_array_equal(there, alone.distance)
    assert (np.diff(results.fitness.values, axis=1) >= 0).all(), "the best is never lost"


def test_what_does_not_fit_in_memory_is_refused_with_its_size():
    (case,) = cases("smoke", *ONE, "trials=100000", "learner.population_size=100000")
    with pytest.raises(TooLarge, match="worm"):
        study.run(case, Context())


def test_the_steps_between_two_records_must_divide_the_steps():
    with pytest.raises(InvalidSettings, match=r"record_every.*7.*50"):
        cases("smoke", *ONE, "record_every=7")


def test_a_body_that_falls_apart_is_refused_before_anything_runs():
    with pytest.raises(InvalidSettings, match=r"world\.body = .*in 2 parts .*in one part\.$"):
        cases("smoke", "world.body=#.#")


def test_a_body_is_one_case_however_it_is_written():
    one, other = (
        cases("smoke", f"world.body={body}", "law=tanh") for body in ("##/#.", "##\n#.\n")
    )
    assert one == other
    assert one[0].name == "11_10-tanh-even"


def test_the_work_of_a_case_grows_with_what_it_does():
    (small,), (more,) = cases("smoke", *ONE), cases("smoke", *ONE, "generations=2000")
    (over_starts,) = cases("smoke", *ONE, "starts=1000")
    small, more, over_starts = (
        study.cost(case).seconds - compute.COMPILE_SECONDS for case in (small, more, over_starts)
    )
    assert more > 5 * small
    assert over_starts > 5 * small


NUMBERS = {
    "generations": st.integers(1, 2),
    "learner.mutation_scale": st.floats(0.0, 10.0),
    "learner.mutation_probability": st.floats(0.0, 1.0),
    "world.frequency": st.floats(0.0, 1000.0),
    "material.elastic_modulus": st.floats(1e4, 1e8),
    "material.poisson_ratio": st.floats(-0.9, 0.5),
    "material.static_friction": st.floats(0.0, 10.0),
    "material.global_damping": st.floats(0.0, 0.2),
    "start.phase": st.floats(0.0, 3.0),
    "start.height": st.floats(0.0, 0.1),
    "start.sideways": st.floats(0.0, 1.0),
    "seed": st.integers(0, 2**32 - 1),
}
SHAPES = st.fixed_dictionaries(
    {},
    optional={
        "world.body": st.sampled_from(["worm", "#", "##/#."]),
        "law": st.sampled_from(["plain", "tanh"]),
        "learner.population_size": st.integers(1, 3),
        "trials": st.integers(1, 2),
        "starts": st.integers(1, 3),
        "validation_starts": st.integers(0, 2),
    },
)
ODD = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**40), 2**40),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=8),
)
KEYS = (
    *NUMBERS,
    "starts",
    "validation_starts",
    *SMALL,
    "record_every",
    "trials",
    "learner.population_size",
    "material.mass",
)


def test_drawn_settings_run_or_are_refused_with_a_message(capsys):
    valid = drawn(st.just({}), NUMBERS)
    outcomes = fuzz(
        "sensing", SMALL, valid, misdrawn(KEYS, ODD), 8, capsys, then="claims", messages=MESSAGES
    )
    assert outcomes["ran"] >= 2


@pytest.mark.slow
def test_many_drawn_settings_run_or_are_refused_with_a_message(capsys):
    valid = drawn(SHAPES, NUMBERS)
    outcomes = fuzz("sensing", SMALL, valid, misdrawn(KEYS, ODD), 60, capsys, then="report")
    assert outcomes["ran"] >= 20
    assert outcomes["refused"] >= 5


@pytest.mark.slow
def test_the_worm_learns_to_crawl_as_far_as_the_thesis_says():
    """Table 5.2: 146 mm, non-sensing, after 200 generations; within 40 mm, mean of five runs."""
    (case,) = cases("thesis", "world.body=worm", "law=shrink_limited", "surface=even", "trials=5")
    fitness = study.run(case, Context())["results"].fitness.values[:, -1]
    assert abs(fitness.mean() * 1000 - 146) < 40
    assert dataclasses.asdict(case.parsed(Settings))["generations"] == 200
