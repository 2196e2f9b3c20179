from functools import partial
from pathlib import Path

import numpy as np
import pytest
import scipy.stats
import xarray as xr
from tests.studies.contexts import Remembering

from ethogram.campaign.context import Context
from ethogram.core.errors import InvalidSettings
from ethogram.core.scene import Scene, Shape, tints
from ethogram.studies import publishing as study
from ethogram.studies import training
from ethogram.studies.publishing import records as kept
from ethogram.studies.publishing import results, robustness
from ethogram.studies.publishing.condition import (
    AUTHOR_LEARNS,
    BIG,
    EDITOR_LEARNS,
    SCENARIOS,
    SMALL,
    SNAPSHOTS,
    STATIC,
    Condition,
)
from ethogram.studies.publishing.plan import Settings, condition_of
from ethogram.studies.publishing.readings import KNOWN, OF_LEARNED, READINGS, WORDS
from ethogram.studies.readings import DEFAULT, keys_of, reading_of
from ethogram.worlds.publishing.scene import ACCEPTED, DRAFTED, REJECTED

PUBLISHED = Path(__file__).parents[2] / "docs" / "results" / "records" / "publishing"
LEARNS = ["author=minded", "editor=learned"]
STANDS = ["author=random", "editor=mild_scrutiny"]


def cases(plan, *changes):
    return study.cases(study.PLANS[plan].override(changes))


@pytest.fixture(scope="module", autouse=True)
def _checkpoint_after_every_episode():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training, "train", partial(training.train, seconds=0))
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
    default = dict.fromkeys(keys_of(KNOWN)) | {"bin_rule": "ranked"}
    assert reading_of(default, default, KNOWN) == DEFAULT
    both = default | {"bin_rule": "literal_clamped", "world.undefined_if": 0.0}
    assert reading_of(both, default, KNOWN) == "literal_bins_zero"
    assert reading_of(default | {"table": "own"}, default, KNOWN) == "table_own"
    odd = reading_of(default | {"table": "own", "reward": "level"}, default, KNOWN)
    assert odd == reading_of(default | {"reward": "level", "table": "own"}, default, KNOWN)
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


def made(at, papers=None, quality=None, trials=6, **indicators):
    """A record of a condition: 20 years in which nothing changes but what is given for the last."""
    rng = np.random.default_rng(0)
    years, authors, journals = 21, 30, at.size.journals
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
    options = {"trials": 20, "acceptance_rate": -1.0 if at.author == "random" else 0.0}
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
        data = made(at, papers=(own * 10).astype(int), quality=own, trials=20)
    return {"results": varied(data)}


def varied(data):
    """The same with a little noise: trials that are all equal decide nothing."""
    rng = np.random.default_rng(7)
    more = rng.integers(0, 2, data["papers"].shape)
    data["quality"][:] = data["quality"] * (1 + more / data["papers"])
    data["papers"][:] = data["papers"] + more
    data["histogram"][:] = data["histogram"] + rng.integers(0, 2, data["histogram"].shape)
    for name, values in data.items():
        if str(name).startswith("indicator."):
            values[:] += rng.normal(0, 0.1 * float(values.std()), values.shape)
    return data


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
        more = rng.integers(0, 2, data[name].shape)
        if isinstance(value, str):
            value = results.latent(data, "impact_factor")
        if name == "quality":
            value = value * data["papers"].values
        integer = np.issubdtype(data[name].dtype, np.integer)
        data[name][:] = np.broadcast_to(value, data[name].shape) + (more if integer else noise)
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


def judged(records):
    """The verdicts of each row of the table `robustness`, by number of the claim."""
    table = next(table for table in study.tables(records) if table.name == "robustness")
    return {row[0]: dict(enumerate(row[1:], start=1)) for row in table.rows}


def test_each_reading_is_judged_by_its_own_runs():
    records = {}
    for at in STATIC:
        if at.size == SMALL:
            other = Condition(at.author, at.editor, at.size, "sequential")
            records[other.name] = as_the_thesis_says(at)
            records[other.name]["results"].attrs["reading"] = "sequential"
    assert {claim.verdict for claim in study.claims(records)} == {"not run"}
    found = judged(records)
    assert list(found) == ["published", WORDS["sequential"]]
    assert list(found[WORDS["sequential"]].values()) == ["confirmed"] * 5 + [None] * 2
    effects = next(table for table in study.tables(records) if table.name == "robustness-effects")
    assert len(effects.rows) == 5


def test_the_scenarios_of_a_thousand_authors_do_not_decide_what_is_said_of_smaller_ones():
    rng = np.random.default_rng(8)
    records = {at.name: as_the_thesis_says(at) for at in SCENARIOS}
    for at in STATIC:
        if at.size == BIG:  # acceptance goes with quality, and papers are spread evenly
            data = records[at.name]["results"]
            mean, noise = data["quality"] / data["papers"], rng.integers(0, 3, data["papers"].shape)
            data["papers"][:] = data["papers"].mean("journal").astype(int).values[..., None] + noise
            data["quality"][:] = data["papers"] * mean
            data["indicator.acceptance_rate"][:] = results.latent(data, "acceptance_rate")
            data["indicator.acceptance_rate"][:] += rng.normal(0, 0.1, noise.shape)
    found = {claim.number: claim for claim in study.claims(records)}
    for number in (3, 4):
        claim = found[number]
        assert claim.verdict == "confirmed"
        assert f"{robustness.LARGER} (refuted)" in claim.depends_on
        scope, retested = claim.history
        assert claim.stated < scope.date == retested.date
        assert "7.2 to 7.5" in scope.change
        assert "2026-11-26" in scope.known
    assert found[1].history == (retested,)


def test_a_verdict_that_another_measure_changes_is_marked_with_it():
    records = {at.name: as_the_thesis_says(at) for at in SCENARIOS}
    for at in SCENARIOS:  # impact factors tell the last papers' quality, not that of all
        data = records[at.name]["results"]
        random = np.random.default_rng(4)
        own = random.uniform(5, 10, data["papers"].shape[::2])
        data["quality"][:, 18:20] = data["papers"][:, 18:20] * own[:, None]
        nearly = own * random.uniform(0.95, 1.05, own.shape)
        data["indicator.impact_factor"][:] = nearly[:, None]
    found, table = {claim.number: claim for claim in study.claims(records)}, judged(records)
    counted = robustness.CHANGES[0].description
    assert found[7].verdict == table["nothing: as stated"][7] == "refuted"
    assert table[counted] == {2: "refuted", 6: "refuted", 7: "confirmed"} | dict.fromkeys(
        (1, 3, 4, 5)
    )
    assert f"{counted} (confirmed)" in found[7].depends_on
    assert found[1].depends_on == ()


def test_rewards_and_tables_of_those_who_learn_are_further_readings():
    records = {at.name: as_the_thesis_says(at) for at in SCENARIOS}
    for at in (EDITOR_LEARNS, AUTHOR_LEARNS):
        other = Condition(at.author, at.editor, at.size, "reward_level")
        records[other.name] = as_the_thesis_says(at)
        records[other.name]["results"].attrs["reading"] = "reward_level"
        records[other.name]["results"]["indicator.impact_factor"] *= -1
    assert judged(records)[WORDS["reward_level"]][7] == "refuted"
    marked = {claim.number: claim.depends_on for claim in study.claims(records)}
    assert f"{WORDS['reward_level']} (refuted)" in marked[7]
    assert not any(WORDS["table_own"] in words for words in marked[7])  # it was not run


def test_an_impact_factor_counts_the_papers_of_the_two_years_before():
    data = made(STATIC[0], papers=np.full(20, 10), quality=np.full(20, 8.0))
    data["papers"][:, 18, 0], data["quality"][:, 18, 0] = 30, 30 * 4.0
    data["papers"][:, 18:20, 1] = data["quality"][:, 18:20, 1] = 0
    found = results.latent(data, "impact_factor", "counted")
    np.testing.assert_allclose(found[:, 20, 0], (30 * 4 + 10 * 8) / 40)
    assert np.isnan(found[:, 20, 1]).all()
    np.testing.assert_allclose(found[:, 20, 2:], 8)
    assert np.isnan(found[:, :3]).all()  # the initial years are not told apart
    assert np.isfinite(found[:, 3]).all()


def test_chance_adds_to_the_share_of_few_and_is_taken_away():
    rng = np.random.default_rng(5)
    data = made(STATIC[0])
    data["papers"][:, -1] = rng.multinomial(100, np.full(20, 1 / 20), 6)
    assert (results.share_in_last_year(data) > 0.3).all()
    error = 3 * 0.03 / np.sqrt(6)  # of the mean of six such shares
    assert results.share_beyond_chance(data).mean() == pytest.approx(0.25, abs=error)
    data["papers"][:, -1] = np.where(np.arange(20) == 7, 100, 0)
    beyond = results.share_beyond_chance(data)
    assert ((beyond > 0.8) & (beyond < 0.9)).all()
    data["papers"][:, -1] = 0
    assert np.isnan(results.share_beyond_chance(data)).all()


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
    data["quality"][:, -1] = data["papers"][:, -1] * (1.0 + data["papers"][:, -1])
    np.testing.assert_allclose(results.papers_and_quality(data), 1)
    np.testing.assert_allclose(results.skewness(data), 0, atol=1e-9)
    rng = np.random.default_rng(3)
    counts = rng.integers(0, 50, (6, 21, 30))
    data["histogram"][:] = counts
    sample = np.repeat(data["bin"].values, counts[0, -5:].sum(0))
    np.testing.assert_allclose(results.skewness(data)[0], scipy.stats.skew(sample))
    data["quality"][:] = data["papers"] * 9.0
    np.testing.assert_allclose(results.off_centre(data), 0.1)


def test_measures_of_years_kept_together_are_those_of_every_year():
    rng = np.random.default_rng(6)
    papers = rng.integers(0, 9, (6, 21, 20))
    of_years = {
        "papers": papers,
        "quality": papers * rng.uniform(5, 10, papers.shape),
        "histogram": rng.integers(0, 9, (6, 21, 30)),
    }
    indices = {
        "h_index": rng.integers(0, 40, (6, 21, 100)),
        "impact_factor": rng.uniform(0, 9, papers.shape),
        "acceptance_rate": rng.uniform(0, 1, papers.shape),
    }
    stuck, skill = rng.uniform(0, 1, (6, 21)), rng.uniform(0, 15, (6, 100))
    whole, small = (
        xr.Dataset(
            kept.results(at, of_years, indices, skill, stuck),
            coords=kept.coordinates(at, 20, np.linspace(0, 15, 31)),
            attrs={"years": 20, "quality_max": 15.0},
        )
        for at in (STATIC[0], Condition("random", "mild_scrutiny", SMALL, "sequential"))
    )
    assert small.nbytes < whole.nbytes / 3
    names = ("h_index", "impact_factor", "acceptance_rate", "papers")
    for measure in (
        *(results.last_correlation(name) for name in names),
        results.last_correlation("impact_factor", "spearman", "counted"),
        results.papers_and_quality,
        results.share_of_few,
        results.share_beyond_chance,
        results.growth,
        results.off_centre,
        lambda data: results.off_centre(data, "all"),
        results.skewness,
        results.stuck,
        results.acceptance,
    ):
        np.testing.assert_allclose(measure(small), measure(whole), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(
    ("journals", "per_year"), [(4, 3), (20, 10), (40, 10), (40, 300), (9000, 1)]
)
def test_scenes_stay_within_their_share_of_a_record(journals, per_year):
    rng = np.random.default_rng(7)
    steps = 20 * per_year
    size = (2 * steps, journals + 60)
    times = [f"year {1 + step // per_year}, step {step % per_year}" for step in range(steps)]
    scene = Scene(
        title="made up",
        bounds=(-20.0, 0.0, 20.0, 10.0),
        frame_seconds=0.2,
        palette=tints("one", "other"),
        shapes=(Shape("circle", 1.0),) * size[1],
        position=rng.uniform(-20, 20, (*size, 2)),
        tint=rng.integers(0, 2, size),
        scale=rng.uniform(0, 1, size),
        fresh=np.zeros(size, bool),
        captions=tuple(time for time in times for _ in range(2)),
        chapters=tuple(time.split(",")[0] for time in times for _ in range(2)),
        series={"papers": rng.uniform(0, 9, (2 * steps, 1))},
    )
    found = kept.scenes([scene] * 5, per_year)
    assert sum(data.nbytes for data in found.values()) <= kept.SCENE_BYTES
    assert len(found) <= 3
    for data in found.values():
        shown = Scene.from_dataset(data)
        frames = [scene.captions.index(caption) for caption in shown.captions[::2]]
        assert shown.captions[1::2] == shown.captions[::2]
        np.testing.assert_allclose(shown.position[::2], scene.position[frames], atol=0.01)
        np.testing.assert_array_equal(shown.tint[::2], scene.tint[frames])
        gaps = 1 + np.flatnonzero(np.diff(frames) != 2)
        assert np.asarray(shown.fresh)[2 * gaps].all()  # nothing moves from one year to a later one
    if (journals, per_year) == (20, 10):
        years = dict.fromkeys(Scene.from_dataset(found["scene"]).chapters)
        assert list(years) == [f"year {year}" for year in SNAPSHOTS]


def test_published_records_are_small():
    sizes = [file.stat().st_size for file in PUBLISHED.rglob("*") if file.is_file()]
    assert len(sizes) > len(cases("thesis"))
    assert max(sizes) < 2**20
    assert sum(sizes) < 6 * 10**6


def test_records_are_small_and_exact():
    assert kept.compact(np.array([0.0, 127.0])).dtype == np.int8
    assert kept.compact(np.array([128])).dtype == np.int16
    assert kept.compact(np.array([-40_000.0])).dtype == np.int32
    assert kept.compact(np.array([1.0, np.nan])).dtype == np.float32
    assert kept.compact(np.array([0.5])).tolist() == [0.5]
    assert kept.compact(np.array([2.0**31])).tolist() == [2.0**31]
