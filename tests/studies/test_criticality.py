"""The study of criticality: its cases, what evolution does, tables, figures and verdicts."""

import dataclasses

import jax
import numpy as np
import pytest
import xarray as xr

from ethogram.campaign.context import Context
from ethogram.core.errors import InvalidSettings
from ethogram.studies import criticality as study
from ethogram.studies.criticality.compute import THRESHOLDS, BodyFitness
from ethogram.studies.criticality.condition import BOXES, Condition
from ethogram.studies.criticality.plan import PLANS, LearnerSettings, Settings, cases
from ethogram.studies.criticality.results import Results, Thresholds
from ethogram.worlds.softbody.criticality import avalanches_of, criticality
from ethogram.worlds.softbody.growth import grown

SMALL = Settings(
    voxels=4,
    grid=4,
    learner=LearnerSettings(population_size=5, children=5, tournament_size=2),
    generations=3,
    trials=2,
)


def plan_of(**settings):
    plan = PLANS["smoke"]
    return dataclasses.replace(
        plan, settings=dataclasses.replace(SMALL, **settings), grid={"bodies": ("evolved", "rnd")}
    )


@pytest.fixture(scope="module")
def records():
    return {case.name: study.run(case, Context()) for case in cases(plan_of())}


def test_each_run_of_evolution_is_a_case_and_has_keys_of_its_own(records):
    assert list(records) == ["evolved-0", "evolved-1", "rnd"]
    one, other = (records[name]["results"] for name in ("evolved-0", "evolved-1"))
    assert one["mean"].values.tolist() != other["mean"].values.tolist()


def test_later_trials_are_those_that_more_trials_would_have_had(records):
    named = {case.name: case for case in cases(plan_of(first=1))}
    assert list(named) == ["evolved-1", "evolved-2", "rnd"]
    later = study.run(named["rnd"], Context())["results"].attrs["layers"].split()
    assert later[0] == records["rnd"]["results"].attrs["layers"].split()[1]


def test_evolution_keeps_the_best_and_its_score_is_that_of_the_body(records):
    data = records["evolved-0"]["results"]
    best = data["best"].values[0]
    assert (np.diff(best) >= 0).all()
    assert best[-1] == pytest.approx(float(data["score"][0]), abs=1e-6)
    size = data["size"].values[0, : int(data["voxels"][0])]
    assert criticality(size, len(size)).score == pytest.approx(float(data["score"][0]))
    assert int(data["scored"][0]) < int(data["asked"][0]) == 5 * 4


def test_a_run_that_is_taken_up_again_ends_with_the_same_numbers(records):
    case = cases(plan_of())[0]

    class Stopped(Context):
        """Keeps the checkpoint after two generations, and begins from one that is given."""

        def __init__(self, found=None):
            super().__init__()
            self.found, self.kept = found, []

        def restore(self):
            return self.found

        def checkpoint(self, make):
            self.kept.append(make())

    first = Stopped()
    study.run(case, first)
    again = study.run(case, Stopped(first.kept[1]))["results"]
    xr.testing.assert_identical(
        again.drop_vars("scored"), records["evolved-0"]["results"].drop_vars("scored")
    )


def test_a_body_that_was_scored_is_not_scored_again():
    fitness, genes = BodyFitness(4), np.random.default_rng(0).random((6, 16))
    key = jax.random.key(0)
    first = fitness(key, genes)
    again = fitness(key, np.concatenate([genes, genes]))
    np.testing.assert_array_equal(again.fitness, np.tile(first.fitness, 2))
    assert (fitness.asked, fitness.scored) == (18, len(fitness.known))
    body = grown(genes[0], 4)
    ((size, _),) = avalanches_of([body])
    assert float(first.fitness[0]) == pytest.approx(criticality(size, len(body)).score)


def test_the_least_is_wanted_where_bodies_are_evolved_as_a_control():
    genes = np.random.default_rng(1).random((3, 16))
    greatest, least = BodyFitness(4), BodyFitness(4, sign=-1)
    key = jax.random.key(0)
    np.testing.assert_array_equal(greatest(key, genes).fitness, -least(key, genes).fitness)


def test_a_grid_without_room_is_refused_before_anything_is_run():
    with pytest.raises(InvalidSettings, match="A grid of 9 cells cannot hold a body of 10 voxels"):
        cases(plan_of(grid=3, voxels=10))


def test_everything_is_made_of_what_was_run(records):
    tables = {table.name: table for table in study.tables(records)}
    assert [row[0] for row in tables["bodies"].rows] == ["rnd-0", "rnd-1", "opt-0", "opt-1"]
    assert [row[0] for row in tables["evolution"].rows] == ["opt-0", "opt-1"]
    assert {figure.name for figure in study.figures(records)} == {"figure-6-3", "figure-6-4"}


def bodies_record(bodies, scores, **attrs):
    """A record of bodies that were never simulated."""
    scores = np.array(scores)
    zeros = np.zeros(len(scores))
    named = dict.fromkeys(
        ("r_squared", "distance", "slope", "law_exponent", "law_distance", "law_p_value"), zeros
    )
    numbers = {name: ("trial", values) for name, values in (named | {"score": scores}).items()}
    sizes = np.ones((len(scores), 2), int)
    data = xr.Dataset(
        numbers
        | {
            "voxels": ("trial", np.full(len(scores), 2)),
            "size": (("trial", "voxel"), sizes),
            "duration": (("trial", "voxel"), sizes),
        },
        attrs={
            "bodies": bodies,
            "layers": " ".join(["##"] * len(scores)),
            "names": "box worm biped revT" if bodies == "hand_made" else "",
            "first": 0,
            "generations": 200,
            "population_size": 1000,
        }
        | attrs,
    )
    return {"results": data}


def everything(evolved):
    rng = np.random.default_rng(0)
    return {
        "evolved": bodies_record("evolved", evolved + 0.01 * rng.standard_normal(10)),
        "rnd": bodies_record("rnd", 0.35 + 0.03 * rng.standard_normal(10)),
        "psrnd": bodies_record("psrnd", 0.25 + 0.03 * rng.standard_normal(10)),
        "hand-made": bodies_record("hand_made", [0.17, 0.22, 0.26, 0.29]),
    }


@pytest.mark.parametrize(("evolved", "verdict"), [(0.77, "confirmed"), (0.20, "refuted")])
def test_the_first_claim_is_judged_by_scores(evolved, verdict):
    assert study.claims(everything(evolved))[0].verdict == verdict


def test_claims_about_tasks_are_not_run_and_half_a_claim_decides_nothing():
    verdicts = [claim.verdict for claim in study.claims(everything(0.77))]
    assert verdicts == ["confirmed", "not run", "not run", "not run", "undecided", "not run"]


def test_less_than_the_chapters_evolution_decides_nothing():
    records = everything(0.77)
    records["evolved"] = bodies_record("evolved", np.linspace(0.7, 0.8, 10), generations=50)
    claim = study.claims(records)[0]
    assert claim.verdict == "undecided"
    assert "evolved for 50 of the 200 generations" in claim.note


def test_runs_in_records_of_their_own_are_trials_of_one_condition():
    parts = {
        str(run): bodies_record("evolved", [score], first=run)
        for run, score in ((1, 0.4), (0, 0.3))
    }
    found = Results.of(parts)
    at = Condition("evolved")
    assert found.by_condition[at]["score"].values.tolist() == [0.3, 0.4]
    assert list(found.bodies(at)) == ["opt-0", "opt-1"]


def test_the_threshold_of_a_square_is_that_of_the_greatest_variance():
    size = np.zeros((len(BOXES), len(THRESHOLDS), BOXES[-1] ** 2))
    for place, side in enumerate(BOXES):
        size[place, :, : side**2] = 1
        size[place, place, : side**2 // 2] = side  # varies at one threshold alone
    data = xr.Dataset(
        {"size": (("trial", "threshold", "voxel"), size), "side": ("trial", list(BOXES))},
        {"threshold": THRESHOLDS},
    )
    found = Thresholds(data)
    np.testing.assert_array_equal(found.chosen, THRESHOLDS[: len(BOXES)])
    fitted = np.polynomial.polynomial.polyval(np.array(BOXES) ** 2, found.coefficients)
    assert np.abs(fitted - found.chosen).max() < np.ptp(found.chosen) / 4
