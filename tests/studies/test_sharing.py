from functools import partial

import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from tests.studies.fuzzing import drawn, fuzz, misdrawn

from ethogram.campaign.context import Context
from ethogram.core.errors import TooLarge
from ethogram.core.scene import Scene
from ethogram.core.world import Outcome, Transition
from ethogram.studies import sharing as study
from ethogram.studies import training
from ethogram.studies.sharing import compute
from ethogram.studies.sharing import results as measure
from ethogram.studies.sharing.compute import inequality
from ethogram.studies.sharing.earnings import earnings
from ethogram.studies.sharing.plan import Settings
from ethogram.studies.sharing.validation import ACTS, summarise
from ethogram.worlds.sharing import Sharing, State


def run(*changes):
    """Records of the smoke plan with changes."""
    cases = study.cases(study.PLANS["smoke"].override(changes))
    return {case.name: study.run(case, Context()) for case in cases}


@pytest.fixture(scope="module")
def records():
    """Two trials of always-communication, learned for a while; compiled once for six settings."""
    return run("strategy=always", "world.observe_filling=false", "episodes=3000", "trials=3")


def test_the_thesis_plan_is_table_3_1():
    cases = study.cases(study.PLANS["thesis"])
    assert len({case.name for case in cases}) == 24
    for case in cases:
        settings = case.parsed(Settings)
        assert (settings.trials, settings.episodes, settings.validation_episodes) == (
            20,
            20_000,
            100,
        )
        world, learner, explore = settings.world, settings.learner, settings.exploration
        assert (world.agents, world.resources, world.steps) == (10, 2, 100)
        assert (learner.learning_rate, learner.discount) == (0.1, 0.9)
        assert (explore.start, explore.end, explore.decay) == (1.0, 0.01, 0.9995)


def test_cooperating_learners_reach_the_99_of_table_3_2(records):
    table = study.tables(records)[0]
    assert (table.name, table.columns[2]) == ("table-3-2", "filling hidden")
    cell = next(row[2] for row in table.rows if row[:2] == ("cooperative", "always"))
    assert cell.value == pytest.approx(99.0)
    assert cell.published == 99.0


def test_learning_pays(records):
    groups = records["cooperative-always-hidden"]
    curve = groups["results"]["training_return"].mean("trial")
    assert curve[-1] > curve[0] + 20


def test_a_scene_of_an_episode_is_kept(records):
    scene = Scene.from_dataset(records["mixed-always-hidden"]["scene"])
    first = records["mixed-always-hidden"]["results"]["validation_return"][0, 0]
    np.testing.assert_allclose(scene.series["return"][-1], first, rtol=1e-5)


def test_what_was_not_run_is_said_to_be_not_run(records):
    claims = {claim.number: claim for claim in study.claims(records)}
    assert set(claims) == set(range(1, 10))
    settles = claims.pop(6)  # which one strategy shows, too
    assert settles.verdict in ("undecided", "refuted")
    assert settles.effect is not None
    assert {claim.verdict for claim in claims.values()} == {"not run"}
    assert "none, cooperative, filling hidden" in claims[1].note


def test_without_records_there_is_nothing_to_draw_and_nothing_to_judge():
    assert study.figures({}) == []
    assert {claim.verdict for claim in study.claims({})} == {"not run"}
    assert all(row[2] is None for row in study.tables({})[0].rows)


def test_figures_show_every_condition_that_there_is(records):
    figures = {figure.name: figure for figure in study.figures(records)}
    assert set(figures) == {f"figure-3-{number}" for number in range(1, 7)}
    shown = {row[:3] for row in figures["figure-3-2"].data.rows}
    scenarios = ("cooperative", "competitive", "mixed")
    assert shown == {(scenario, "hidden", "always") for scenario in scenarios}


def test_validation_is_reduced_as_by_hand():
    def step(preference, spoke, place, reward, filling):
        never = {"agent": jnp.zeros(2, bool)}
        outcome = Outcome(
            observation={},
            reward={"agent": jnp.array(reward)},
            terminated=never,
            truncated=never,
            metrics={"filling": jnp.array(filling)},
        )
        state = State(jnp.array(place), jnp.array(preference), jnp.array(spoke), jnp.int32(0))
        return Transition(jax.random.key(0), state, {}, {}, outcome, state, jnp.array(False))

    steps = [
        step([1, 2], [True, False], [0, 0], [0.0, 0.0], [0, 0]),
        step([1, 1], [True, True], [1, 0], [0.5, 0.0], [1, 0]),
        step([1, 1], [False, True], [1, 1], [1.0, 1.0], [2, 0]),
    ]
    episode = jax.tree.map(lambda *parts: jnp.stack(parts), *steps)
    seen = summarise(episode, Sharing(agents=2, steps=3))
    np.testing.assert_allclose(seen.displacement, [2, 1, 2])  # |rho - 1| summed
    np.testing.assert_allclose(seen.communication, [0.5, 1, 0.5])
    np.testing.assert_allclose(seen.reward, [0, 0.25, 1])
    assert ACTS == ("confirm, silent", "confirm, speaking", "change, silent", "change, speaking")
    by_hand = [[0, 0, 0.5, 0.5], [0, 0.5, 0, 0.5], [0.5, 0.5, 0, 0]]
    np.testing.assert_allclose(seen.acts, by_hand)


def test_inequality_is_the_sample_deviation_over_agents():
    np.testing.assert_allclose(inequality(np.array([[1.0, 3.0], [2.0, 2.0]])), [2**0.5, 0])
    np.testing.assert_array_equal(inequality(np.ones((3, 1))), [0, 0, 0])


def displacements(*trials):
    attrs = {"agents": 10, "resources": 2}
    return xr.Dataset({"displacement": (("trial", "step"), np.array(trials))}, attrs=attrs)


def test_the_optimum_counts_from_the_step_from_which_the_displacement_stays_close():
    data = displacements(
        [10, 4, 0.4, 0, 0, 0, 0, 0, 0, 0, 9],
        [10, 0, 3, 0, 0, 0, 0, 0, 0, 0.6, 0],
        [10, 0.5, 0, 0, 0, 0, 0, 0, 0, 0, 0],
    )
    steps = measure.steps_to_optimum("mixed")(data)
    np.testing.assert_array_equal(steps, [3, 11, 2])
    np.testing.assert_allclose(measure.unsettled(data), [9, 0.6, 0])


@pytest.mark.parametrize(
    ("agents", "resources", "scenario", "best"),
    [(10, 2, "cooperative", 10), (10, 2, "mixed", 0), (10, 3, "competitive", 4 / 3)],
)
def test_the_best_displacement_is_all_together_or_as_even_as_can_be(
    agents, resources, scenario, best
):
    assert measure.best_displacement(agents, resources, scenario) == pytest.approx(best)


def records_with(always, none, episodes=20_000):
    """Five steady trials of each strategy and setting, with I given by whether it is hidden."""
    records = {}
    for condition in measure.conditions():
        spread = {"always": always, "none": none}.get(condition.strategy, (1.0, 1.0))
        spread = spread[condition.observed] + 1e-3 * np.arange(5)[:, None]
        steps = np.zeros((5, 100))
        data = {
            "training_return": (("trial", "point"), np.zeros((5, 1))),
            "training_inequality": (("trial", "point"), spread),
            "validation_return": (("trial", "episode", "agent"), np.zeros((5, 100, 10))),
            "displacement": (("trial", "step"), steps + 10),
            "communication": (("trial", "step"), steps),
            "acts": (("trial", "step", "act"), np.zeros((5, 100, 4))),
            "payoff": (("filling",), np.linspace(0.1, 1.0, 10)),
        }
        attrs = {"agents": 10, "resources": 2, "largest_reward": 1.0}
        results = xr.Dataset(data, coords={"point": [episodes]}, attrs=attrs)
        records[condition.name] = {"results": results}
    return records


def test_a_lead_that_is_none_is_not_larger():
    behind = study.claims(records_with(always=(6.0, 5.8), none=(1.0, 1.0)))[1]
    assert behind.verdict == "refuted"


def test_trials_that_never_reach_the_optimum_are_censored_and_few_of_them_decide_nothing():
    together = study.claims(records_with(always=(1.0, 1.0), none=(1.0, 1.0)))[5]
    assert together.verdict == "undecided"  # all stand together, also where they should spread
    assert together.compared == "always reaches the optimum: competitive, filling hidden"
    assert "5 of 5 trials at the cap" in together.note
    assert "leans against the claim" in together.note


def test_a_short_plan_decides_nothing(records):
    short = study.claims(records_with((6.0, 5.8), (1.0, 1.0), episodes=60))
    assert {claim.verdict for claim in short} == {"undecided"}
    for claim in short:
        assert claim.note.startswith("trained for 60 of the 20 000 episodes")
    watched = next(claim for claim in study.claims(records) if claim.number == 6)
    assert watched.note.startswith(
        "trained for 3 000 of the 20 000 episodes and watched for 5 of the 100 validation episodes"
    )


def test_the_margin_on_j_is_a_share_of_what_can_be_earned(monkeypatch):
    stated = []
    monkeypatch.setitem(study.claims.__globals__, "judge", stated.extend)
    study.claims(records_with((6.0, 5.8), (1.0, 1.0)))
    margins = {
        abs(part.margin)
        for spec in stated
        for part in spec.parts
        if part.label.startswith(("J(", "lead in J"))
    }
    earned = earnings(np.linspace(0.1, 1.0, 10), 2, 100)
    assert earned.optimum == pytest.approx(99.0)  # all on one place, 1 each
    assert sorted(margins) == pytest.approx([0.02 * earned.range] * len(margins))
    assert margins


def test_earnings_are_those_worked_by_hand():
    # Two agents, two places: 1 alone, 0.4 for each of two.  Apart is best.
    apart = earnings(np.array([1.0, 0.4]), 2, 3)
    assert apart.optimum == pytest.approx(2 * 1.0)
    # Step 2: active with chance 1/2, company then with 1/4; step 3: 3/4, and 3/8.
    step_2, step_3 = 1 / 2 * (1 - 0.6 / 4), 3 / 4 * (1 - 0.6 * 3 / 8)
    assert apart.random == pytest.approx(step_2 + step_3)
    assert apart.range == apart.optimum - apart.random
    # Three agents, two places, the more the better: all on one, 3 each.
    assert earnings(np.array([1.0, 2.0, 3.0]), 2, 2).optimum == pytest.approx(3.0)
    assert earnings(np.array([1.0]), 1, 5) == (4.0, 4.0)


def test_random_agents_earn_what_is_computed_for_them():
    for scenario, measured in (("cooperative", 53.6), ("competitive", 17.4), ("mixed", 42.2)):
        plan = study.PLANS["thesis"].override([f"world.scenario={scenario}"])
        settings = study.cases(plan)[0].parsed(Settings)
        found = earnings(compute.payoff(settings).astype(float), 2, 100)
        assert found.random == pytest.approx(measured, abs=0.1)  # of the published thesis plan
    assert found.optimum == pytest.approx(99.0)


def test_the_best_off_are_compared_with_what_figure_3_6_shows():
    claim = study.claims(records_with((6.0, 5.8), (1.0, 1.0)))[7]
    assert "random" not in claim.compared
    assert "random" not in claim.test
    assert any("random" in revision.change for revision in claim.history)


def test_claims_say_when_they_were_stated_and_what_was_changed_since():
    claims = study.claims({})
    assert {claim.stated for claim in claims} == {"2026-11-22"}
    early = {claim.number for claim in claims if claim.history[0].date == "2026-11-22"}
    assert early == {2, 6}  # after a first run had been seen
    assert all(revision.known for claim in claims for revision in claim.history)


def test_a_checkpoint_goes_on_to_the_same_record(monkeypatch):
    monkeypatch.setattr(training, "train", partial(training.train, seconds=0))
    case = study.cases(
        study.PLANS["smoke"].override(
            ["world.scenario=mixed", "strategy=none", "world.observe_filling=true"]
        )
    )[0]
    saved = []

    class Interrupted(Context):
        def __init__(self, found):
            super().__init__()
            self.found = found

        def restore(self):
            return None if self.found is None else dict(self.found)

        def checkpoint(self, make):
            saved.append({name: array.copy() for name, array in make().items()})

    whole = study.run(case, Interrupted(None))["results"]
    after_50_of_60_episodes = saved[49]
    resumed = study.run(case, Interrupted(after_50_of_60_episodes))["results"]
    assert len(saved) == 70  # the second run had ten episodes left
    xr.testing.assert_identical(whole, resumed)


@pytest.mark.parametrize(
    "changes",
    [
        ["world.steps=1000000", "trials=10000"],  # an episode of all trials
        ["episodes=100000000", "record_every=1", "trials=10000"],  # the learning curves
        ["validation_episodes=1000000", "world.agents=10000"],  # the returns
        ["strategy=optional", "world.agents=20", "world.resources=4"],  # the tables
    ],
)
def test_a_case_too_large_for_memory_is_refused_before_it_is_computed(changes):
    one = ["world.scenario=mixed", "world.observe_filling=false", "strategy=none"]
    case = study.cases(study.PLANS["smoke"].override([*one, *changes]))[0]
    with pytest.raises(TooLarge, match=r"needs .* of memory; .* are free"):
        study.run(case, Context())


# what fixes a compiled program: drawn freely in the slow test, from a few in the fast one
SHAPES = {
    "world.agents": st.sampled_from([1, 3]),
    "world.resources": st.sampled_from([1, 2]),
    "world.steps": st.sampled_from([1, 12]),
    "world.observe_filling": st.booleans(),
    "world.reward": st.sampled_from(["scaled", "literal"]),
    "world.terminal": st.booleans(),
    "strategy": st.sampled_from(["always", "optional", "none", "random"]),
    "episodes": st.integers(1, 5),
    "validation_episodes": st.integers(1, 3),
    "record_every": st.integers(1, 7),
    "trials": st.integers(1, 2),
}
FEW_SHAPES = st.sampled_from(
    [
        {"world.agents": 3, "world.steps": 12, "record_every": 2},
        {"world.agents": 1, "world.resources": 1, "world.steps": 1, "trials": 1},
        {"strategy": "optional", "world.terminal": True, "world.reward": "literal"},
        {"strategy": "none", "record_every": 1, "validation_episodes": 1},
    ]
)
NUMBERS = {
    "world.scenario": st.sampled_from(["cooperative", "mixed"]),
    "learner.learning_rate": st.floats(0, 1),
    "learner.discount": st.floats(0, 1),
    "exploration.start": st.floats(0, 1),
    "exploration.end": st.floats(0, 1),
    "exploration.decay": st.floats(0, 1),
    "seed": st.integers(0, 2**32 - 1),
}
ONE_CASE = {
    "world.scenario": "mixed",
    "world.observe_filling": False,
    "strategy": "none",
    "episodes": 2,
}
ODD = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(max_value=20),
    st.integers(min_value=10**9),  # too much for any machine
    st.floats(),
    st.text(max_size=8),
    st.lists(st.integers()),
)
WRONG = misdrawn([*SHAPES, *NUMBERS], ODD)


def fuzz_sharing(examples, shapes, capsys):
    return fuzz("sharing", ONE_CASE, drawn(shapes, NUMBERS), WRONG, examples, capsys, then="claims")


def test_drawn_settings_run_or_are_refused_with_a_message(capsys):
    outcomes = fuzz_sharing(25, FEW_SHAPES, capsys)
    assert outcomes["ran"] >= 25 / 3
    assert outcomes["refused"] > 0


@pytest.mark.slow
def test_many_drawn_settings_run_or_are_refused_with_a_message(capsys):
    outcomes = fuzz_sharing(500, st.fixed_dictionaries({}, optional=SHAPES), capsys)
    assert outcomes["ran"] >= 500 / 3
    assert outcomes["refused"] > 0
