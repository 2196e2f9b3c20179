import numpy as np
import pytest
import scipy.stats
import xarray as xr

from ethogram.learners.evolution import WORST_FITNESS
from ethogram.studies.sensing import results as measure
from ethogram.studies.sensing.claims import claims
from ethogram.studies.sensing.condition import (
    MORPHOLOGIES,
    OUTPUTS,
    SCENARIOS,
    VALIDATION,
    Condition,
    non_sensing,
    sensing,
)
from ethogram.studies.sensing.figures import figures
from ethogram.studies.sensing.published import EVEN_FITNESS, UNEVEN_DISTANCE, UNEVEN_RATIO
from ethogram.studies.sensing.results import (
    Results,
)
from ethogram.studies.sensing.tables import tables
from ethogram.worlds.softbody import SoftBody3D
from ethogram.worlds.softbody.bodies import text_of
from ethogram.worlds.softbody.scene import Pose, scene_of_poses

RUNS, THIRTY, SAMPLES = 6, 30, 40
FITNESS = {"worm": (150.0, 2000.0), "biped": (70.0, 900.0), "tripod": (500.0, 600.0)}  # mm
RATIOS = {  # of distance in validation to fitness
    "non-sensing": {"flat": 0.95, "step": 0.9, "sin": 0.8},
    "sensing": {"flat": 1.2, "step": 1.3, "sin": 0.9},
}
SPREAD = {"non-sensing": 0.01, "sensing": 0.03}  # of runs, relative to their mean


def result(at, fitness, ratios=None, generations=200, steps=10_000):
    """A record of a condition: runs that go straight ahead as far as they are said to go.

    Args:
        at: the condition.
        fitness: of each run, in mm.
        ratios: of validation to fitness.
        generations: of evolution; fitness grows evenly.
        steps: of a simulation.

    """
    fitness, ratios = np.asarray(fitness, float) / 1000, ratios or RATIOS[at.controller]
    scenarios = SCENARIOS[at.surface]
    distance = np.stack([fitness * {"fitness": 1.0, **ratios}[name] for name in scenarios], 1)
    sample = np.arange(SAMPLES) / SAMPLES
    ahead = distance[..., None] * sample
    path = np.stack([ahead, 0.005 + 0.0005 * np.sin(40 * sample) + 0 * ahead], 2)
    cells = SoftBody3D(body=at.body).cells
    data = {
        "fitness": (
            ("trial", "generation"),
            fitness[:, None] * np.linspace(0.5, 1.0, generations + 1),
        ),
        "diverged": (
            ("trial", "generation"),
            np.zeros((len(fitness), generations + 1), np.int32),
        ),
        "distance": (("trial", "scenario"), distance),
        "path": (("trial", "scenario", "axis", "sample"), path),
    }
    coords = {
        "generation": np.arange(generations + 1),
        "scenario": list(scenarios),
        "axis": ["x", "z"],
        "sample": sample,
    }
    attrs = {
        "body": at.body,
        "layers": text_of(cells),
        "voxels": len(cells),
        "controller": at.controller,
        "law": at.law,
        "surface": at.surface,
        "generations": generations,
        "steps": steps,
    }
    return {"results": xr.Dataset(data, coords, attrs=attrs), "scene": scene(at, cells)}


def scene(at, cells):
    frames = 10
    position = np.repeat((cells.T[None] + 0.5) * 0.01, frames, 0)
    position[:, 0] += 0.001 * np.arange(frames)[:, None]
    orientation = np.zeros((frames, 4, len(cells)))
    orientation[:, 0] = 1
    edge = np.full((frames, len(cells)), 0.01)
    edge[::2, 0] = 0.011
    return scene_of_poses(
        at.description, Pose(position, orientation, edge), resting=0.01, seconds=0.1
    ).to_dataset()


def conditions(bodies=MORPHOLOGIES, surfaces=("even", "uneven")):
    return [
        at
        for surface in surfaces
        for body in bodies
        for at in (
            non_sensing(body, surface),
            *(sensing(body, output, surface) for output in OUTPUTS),
        )
    ]


def campaign(run=None, fitness=None, ratios=None, runs=RUNS, **changes):
    """Records as the thesis has them: sensing robots far ahead, least so the tripod."""
    rng = np.random.default_rng(0)
    found = {}
    for at in run or conditions():
        mean = (fitness or FITNESS)[at.body][at.controller == "sensing"]
        values = mean * (1 + SPREAD[at.controller] * rng.normal(size=runs))
        found[at.name] = result(at, values, (ratios or RATIOS)[at.controller], **changes)
    return found


@pytest.fixture(scope="module")
def everything():
    return campaign()


@pytest.fixture(scope="module")
def thirty():
    """As many runs as the thesis has."""
    return campaign(runs=THIRTY)


@pytest.fixture(scope="module")
def worm():
    """The worm alone, on both surfaces, under tanh outputs only."""
    return campaign([at for at in conditions(("worm",)) if at.law != "unbounded"])


def verdicts(records):
    return [claim.verdict for claim in claims(records)]


def test_published_numbers_are_complete():
    kinds = ("non-sensing", "sensing")
    assert set(EVEN_FITNESS) == {(body, kind) for body in MORPHOLOGIES for kind in kinds}
    assert set(UNEVEN_DISTANCE) == {
        (scenario, body, kind)
        for scenario in SCENARIOS["uneven"]
        for body in MORPHOLOGIES
        for kind in kinds
    }
    assert set(UNEVEN_RATIO) == {key for key in UNEVEN_DISTANCE if key[0] != "fitness"}
    for (scenario, body, kind), printed in UNEVEN_RATIO.items():
        ratio = UNEVEN_DISTANCE[scenario, body, kind][0] / UNEVEN_DISTANCE["fitness", body, kind][0]
        assert ratio == pytest.approx(printed, abs=0.035), (scenario, body, kind)


# Measures


def test_results_stand_in_the_order_of_the_tables(everything):
    shuffled = dict(sorted(everything.items(), reverse=True))
    assert list(Results.of(shuffled).by_condition) == conditions()


def test_distances_are_in_millimetres_and_a_runs_own(everything):
    data = everything["worm-tanh-uneven"]["results"]
    fitness = measure.distance("fitness")(data)
    assert 1800 < fitness.mean() < 2200
    np.testing.assert_allclose(measure.further("step", "fitness")(data), 0.3 * fitness)
    np.testing.assert_array_equal(measure.validated(above=True)(data), 2)
    np.testing.assert_array_equal(measure.validated(above=False)(data), 1)
    assert measure.ratio(data, "flat").value == pytest.approx(1.2)


def from_starts(at, runs=4):
    """A record of robots that were validated from three starts, from which they get half as far."""
    record = result(at, [100.0] * runs)
    data = record["results"]
    half = 0.5 * data["distance"].values[..., None] * np.array([0.9, 1.0, 1.1])
    data["start_distance"] = (("trial", "scenario", "start"), half)
    data.attrs["starts"] = 8
    return record


def test_a_distance_is_the_mean_over_validation_starts_where_fitness_was_a_mean_too():
    data = from_starts(sensing("worm", "tanh", "even"))["results"]
    np.testing.assert_allclose(measure.distance("fitness")(data), 50)
    data.attrs["starts"] = 1
    np.testing.assert_allclose(measure.distance("fitness")(data), 100)
    np.testing.assert_allclose(measure.over_starts("fitness")(data), 50)
    np.testing.assert_allclose(measure.from_rest("fitness")(data), 100)
    np.testing.assert_allclose(measure.trained(data), 100)
    np.testing.assert_allclose(measure.start_spread("fitness")(data), 5 * np.sqrt(2 / 3))


def test_fitness_stands_beside_what_is_left_of_it_on_fresh_starts(everything):
    at = sensing("worm", "tanh", "even")
    of = {table.name: table for table in tables({at.name: from_starts(at)})}
    (row,) = of["starts"].rows
    assert row[4:6] == (8, 3)
    assert [cell.value for cell in row[6:9]] == pytest.approx([100, 100, 50])
    assert "fresh starts" in of["table-5-2"].caption
    assert "starts" not in {table.name for table in tables(everything)}


def test_a_robot_that_does_not_get_ahead_has_no_ratio():
    at = sensing("worm", "tanh", "uneven")
    assert measure.ratio(result(at, [5.0, -1.0])["results"], "flat") is None


def test_runs_that_broke_stay_out_of_curves_tests_and_means():
    at = non_sensing("worm", "even")
    data = result(at, [100.0, 110.0, np.nan])["results"]
    data["fitness"][1, 0] = WORST_FITNESS
    assert measure.curve(data).shape == (1, 201)
    results = Results.of({"one": {"results": data}})
    trials = measure.sound(results.trials(measure.distance("fitness"), at))
    np.testing.assert_allclose(trials.values, [100, 110])


def test_the_u_test_is_scipys(everything):
    results = Results.of(everything)
    sides = [
        results.trials(measure.distance("fitness"), at)
        for at in (sensing("tripod", "tanh", "even"), non_sensing("tripod", "even"))
    ]
    expected = scipy.stats.mannwhitneyu(sides[0].values, sides[1].values).pvalue
    assert measure.u_test(*sides) == pytest.approx(expected)
    assert expected == pytest.approx(2 / 924)  # six of twelve, none overlapping: both ends


# Claims


def test_a_campaign_like_the_one_described_confirms_every_claim(thirty):
    assert verdicts(thirty) == ["confirmed"] * 12


def test_fewer_generations_or_steps_decide_nothing():
    judged = claims(campaign(generations=10, steps=2000))
    assert {claim.verdict for claim in judged} == {"undecided"}
    reason = (
        "evolved for 10 of the 200 generations and simulated for 2 000 of the 10 000 steps that "
        "the claim speaks of"
    )
    assert all(claim.note.startswith(reason) for claim in judged)
    assert judged[0].effect > 0, "shown is where it points"
    assert judged[0].note.endswith("leans towards the claim")


def test_each_output_law_is_judged_by_its_own_robots(thirty):
    slow = sensing("biped", "unbounded", "even")
    records = thirty | {slow.name: result(slow, np.linspace(40, 45, THIRTY))}
    found = claims(records)
    assert [claim.verdict for claim in found[:6]] == ["confirmed"] * 6
    assert found[6].verdict == "refuted"
    assert "biped" in found[6].note
    assert found[7].verdict == "refuted", "the tripod's lead is not the smallest"
    assert found[8].verdict == "confirmed", "the uneven surface is another matter"


def test_a_large_lead_of_the_tripod_refutes_that_it_is_the_smallest():
    far = FITNESS | {"tripod": (500.0, 5000.0)}
    found = verdicts(campaign(fitness=far, runs=THIRTY))
    assert found[:3] == ["confirmed", "refuted", "refuted"]


def test_ratios_on_the_wrong_side_of_one_refute_what_is_said_of_them():
    swapped = {"non-sensing": RATIOS["sensing"], "sensing": RATIOS["sensing"]}
    found = claims(campaign(runs=THIRTY, ratios=swapped))
    assert found[3].verdict == "refuted"
    assert (found[3].effect, found[3].unit) == (pytest.approx(3.0), "cases")  # sin, three bodies


def test_a_step_that_is_harder_refutes_that_sin_is_the_hardest():
    steep = {kind: of | {"step": 0.5} for kind, of in RATIOS.items()}
    assert verdicts(campaign(runs=THIRTY, ratios=steep))[5] == "refuted"


def test_two_kinds_that_move_alike_are_no_two_clouds(thirty):
    alike = non_sensing("biped", "even")
    fitness = thirty[sensing("biped", "tanh", "even").name]["results"]["distance"].values
    records = thirty | {alike.name: result(alike, 1000 * fitness[:, 0] + 0.1)}
    assert claims(records)[4].verdict != "confirmed"


def test_what_was_not_run_is_said_and_bars_a_confirmation(worm):
    found = claims(worm)
    assert [claim.verdict for claim in found[6:11]] == ["not run"] * 5
    assert found[11].verdict == "undecided", "its parts on non-sensing robots were run"
    assert found[0].verdict == "undecided"
    assert found[0].note.startswith("not run: biped, sensing (tanh), even surface; ")


def test_a_broken_best_robot_leaves_undecided_what_it_is_needed_for(thirty):
    gone = sensing("worm", "tanh", "even")
    values = [np.nan, *np.linspace(1900, 2100, THIRTY - 1)]
    found = claims(thirty | {gone.name: result(gone, values)})
    assert [found[index].verdict for index in (0, 1, 4)] == ["undecided"] * 3
    assert "1 of 30 trials have no value" in found[0].note
    assert found[2].verdict == "confirmed"


def test_without_records_there_is_nothing_to_show_and_nothing_to_judge():
    assert verdicts({}) == ["not run"] * 12
    assert tables({}) == figures({}) == []


# Tables


def test_tables_stand_beside_the_thesis(everything):
    of = {table.name: table for table in tables(everything)}
    assert set(of) == {"table-5-1", "table-5-2", "table-5-3", "validation", "behaviour"}
    even = {row[:3]: row[3:] for row in of["table-5-2"].rows}
    assert len(even) == 9
    runs, mean, deviation, p_value, corrected, printed, broken = even["worm", "sensing", "tanh"]
    assert (runs, mean.published, deviation.published, printed, broken) == (6, 3012, 329, 2e-6, 0)
    assert p_value == pytest.approx(2 / 924)
    assert corrected == pytest.approx(6 * 2 / 924), "Holm, over six comparisons"
    assert even["worm", "non-sensing", "shrink-limited"][3:6] == (None, None, None)
    uneven = {row[:4]: row[4:] for row in of["table-5-3"].rows}
    assert len(uneven) == 4 * 9
    ratio = uneven["sin", "biped", "sensing", "unbounded"][3]
    assert (ratio.value, ratio.published) == (pytest.approx(0.9), 0.51)
    assert uneven["fitness", "biped", "sensing", "unbounded"][3] is None


def test_cases_above_one_are_counted_as_the_thesis_counts_them(everything):
    (table,) = (one for one in tables(everything) if one.name == "validation")
    found = {row[:3]: row[3] for row in table.rows}
    assert found["sensing", "tanh", 9].value == 6
    assert found["non-sensing", "shrink-limited", 9].value == 0
    assert found["sensing", "tanh", 9].published == 7
    assert found["non-sensing", "shrink-limited", 9].published == 1


def test_a_body_of_ones_own_is_shown_without_published_numbers():
    at = [Condition("##/#.", "sensing", "tanh", "even"), non_sensing("##/#.", "even")]
    records = {one.name: result(one, np.linspace(50, 60, RUNS)) for one in at}
    of = {table.name: table for table in tables(records)}
    mean, deviation = of["table-5-2"].rows[1][4:6]
    assert (mean.published, deviation.published) == (None, None)
    assert of["table-5-2"].rows[1][6] is not None, "compared all the same"
    assert verdicts(records) == ["not run"] * 12
    assert {figure.name for figure in figures(records)} >= {"figure-5-1", "figure-5-2"}


# Figures


def test_figures_are_drawn_from_what_was_run(everything):
    of = {figure.name: figure for figure in figures(everything)}
    numbers = (*(f"figure-5-{number}" for number in range(1, 7)), "figure-5-6-t-sne")
    assert tuple(of) == numbers
    assert len(of["figure-5-1"].data.rows) == 4 + 6 + 8
    bodies = {row[0] for row in of["figure-5-2"].data.rows}
    assert bodies == set(MORPHOLOGIES)
    printed = [row[:4] for row in of["figure-5-2"].data.rows if str(row[1]).startswith("thesis")]
    assert ("worm", "thesis, sensing", 200, 3012.0) in printed
    assert "biped, sensing (tanh), even surface" in of["figure-5-3"].title
    assert len(of["figure-5-5"].data.rows) == 2 * 3 * 3 * RUNS
    assert len(of["figure-5-6"].data.rows) == len(VALIDATION) * 3 * 3 * RUNS
    for figure in of.values():
        assert figure.svg.startswith("<svg")
        assert figure.alt


def test_without_scikit_learn_there_are_all_figures_but_maps(worm, monkeypatch):
    monkeypatch.setattr("ethogram.studies.sensing.behaviour.find_spec", lambda name: None)
    assert [figure.name for figure in figures(worm)] == [
        f"figure-5-{number}" for number in range(1, 5)
    ]
    (behaviour,) = (table for table in tables(worm) if table.name == "behaviour")
    assert "pip install 'ethogram[analysis]'" in behaviour.caption


def test_a_strip_shows_the_last_frames_where_the_scene_has_them(worm):
    (strip,) = (figure for figure in figures(worm) if figure.name == "figure-5-3")
    rows = strip.data.rows
    assert len(rows) == 8 * 4  # frames, voxels of the worm
    frame, voxel, x, z, angle, edge, state = rows[0]
    assert (frame, voxel, state) == (2, 0, "expanded")
    assert (x, z, angle, edge) == pytest.approx((7.0, 5.0, 0.0, 11.0), abs=1e-4)
