from functools import partial

import equinox as eqx
import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from tests.studies.contexts import Remembering
from tests.studies.fuzzing import MESSAGES, drawn, fuzz, misdrawn

from ethogram.campaign.context import Context
from ethogram.core import specs
from ethogram.core.errors import TooLarge
from ethogram.core.scene import Scene
from ethogram.core.wrappers import RolePolicies
from ethogram.learners.train import Diverged
from ethogram.studies import language as study
from ethogram.studies import training
from ethogram.studies.language.metrics import association_information
from ethogram.studies.language.plan import Settings, condition_of, learner_of, world_of
from ethogram.studies.language.validation import influence, watch
from ethogram.worlds.language import Language
from ethogram.worlds.language.policies import Informed, Optimal, Uninformed

# one case of the smoke plan, small; in all tests the same shapes, hence one compiled program
ONE = ["expressiveness=1", "talkers=learned", "learner.buffer_size=200"]


def cases(plan, *changes):
    return study.cases(study.PLANS[plan].override(changes))


@pytest.fixture(scope="module", autouse=True)
def _checkpoint_after_every_play():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training, "train", partial(training.train, seconds=0))
        yield


@pytest.fixture(scope="module")
def ran():
    """A case that was run, what it left behind, and its checkpoints."""
    (case,) = cases("smoke", *ONE)
    context = Remembering()
    return case, study.run(case, context), context.saved


@pytest.fixture(scope="module")
def records(ran):
    case, record, _ = ran
    return {case.name: record}


class Taught(eqx.Module):
    """In the place of a learner: hand-made policies, which nothing changes."""

    world: Language
    policies: RolePolicies
    discount: float = 0.95
    hidden_size: int = 0

    def policy(self, state, *, explore=False):
        del state, explore
        return self.policies

    def actor_outputs(self, state, observation):
        del state
        weights = self.policies(jax.random.key(0), observation)
        return jax.tree.map(jnp.log, weights)


def taught(world, mover):
    return Taught(world, RolePolicies({"mover": mover(world), "talker": Optimal(world)}))


@pytest.fixture(scope="module")
def watched():
    """Robots that know how to talk and how to listen, watched in every way."""
    learner = taught(Language(vocabulary_size=4, max_vocabulary_size=6), Informed)
    return watch(learner, None, jax.random.key(1), 2000)


def test_the_thesis_plan_is_section_2_5_1():
    found = cases("thesis")
    conditions = [condition_of(case.parsed(Settings)) for case in found]
    learned = [at for at in conditions if at.talkers == "learned"]
    assert len({case.name for case in found}) == len(found)
    assert sum(not at.silence for at in learned) == 333
    assert sum(at.silence for at in learned) == 16  # 2x2 again; without symbols all are silent
    assert len(conditions) - len(learned) == 18
    assert {at.vocabulary_size for at in learned if (at.robots, at.targets) == (3, 4)} == {
        *range(49)
    }
    for case in found:
        chosen = case.parsed(Settings)
        assert (chosen.trials, chosen.episodes, chosen.world.steps) == (5, 20_000, 25)
        learner = chosen.learner
        assert (learner.discount, learner.batch_size, learner.learning_rate) == (0.95, 512, 0.01)
        assert (learner.buffer_size, learner.max_gradient_norm) == (1_000_000, 0.5)
        assert (learner.hidden_size, learner.learning_starts) == (64, 25 * 512)


def test_an_alphabet_has_one_case_whatever_the_expressiveness_it_was_asked_by():
    asked = cases("thesis", "world.robots=3", "world.targets=3", "expressiveness=0.12,0.2,1")
    names = [case.name for case in asked if "silence" not in case.name]
    assert names == [
        "3x3-learned-1",
        "3x3-learned-9",
        "3x3-no-communication",
        "3x3-optimal",
    ]
    again = cases("thesis", "world.robots=3", "world.targets=3", "expressiveness=0.15")
    assert again[0].id == asked[0].id


def test_an_expressiveness_that_is_a_fraction_is_not_rounded_down_to_the_symbol_below():
    size = ("world.robots=3", "world.targets=3", "talkers=learned")
    for symbols in range(37):
        (case,) = cases("smoke", *size, f"expressiveness={symbols / 9}")
        assert case.name == f"3x3-learned-{symbols}"


def test_a_curve_shares_one_compiled_program():
    worlds = [
        world_of(case.parsed(Settings))
        for case in cases("thesis", "world.robots=2", "world.targets=2", "talkers=learned")
        if "silence" not in case.name
    ]
    assert len(worlds) == 17
    assert len({jax.tree.structure(world) for world in worlds}) == 1


def test_a_record_has_what_tables_and_figures_need(records):
    data = records["2x2-learned-4"]["results"]
    assert dict(data.sizes) == {
        "trial": 2,
        "episode": 8,
        "point": 3,
        "talker": 2,
        "guided": 2,
        "target": 2,
        "word": 5,
        "listener": 2,
    }
    np.testing.assert_array_equal(data["point"], [16, 32, 48])
    meaning = data["meaning"].values
    for robot in (0, 1):
        assert np.isnan(meaning[:, robot, robot]).all()
        np.testing.assert_allclose(meaning[:, robot, 1 - robot].sum(-1), 1.0, rtol=1e-5)
    assert (meaning[~np.isnan(meaning[..., 0])][:, 0] == 0).all()  # silence is not allowed
    assert all(np.isfinite(data[name]).all() for name in data if name != "meaning")


def test_scenes_show_the_episodes_that_were_validated_first_of_the_first_trials(records):
    groups = records["2x2-learned-4"]
    first = groups["results"]["validation_return"].values[:3, 0]
    scenes = [Scene.from_dataset(groups[name]) for name in groups if name != "results"]
    for scene, expected in zip(scenes, first, strict=True):
        total = -2 * scene.series["distance"][1:].sum()  # mover and guide, without the start
        np.testing.assert_allclose(expected, total, rtol=1e-4)
        assert scene.links


def test_optimal_talkers_have_a_word_for_every_association(watched):
    np.testing.assert_allclose(association_information(np.asarray(watched.meaning)), 1.0)


def test_a_report_can_be_made_of_the_records(records):
    assert study.tables(records)
    assert study.figures(records)
    assert [claim.number for claim in study.claims(records)] == [1, 2, 3, 4, 5, 6, 7]
    assert {claim.verdict for claim in study.claims(records)} <= {"not run", "undecided"}


def test_watching_the_reference_controllers_gives_what_is_known_of_them(watched):
    error = np.asarray(watched.validation).std() / np.sqrt(2000)
    assert abs(np.mean(watched.validation) + 13.17) < 4 * error
    np.testing.assert_array_equal(watched.noise_free, watched.validation)  # they draw nothing


def test_a_broken_channel_costs_those_who_listen(watched):
    assert np.mean(watched.silenced) < -30  # all go to the middle of the targets
    assert np.mean(watched.scrambled) < -30  # half of the words name the wrong target


def test_the_discounted_return_is_that_of_equation_2_1(watched):
    # the first episode, from its states: the start, then 25 steps, each robot counted twice
    places = [watched.start.position[None], watched.states.position]
    offset = np.concatenate(places) - np.asarray(watched.start.target)[watched.start.goal]
    reward = -2 * np.abs(offset).sum((1, 2))
    np.testing.assert_allclose(
        watched.discounted[0], (reward * 0.95 ** np.arange(26)).sum(), rtol=1e-5
    )
    np.testing.assert_allclose(watched.validation[0], reward[1:].sum(), rtol=1e-5)


def test_words_move_those_who_listen_and_nobody_else(watched):
    assert (np.asarray(watched.influence) > 0.3).all()  # bits; also when a robot hears itself
    world = Language(vocabulary_size=4, max_vocabulary_size=6)
    states = jax.vmap(jax.vmap(lambda key: world.reset(key)[0]))(
        jax.random.split(jax.random.key(2), (2, 3))
    )
    unmoved = eqx.filter_jit(influence)(taught(world, Uninformed), None, states)
    np.testing.assert_allclose(unmoved, 0.0, atol=1e-6)


def test_a_checkpoint_goes_on_to_the_same_record(ran):
    case, record, saved = ran
    assert len(saved) == 24  # twelve plays of four episodes in each of two trials
    for found in (saved[0], saved[5], saved[11], saved[17]):
        again = study.run(case, Remembering(found))
        xr.testing.assert_identical(record["results"], again["results"])


def test_a_loss_that_is_not_finite_stops_the_run_and_names_trial_agent_and_update():
    (case,) = cases("smoke", *ONE, "learner.learning_rate=1e30")
    told = r"Trial 0: (critic|actor)_loss\.(mover|talker)\[\d\] is not finite at update \d+"
    with pytest.raises(Diverged, match=told):
        study.run(case, Context())


def test_a_learner_has_no_more_room_for_transitions_than_its_episodes_fill():
    (case,) = cases("quick", "expressiveness=1", "talkers=learned")
    assert learner_of(case.parsed(Settings)).buffer_size == 8000 * 25


@pytest.mark.parametrize(
    "changes",
    [
        ["world.steps=1000000", "learner.buffer_size=1000000000", "episodes=1000"],  # the replay
        [
            "validation_episodes=1000000",
            "world.steps=1000",
            "learner.buffer_size=5000",
        ],  # the validation
        ["learner.hidden_size=100000"],  # the networks
        ["learner.batch_size=1000000", "world.robots=7", "expressiveness=100"],  # a minibatch
        ["episodes=100000000", "record_every=1", "trials=10000"],  # the learning curves
    ],
)
def test_a_case_too_large_for_memory_is_refused_before_it_is_computed(changes):
    (case,) = cases("smoke", *ONE, *changes)
    with pytest.raises(TooLarge, match=r"needs .* of memory; .* are free"):
        study.run(case, Context())


NUMBERS = {
    "learner.learning_rate": st.floats(0, 1, exclude_min=True, width=32),
    "learner.discount": st.floats(0, 1),
    "learner.temperature": st.floats(0.1, 10),
    "learner.tau": st.floats(0, 1),
    "learner.max_gradient_norm": st.floats(0.1, 10),
    "learner.logit_penalty": st.floats(0, 1),
    "seed": st.integers(0, 2**32 - 1),
}
# what fixes a compiled program: drawn in the slow test
SHAPES = {
    "world.robots": st.sampled_from([2, 3]),
    "world.targets": st.sampled_from([1, 2]),
    "world.steps": st.sampled_from([1, 7]),
    "world.dynamics": st.sampled_from(["damped", "literal"]),
    "world.execution": st.sampled_from(["soft", "hard"]),
    "world.allow_silence": st.booleans(),
    "world.observe_velocity": st.booleans(),
    "talkers": st.sampled_from(["learned", "no-communication", "optimal"]),
    "expressiveness": st.sampled_from([0, 0.5, 2]),
    "episodes": st.integers(1, 30),
    "record_every": st.integers(1, 40),
    "trials": st.integers(1, 2),
    "learner.straight_through": st.booleans(),
    "learner.updates_per_iteration": st.integers(1, 2),
    "learner.episodes_per_update": st.integers(1, 5),
}
ODD = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(max_value=-1),
    st.integers(min_value=10**12),  # too much for any setting
    st.floats(max_value=-0.1),
    st.text(max_size=8),
    st.lists(st.integers()),
)
WRONG = misdrawn([*SHAPES, *NUMBERS], ODD)
SMALL = dict(change.split("=") for change in (*ONE, "episodes=16", "trials=1"))


def fuzz_language(examples, shapes, capsys):
    messages = (*MESSAGES, "not finite", "more than max_vocabulary_size")
    valid = drawn(shapes, NUMBERS)
    return fuzz("language", SMALL, valid, WRONG, examples, capsys, then="report", messages=messages)


def test_drawn_settings_run_or_are_refused_with_a_message(capsys):
    outcomes = fuzz_language(20, st.just({}), capsys)
    assert outcomes["ran"] >= 20 / 3
    assert outcomes["refused"] > 0


@pytest.mark.slow
def test_many_drawn_settings_run_or_are_refused_with_a_message(capsys):
    outcomes = fuzz_language(40, st.fixed_dictionaries({}, optional=SHAPES), capsys)
    assert outcomes["ran"] >= 40 / 3
    assert outcomes["refused"] > 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plan", "returns", "limit", "at_least"),
    [("thesis", "validation_return", -18, 4), ("tuned", "noise_free_return", -15, 5)],
)
def test_two_robots_learn_a_language(plan, returns, limit, at_least):
    size = ["world.robots=2", "world.targets=2", "trials=5", "world.allow_silence=false"]
    (case,) = cases(plan, "expressiveness=1", "talkers=learned", *size)
    data = study.run(case, Context())["results"]
    learned = data[returns].mean("episode").values
    assert len(learned) == 5
    assert (learned > limit).sum() >= at_least
    assert (data["silenced_return"].mean("episode") < -30).all()


def test_costs_are_computed_once_per_shape_and_nothing_is_built_for_them(monkeypatch):
    def build(*_, **__):
        raise AssertionError("networks are built")

    monkeypatch.setattr("ethogram.learners.networks.MLP.init", build)
    specs._spec.cache_clear()
    found = cases("thesis", "world.robots=2", "world.targets=2,3")
    assert len({study.cost(case).bytes for case in found}) > 2
    shapes = {
        (at.world.targets, at.world.allow_silence, at.talkers)
        for at in (case.parsed(Settings) for case in found)
    }
    # a baseline's talkers follow a policy around the game, of which the roles are looked at, too
    baselines = sum(talkers != "learned" for *_, talkers in shapes)
    assert specs._spec.cache_info().misses <= 2 * len(shapes) + baselines


def test_the_smallest_learner_takes_the_time_of_its_steps_and_rounds():
    """Half a million plays of 25 steps, of four agents that learn after each, take some minutes."""
    (case,) = cases("smoke", *ONE[:2], "trials=1", "validation_episodes=2", "episodes=2000000")
    cost = study.cost(case)
    assert 500_000 * 1e-3 < cost.seconds < 500_000 * 1e-2
    assert cost.bytes > 3 * 196_000_000  # a million transitions, and a checkpoint of them
