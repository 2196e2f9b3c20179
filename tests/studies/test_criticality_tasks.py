"""Bodies in tasks: the fitness of phase controllers, ranks, tables and the claims about them."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

from ethogram.campaign.context import Context
from ethogram.core.errors import InvalidSettings
from ethogram.core.rollout import rollout
from ethogram.studies import criticality as study
from ethogram.studies.criticality.condition import HAND_MADE
from ethogram.studies.criticality.found import BODIES, EVOLVED, PSRND, RND, group_of
from ethogram.studies.criticality.plan import PLANS, cases
from ethogram.studies.criticality.results import TaskResults
from ethogram.studies.criticality.tasks import (
    THESIS_TASKS,
    PhaseFitness,
    TaskSettings,
    learner_of,
    world_of,
)
from ethogram.worlds.softbody import SoftBody2D
from ethogram.worlds.softbody.bodies import PLANE, cells_of
from ethogram.worlds.softbody.tasks import Task

LEVEL = ((0.0, 0.0), (100.0, 0.0))
SHORT = {
    "way": Task(LEVEL, start=11.0, seconds=0.5),
    "rise": Task(LEVEL, start=11.0, seconds=0.5, settling=1.0, rises=True),
}


@pytest.mark.parametrize("task", SHORT)
def test_the_fitness_of_a_phase_controller_is_its_return_in_the_world(task):
    world = SoftBody2D(body="##", task=SHORT[task])
    fitness = PhaseFitness(world, jnp.array([1, 0]))
    genomes = jnp.array([[0.3, -0.8], [0.0, 1.0]])
    found = eqx.filter_jit(fitness)(jax.random.key(0), genomes)

    def returned(genome):
        act = fitness.policy(genome)
        _, reward = rollout(
            world,
            act,
            jax.random.key(0),
            world.horizon,
            keep=lambda transition: transition.outcome.reward["robot"][0],
        )
        return reward.sum()

    expected = jax.jit(jax.vmap(returned))(genomes)
    np.testing.assert_allclose(found.fitness, expected, atol=2e-4)
    assert np.ptp(found.fitness) > 1e-3
    assert not found.diverged.any()


def test_there_is_a_gene_for_each_cell_of_the_bounding_grid():
    learner = learner_of(TaskSettings(body="biped"))
    assert learner.search_space.size == 6 * 4
    cells = world_of(TaskSettings(body="biped")).cells
    gene = np.asarray(learner.fitness.gene)
    np.testing.assert_array_equal(np.stack([gene % 6, gene // 6], 1), cells)


def test_the_bodies_are_those_that_were_measured_and_can_be_simulated():
    assert [len(group) for group in (HAND_MADE, EVOLVED, RND, PSRND)] == [4, 10, 10, 10]
    assert all(len(cells_of(text, axes=PLANE)) >= 20 for text in BODIES.values())
    assert (group_of("opt-3"), group_of("worm")) == ("evolved", "hand_made")


def test_a_case_is_a_body_in_a_task_and_keeps_the_best_of_each_run():
    plan = PLANS["tasks-smoke"]
    case, *others = cases(plan)
    assert [each.name for each in (case, *others)] == [
        "box-locomotion-phase",
        "box-jump-phase",
        "opt-0-locomotion-phase",
        "opt-0-jump-phase",
    ]
    tiny = dataclasses.replace(plan, settings=dataclasses.replace(plan.settings, births=14))
    data = study.run(cases(tiny)[0], Context())["results"]
    assert data.sizes["trial"] == 2
    assert (np.diff(data["best"].values, axis=1) >= 0).all()
    np.testing.assert_array_equal(data["best"].values[:, -1], data["value"].values)
    assert (data["energy"].values > 0).all()


def record(body, task, values, births=10_000):
    """A record of a body in a task that was never simulated."""
    values = np.array(values, float)
    data = xr.Dataset(
        {"value": ("trial", values), "energy_fitness": ("trial", values / 200)},
        attrs={
            "body": body,
            "task": task,
            "controller": "phase",
            "births": births,
            "seconds": 1.0,
            "rises": int(task == "jump"),
        },
    )
    return {"results": data}


def everything(worth, births=10_000):
    """All hand-made, evolved and random bodies in all tasks, in thirty runs."""
    rng = np.random.default_rng(0)
    return {
        f"{body}-{task}": record(
            body, task, worth(group_of(body), task) + 0.05 * rng.standard_normal(30), births
        )
        for body in (*HAND_MADE, *EVOLVED, *RND)
        for task in THESIS_TASKS
    }


def as_published(group, task):
    """Hand-made bodies fast and poor at escape, evolved ones good at the other two."""
    if group == "hand_made":
        return {"locomotion": 6.0, "jump": 1.0, "escape": 0.1}[task]
    return {"evolved": 2.0, "rnd": 3.0}[group]


def verdicts(records):
    return {claim.number: claim.verdict for claim in study.claims(records)}


def test_claims_about_tasks_are_judged():
    found = verdicts(everything(as_published))
    assert [found[number] for number in (2, 3, 4)] == ["confirmed", "confirmed", "confirmed"]
    assert found[6] == "not run"
    turned = verdicts(everything(lambda group, task: 8 - as_published(group, task)))
    assert [turned[number] for number in (2, 3, 4)] == ["refuted", "refuted", "refuted"]


def test_fewer_births_than_the_chapters_decide_nothing():
    found = verdicts(everything(as_published, births=1000))
    assert [found[number] for number in (2, 3, 4)] == ["undecided"] * 3


def test_bodies_are_ranked_run_by_run():
    values = {"box": [3.0, 1.0], "worm": [2.0, 2.0], "biped": [1.0, 3.0]}
    results = TaskResults.of(
        {
            f"{body}-{task}": record(body, task, each)
            for body, each in values.items()
            for task in THESIS_TASKS
        }
    )
    ranks = results.average_ranks(list(values))
    assert {body: each.values.tolist() for body, each in ranks.items()} == {
        "box": [1.0, 3.0],
        "worm": [2.0, 2.0],
        "biped": [3.0, 1.0],
    }
    assert results.average_ranks(["box", "revT"])["box"].values is None


def test_tables_show_what_was_run_and_the_published_numbers_of_hand_made_bodies():
    tables = {table.name: table for table in study.tables(everything(as_published))}
    assert len(tables["tasks"].rows) == 24
    rows = {row[0]: row for row in tables["table-6-2"].rows}
    assert rows["worm"][2].published == 6.31
    assert rows["opt-0"][2].published is None
    assert study.figures(everything(as_published)) == []


def test_births_for_less_than_a_generation_are_refused():
    plan = PLANS["tasks-smoke"]
    few = dataclasses.replace(plan, settings=dataclasses.replace(plan.settings, births=3))
    with pytest.raises(InvalidSettings, match="births = 3: one generation has 12 candidates"):
        study.run(cases(few)[0], Context())
