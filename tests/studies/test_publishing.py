import numpy as np
import pytest
import scipy.stats
import xarray as xr
from tests.studies.contexts import Remembering

from ethogram.campaign.context import Context
from ethogram.core.errors import InvalidSettings
from ethogram.core.scene import Scene
from ethogram.studies import publishing as study
from ethogram.studies.publishing import compute, results
from ethogram.studies.publishing.claims import claims_under
from ethogram.studies.publishing.condition import (
    AUTHOR_LEARNS,
    BIG,
    DEFAULT,
    EDITOR_LEARNS,
    SCENARIOS,
    SMALL,
    STATIC,
    Condition,
)
from ethogram.studies.publishing.plan import Settings, condition_of
from ethogram.studies.publishing.readings import KEYS, OF_LEARNED, READINGS, WORDS, reading_of
from ethogram.studies.publishing.records import compact
from ethogram.worlds.publishing.scene import ACCEPTED, DRAFTED, REJECTED

LEARNS = ["author=minded", "editor=learned"]
STANDS = ["author=random", "editor=mild_scrutiny"]


def cases(plan, *changes):
    return study.cases(study.PLANS[plan].override(changes))


@pytest.fixture(scope="module", autouse=True)
def _checkpoint_after_every_episode():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compute, "CHUNK_AUTHOR_STEPS", 0)
        yield


@pytest.fixture(scope="module")
def learned():
    """A case in which editors learn, its record and its checkpoints."""
    case = next(case for case in cases("smoke") if case.name.startswith("minded-learned"))
    context = Remembering()
    return case, study.run(case, context), context.saved


@pytest.fixture(scope="module")
def records(learned):
    """What two cases of the smoke plan leave behind, by name."""
    case = next(case for case in cases("smoke") if case.name.startswith("random-mild"))
    return {case.name: study.run(case, Context()), learned[0].name: learned[1]}


def test_the_thesis_plan_has_the_eight_scenarios_and_every_reading_of_those_that_stand_still():
    found = cases("thesis")
    conditions = [condition_of(case.parsed(Settings)) for case in found]
    assert len({case.name for case in found}) == len(found) == len(set(conditions))
    assert set(SCENARIOS) <= set(conditions)
    for reading in READINGS:
        static = {Condition(at.author, at.editor, at.size, reading) for at in STATIC}
        asked = {at for at in static if reading == DEFAULT or at.size == SMALL}
        assert asked <= set(conditions)
    assert all(case.parsed(Settings).trials == 20 for case in found)
    assert BIG in {at.size for at in conditions}


def test_readings_are_known_by_what_they_change():
    default = dict.fromkeys(KEYS) | {"bin_rule": "ranked"}
    assert reading_of(default, default) == DEFAULT
    both = default | {"bin_rule": "literal_clamped", "world.undefined_if": 0.0}
    assert reading_of(both, default) == "literal_bins_zero"
    assert reading_of(default | {"table": "own"}, default) == "table_own"
    odd = reading_of(default | {"table": "own", "reward": "level"}, default)
    assert odd == reading_of(default | {"reward": "level", "table": "own"}, default)
    assert odd.startswith("reading_")
    assert set(WORDS) == set(READINGS | OF_LEARNED)


def test_what_cannot_be_run_is_refused_before_the_run():
    with pytest.raises(InvalidSettings, match=r"bins = 11; allowed: at most world.journals, 10"):
        cases("smoke", "bins=11")
    with pytest.raises(InvalidSettings, match="that one of them learns"):
        cases("smoke", "author=learned", "editor=learned")


def test_a_record_tells_the_same_story_in_all_its_parts(records):
    for record in records.values():
        data = record["results"]
        assert data.sizes["trial"] == 2
        papers, years = data["papers"], data.sizes["year"]
        assert years == 5
        np.testing.assert_array_equal(data["histogram"].sum("bin"), papers.sum("journal"))
        assert (papers.sel(year=0).sum("journal") == 60).all()
        np.testing.assert_array_equal(papers.cumsum("year"), results.indicator(data, "papers"))
        step = float(data["bin"][1] - data["bin"][0])
        rough = (data["histogram"] * data["bin"]).sum("bin")
        exact = data["quality"].sum("journal")
        assert (abs(rough - exact) <= step / 2 * papers.sum("journal") + 1e-3).all()
        h_index = data["indicator.h_index"]
        assert data["author_year"].values.tolist() == [0, 1, 4]
        assert (h_index.isel(author_year=0) == 0).all()
        assert (h_index.diff("author_year") >= 0).all()
        assert (h_index.isel(author_year=-1).sum("author") > 0).all()
        assert not np.array_equal(data["author_quality"][0], data["author_quality"][1])


def test_a_training_that_was_interrupted_goes_on_to_the_same_numbers(learned):
    case, record, saved = learned
    assert len(saved) == 4
    again = study.run(case, Remembering(saved[1]))
    xr.testing.assert_identical(again["results"], record["results"])
    assert record["results"]["training_return"].shape == (2, 4)


def test_a_scene_shows_who_sent_what_where(records):
    scene = Scene.from_dataset(next(iter(records.values()))["scene"])
    authors, journals, steps = 12, 10, 12
    assert scene.position.shape == (2 * steps, journals + 2 * authors, 2)
    sites, drafts = scene.position[:, :journals], scene.position[:, journals + authors :]
    tint = scene.tint[:, journals + authors :]
    assert (tint[0::2] == DRAFTED).all()
    assert {ACCEPTED, REJECTED} <= set(tint[1::2].ravel().tolist())
    for frame in range(1, 2 * steps, 2):
        sent = tint[frame] != DRAFTED
        away = np.linalg.norm(drafts[frame][:, None] - sites[frame], axis=-1).min(1)
        assert (away[sent] < 1).all()
        assert (away[~sent] > 5).all()
    accepted = (tint[1::2] == ACCEPTED).sum()
    published = np.asarray(scene.series["papers published"])[1::2, 0]
    assert published[1:].sum() == accepted - (tint[1] == ACCEPTED).sum()


def test_tables_and_figures_are_drawn_of_what_there_is(records):
    tables = {table.name: table for table in study.tables(records)}
    assert set(tables) == {"correlations", "system"}  # one static scenario of a small size
    assert {row[:3] for row in tables["system"].rows} == {
        ("", "random", "mild-scrutiny"),
        ("", "minded", "learned"),
    }
    figures = study.figures(records)
    assert len(figures) == 3
    assert all(figure.svg.startswith("<svg") and figure.data.rows for figure in figures)
    assert study.tables({}) == study.figures({}) == []


# Measures and claims, on numbers made for them


def made(at, papers=None, quality=None, **indicators):
    """A record of a condition: 20 years in which nothing changes but what is given for the last."""
    rng = np.random.default_rng(0)
    trials, years, authors, journals = 6, 21, 30, at.size.journals
    skill = rng.uniform(0, 15, (trials, authors))
    papers = np.full(journals, 20) if papers is None else papers
    papers = np.broadcast_to(papers, (trials, years, journals)).copy()
    own = rng.uniform(5, 10, (trials, 1, journals)) if quality is None else quality
    noise = rng.normal(0, 0.5, (trials, years, journals))
    found = {"h_index": np.repeat(skill[:, None], years, 1)}
    for name in ("impact_factor", "acceptance_rate"):
        slope = indicators.get(name, 0.0)
        found[name] = slope * own + noise
    histogram = np.zeros((trials, years, 30), int)
    histogram[:, :, 10:20] = papers.sum(2)[..., None] // 10
    data = {
        "author_quality": (("trial", "author"), skill),
        "papers": (("trial", "year", "journal"), papers),
        "quality": (("trial", "year", "journal"), papers * own),
        "histogram": (("trial", "year", "bin"), histogram),
        "stuck": (("trial", "author_year"), np.zeros((trials, years))),
    }
    for name, values in found.items():
        axis = "author" if name == "h_index" else "journal"
        data[f"indicator.{name}"] = (("trial", f"{axis}_year", axis), values)
    return xr.Dataset(
        data,
        coords={name: np.arange(years) for name in ("year", "author_year", "journal_year")}
        | {"bin": (np.arange(30) + 0.5) / 2},
        attrs={
            "author": at.author,
            "editor": at.editor,
            "size": list(at.size),
            "reading": at.reading,
            "years": 20,
            "steps_per_year": 10,
            "quality_max": 15.0,
            "episodes": 300,
        },
    )


def as_the_thesis_says(at):
    few = np.where(np.arange(at.size.journals) < 4, 200, 5)
    options = {"acceptance_rate": -1.0 if at.author == "random" else 0.0}
    if at.author == "minded":
        options["papers"] = few
    if at.editor in ("mild_scrutiny", "learned") and at != AUTHOR_LEARNS:
        options["impact_factor"] = 1.0
    data = made(at, **options)
    if at.editor == "improve_only":
        data["papers"][:, 11:] = data["papers"][:, 11:] // 2 + 1
        data["quality"][:] = data["papers"] * 7.5
        data["quality"] += data["papers"] * np.linspace(-1, 1, at.size.journals)
        if at.author == "random":
            data["indicator.acceptance_rate"][:] = -results.latent(data, "acceptance_rate")
    if at == AUTHOR_LEARNS:
        own = np.linspace(5, 10, at.size.journals)
        data = made(at, papers=(own * 10).astype(int), quality=own)
    return {"results": data}


def test_claims_are_confirmed_where_the_numbers_are_as_the_thesis_says():
    records = {at.name: as_the_thesis_says(at) for at in SCENARIOS}
    found = study.claims(records)
    assert [claim.number for claim in found] == [1, 2, 3, 4, 5, 6, 7]
    assert [claim.verdict for claim in found] == ["confirmed"] * 7


@pytest.mark.parametrize(
    ("number", "at", "change"),
    [
        (1, STATIC[0], {"indicator.h_index": 0.0}),
        (2, STATIC[2], {"indicator.impact_factor": "quality"}),
        (3, STATIC[0], {"papers": np.where(np.arange(20) < 2, 500, 1)}),
        (4, STATIC[1], {"indicator.acceptance_rate": "quality"}),
        (5, STATIC[2], {"quality": 14.0}),
        (6, AUTHOR_LEARNS, {"indicator.impact_factor": "quality"}),
        (7, EDITOR_LEARNS, {"indicator.impact_factor": 0.0}),
    ],
)
def test_a_scenario_that_is_otherwise_refutes_a_claim(number, at, change):
    records = {each.name: as_the_thesis_says(each) for each in SCENARIOS}
    data = records[at.name]["results"]
    rng = np.random.default_rng(1)
    for name, value in change.items():
        noise = rng.normal(0, 1e-3, data[name].shape)
        if isinstance(value, str):
            value = results.latent(data, "impact_factor")
        if name == "quality":
            value = value * data["papers"].values
        integer = np.issubdtype(data[name].dtype, np.integer)
        data[name][:] = np.broadcast_to(value, data[name].shape) + (0 if integer else noise)
    verdicts = {claim.number: claim.verdict for claim in study.claims(records)}
    assert verdicts[number] == "refuted"


def test_shorter_runs_and_less_training_decide_nothing():
    records = {at.name: as_the_thesis_says(at) for at in SCENARIOS}
    records[EDITOR_LEARNS.name]["results"].attrs["episodes"] = 60
    records[STATIC[0].name]["results"].attrs["years"] = 4
    found = {claim.number: claim for claim in study.claims(records)}
    assert found[7].verdict == "undecided"
    assert "trained for 60 of the 300 episodes" in found[7].note
    assert "simulated for 4 of the 20 years" in found[2].note
    assert found[6].verdict == "confirmed"
    assert {claim.verdict for claim in study.claims({})} == {"not run"}


def test_each_reading_is_judged_by_its_own_runs():
    records = {}
    for at in STATIC:
        if at.size == SMALL:
            other = Condition(at.author, at.editor, at.size, "sequential")
            records[other.name] = as_the_thesis_says(at)
            records[other.name]["results"].attrs["reading"] = "sequential"
    found = results.Results.of(records)
    assert {claim.verdict for claim in claims_under(found, "sequential")} == {"confirmed"}
    assert {claim.verdict for claim in claims_under(found, DEFAULT)} == {"not run"}
    tables = {table.name: table for table in study.tables(records)}
    assert tables["robustness"].rows == (("authors act one after the other", *["confirmed"] * 5),)
    assert len(tables["robustness-effects"].rows) == 5


def test_correlations_are_scipys_and_leave_out_what_is_undefined():
    rng = np.random.default_rng(2)
    one = rng.normal(size=(4, 3, 12))
    other = one + rng.normal(size=one.shape)
    one[:, 0, :5] = np.nan
    other[1] = np.round(other[1])  # ties
    for kind, oracle in (("pearson", scipy.stats.pearsonr), ("spearman", scipy.stats.spearmanr)):
        found = results.correlation(one, other, kind)
        for place in np.ndindex(4, 3):
            there = np.isfinite(one[place])
            expected = oracle(one[place][there], other[place][there]).statistic
            np.testing.assert_allclose(found[place], expected, atol=1e-9)
    few = np.where(np.arange(12) < 2, one[0, 1], np.nan)
    assert np.isnan(results.correlation(few, other[0, 1], "pearson"))
    assert np.isnan(results.correlation(np.ones(12), other[0, 1], "pearson"))


def test_shares_growth_and_shapes_are_what_they_say():
    data = made(STATIC[0], papers=np.where(np.arange(20) < 5, 30, 10))
    np.testing.assert_allclose(results.share_of_few(data), 150 / 300)
    data["papers"][:, -1] //= 2
    np.testing.assert_allclose(results.growth(data), -0.5)
    np.testing.assert_allclose(results.skewness(data), 0, atol=1e-9)
    rng = np.random.default_rng(3)
    counts = rng.integers(0, 50, (6, 21, 30))
    data["histogram"][:] = counts
    sample = np.repeat(data["bin"].values, counts[0, -5:].sum(0))
    np.testing.assert_allclose(results.skewness(data)[0], scipy.stats.skew(sample))
    data["quality"][:] = data["papers"] * 9.0
    np.testing.assert_allclose(results.off_centre(data), 0.1)


def test_records_are_small_and_exact():
    assert compact(np.array([0.0, 127.0])).dtype == np.int8
    assert compact(np.array([128])).dtype == np.int16
    assert compact(np.array([-40_000.0])).dtype == np.int32
    assert compact(np.array([1.0, np.nan])).dtype == np.float32
    assert compact(np.array([0.5])).tolist() == [0.5]
    assert compact(np.array([2.0**31])).tolist() == [2.0**31]
