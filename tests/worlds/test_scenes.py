"""What every registered world promises of the scenes that it draws of its rollouts."""

import dataclasses
import json
import re
from functools import cache
from html.parser import HTMLParser

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.learners.toys import Market

from ethogram.core.errors import EthogramError, TooLarge
from ethogram.core.rollout import rollout, watch
from ethogram.core.scene import Scene
from ethogram.core.spaces import Simplex
from ethogram.worlds import WORLDS
from ethogram.worlds.language import Language
from ethogram.worlds.publishing.learnable import LearnablePublishing
from ethogram.worlds.publishing.learnable import State as Learning
from ethogram.worlds.publishing.policies import Ranking, Scrutiny
from ethogram.worlds.publishing.scene import glimpse, record
from ethogram.worlds.sharing import Sharing

STEPS = 6
SMALL = {  # settings, so that little is compiled; a world that is not here has its defaults
    "language": {"steps": STEPS},
    "publishing": {
        "authors": 5,
        "journals": 3,
        "initial_papers": 20,
        "years": 2,
        "steps_per_year": 3,
        "references": 2,
    },
    "sharing": {"agents": 3, "steps": STEPS},
    "softbody2d": {"body": "#", "steps": STEPS},
    "softbody3d": {"body": "#", "steps": STEPS},
    "traffic": {"cars": 8, "max_cars": 9, "steps": STEPS},
}
FRAMES = {
    "language": STEPS + 1,
    "publishing": 2 * STEPS,
    "sharing": STEPS,
    "softbody2d": STEPS + 1,
    "softbody3d": STEPS + 1,
    "traffic": STEPS,
}


def at_random(world):
    """A policy that does anything."""

    def act(key, observation):
        del observation
        keys = jax.random.split(key, len(world.roles))
        return {name: drawn(keys[n], role) for n, (name, role) in enumerate(world.roles.items())}

    return act


def drawn(key, role):
    if isinstance(role.action, Simplex):
        used = jnp.ones(role.action.n, bool) if role.action.used is None else role.action.used
        weights = jax.random.normal(key, (role.agents, role.action.n))
        return jax.nn.softmax(jnp.where(used, weights, -jnp.inf))
    return role.action.sample(key, role.agents)


def played(world, steps):
    return eqx.filter_jit(rollout)(world, at_random(world), jax.random.key(3), steps)[1]


def some(trajectory, steps):
    """What is at an index, by NumPy where it can be: JAX would compile for every shape."""

    def at(part):
        is_key = jnp.issubdtype(part.dtype, jax.dtypes.prng_key)
        return part[steps] if is_key else jnp.asarray(np.asarray(part)[steps])

    return jax.tree.map(at, trajectory)


@pytest.fixture(scope="module")
def episodes():
    """By name, a world and an episode of random actions in it, played once."""

    @cache
    def of(name):
        world = WORLDS[name](**SMALL.get(name, {}))
        return world, played(world, world.horizon)

    return of


# where somebody learns, the publishing system is shown as ever: a test of its own compares the two
@pytest.fixture(params=[name for name in WORLDS if name != "learnable_publishing"])
def shown(request, episodes):
    """A world, an episode, and its scene."""
    world, trajectory = episodes(request.param)
    return world, trajectory, world.scene(trajectory)


@pytest.mark.parametrize("name", FRAMES)
def test_there_is_a_frame_for_every_state_that_is_shown(episodes, name):
    world, trajectory = episodes(name)
    scene = world.scene(trajectory)
    assert len(scene.position) == len(scene.captions) == FRAMES[name]


def test_all_that_is_shown_is_finite_within_bounds_and_explained(shown):
    *_, scene = shown
    left, bottom, right, top = scene.bounds
    assert np.isfinite(scene.position).all()
    seen = scene.position[..., [0, -1]]  # in space from the side: along the first axis, and up
    assert (seen >= (left, bottom)).all()
    assert (seen <= (right, top)).all()
    assert (scene.tint >= -1).all()
    assert (scene.tint < len(scene.palette)).all()
    if scene.said is not None:
        assert (scene.said >= -1).all()
        assert (scene.said < len(scene.words)).all()
    for lines in scene.series.values():
        assert np.isfinite(lines).all()


def test_it_can_be_stored(shown):
    *_, scene = shown
    again = Scene.from_dataset(scene.to_dataset())
    assert (again.title, again.shapes, again.captions) == (
        scene.title,
        scene.shapes,
        scene.captions,
    )
    np.testing.assert_allclose(again.position, scene.position, rtol=1e-6)
    np.testing.assert_array_equal(again.tint, scene.tint)


def test_what_is_shown_of_a_step_does_not_depend_on_later_ones(shown):
    world, trajectory, scene = shown
    begun = world.scene(some(trajectory, slice(STEPS - 2)))
    frames = len(begun.position)
    assert 0 < frames < len(scene.position)
    np.testing.assert_array_equal(begun.position, scene.position[:frames])
    np.testing.assert_array_equal(begun.tint, scene.tint[:frames])
    assert begun.captions == scene.captions[:frames]


def test_only_the_first_episode_is_shown(episodes):
    world, _ = episodes("sharing")
    trajectory = played(world, 2 * STEPS + 1)
    first = world.scene(some(trajectory, slice(STEPS)))
    scene = world.scene(trajectory)
    assert len(scene.position) == STEPS
    np.testing.assert_array_equal(scene.position, first.position)
    np.testing.assert_array_equal(scene.series["return"], first.series["return"])


def test_of_a_batch_one_must_be_taken(shown):
    world, trajectory, scene = shown
    batch = some(some(trajectory, None), np.zeros(2, int))
    with pytest.raises(EthogramError, match=rf"axes are \(2, {STEPS}\)\. Of a batch take one"):
        world.scene(batch)
    np.testing.assert_array_equal(world.scene(some(batch, 1)).position, scene.position)
    with pytest.raises(EthogramError, match=r"axes are \(\)"):
        world.scene(some(trajectory, 0))
    with pytest.raises(EthogramError, match=r"axes are \(0,\)"):
        world.scene(some(trajectory, slice(0)))


def test_what_another_world_played_is_refused(shown):
    world, trajectory, _ = shown
    name = type(world).__name__
    for other in (Sharing(agents=7), Language(robots=5)):  # of another number of agents too
        message = rf"{type(other).__name__}\.scene: .*not those of {type(other).__name__}\("
        with pytest.raises(EthogramError, match=message):
            other.scene(trajectory)
    with pytest.raises(EthogramError, match=rf"{name}\.scene: .*not those of {name}\("):
        world.scene(dataclasses.replace(trajectory, state=None))  # as where none are kept


def test_a_world_that_draws_no_scenes_says_so():
    with pytest.raises(EthogramError, match=r"The world Market draws no scenes\."):
        Market().scene(None)


# Each world's own


def test_a_game_is_shown_from_its_start(episodes):
    world, trajectory = episodes("language")
    robots = world.scene(trajectory).position[:, world.targets :]
    np.testing.assert_array_equal(robots[0], trajectory.state.position[0])
    np.testing.assert_array_equal(robots[1:], trajectory.next_state.position)


def test_the_scene_of_whole_years_is_that_which_the_study_records(episodes):
    world, trajectory = episodes("publishing")
    per_year = world.steps_per_year
    seen = jax.vmap(glimpse)(trajectory.outcome, trajectory.next_state)
    years = jax.tree.map(lambda part: part.reshape(-1, per_year, part.shape[-1]), seen)
    quality = np.asarray(trajectory.next_state.quality[0])
    known = np.asarray(trajectory.state.impact[::per_year])
    recorded = record("5 authors, 3 journals", quality, known, years)
    assert recorded.to_dataset().identical(world.scene(trajectory).to_dataset())
    later = world.scene(some(trajectory, slice(4, None)))
    assert later.captions == recorded.captions[8:]


def test_a_system_in_which_somebody_learns_is_shown_as_any_other(episodes):
    system, trajectory = episodes("publishing")
    world = LearnablePublishing(system, Scrutiny(0.25), ranking=Ranking(bins=3))
    level = jnp.zeros((STEPS, system.authors), int)
    states = tuple(
        jax.vmap(Learning)(part, level) for part in (trajectory.state, trajectory.next_state)
    )
    learned = eqx.tree_at(lambda step: (step.state, step.next_state), trajectory, states)
    # a rollout of it would hold what a scene needs in the same places
    like = eqx.filter_eval_shape(rollout, world, at_random(world), jax.random.key(0), STEPS)[1]
    for needed, held in (
        (learned.outcome.metrics, like.outcome.metrics),
        (learned.state, like.state),
    ):
        assert jax.tree.map(jnp.shape, needed) == jax.tree.map(jnp.shape, held)
    assert world.scene(learned).to_dataset().identical(system.scene(trajectory).to_dataset())


def test_a_robot_is_shown_until_its_simulation_diverges(episodes):
    world, trajectory = episodes("softbody3d")
    diverged = eqx.tree_at(
        lambda step: (step.next_state.position, step.next_state.diverged),
        trajectory,
        (
            trajectory.next_state.position.at[-1].set(jnp.nan),
            trajectory.next_state.diverged.at[-1].set(True),
        ),
    )
    scene, whole = world.scene(diverged), world.scene(trajectory)
    assert len(scene.position) == STEPS
    np.testing.assert_array_equal(scene.position, whole.position[:-1])


def test_of_a_long_simulation_states_at_equal_distances_are_shown(episodes):
    world, trajectory = episodes("softbody3d")
    going_on = some(trajectory, np.arange(404) % (STEPS - 1))
    scene = world.scene(going_on)
    assert len(scene.position) == 1 + 404 // 3
    np.testing.assert_array_equal(scene.position[1], going_on.next_state.position[2].T)
    assert scene.captions[-1].startswith(f"{402 * world.material.time_step:.3f} s")


# Shown in a notebook


class Frames(HTMLParser):
    """The attributes of every element of a text."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))


def test_a_notebook_gets_a_frame_with_a_page_that_holds_the_scene(shown):
    *_, scene = shown
    ((tag, frame),) = Frames(scene._repr_html_()).found
    assert tag == "iframe"
    assert frame["sandbox"] == "allow-scripts"
    assert frame["title"] == f"Replay: {scene.title}"
    page = frame["srcdoc"]
    assert page.startswith("<!doctype html>")
    (stored,) = json.loads(re.search(r'id="replay-scenes">(.*?)</script>', page)[1])
    assert stored["title"] == scene.title
    assert stored["captions"] == list(scene.captions)
    assert stored["frames"] == len(scene.position)


def test_watching_shows_the_episode_that_a_rollout_plays(episodes):
    world, _ = episodes("sharing")
    policy, key = at_random(world), jax.random.key(7)
    _, trajectory = jax.jit(lambda: rollout(world, policy, key, STEPS))()
    scene = watch(world, policy, key)
    assert scene.to_dataset().identical(world.scene(trajectory).to_dataset())
    assert repr(scene) == "Scene('Sharing: one episode', 6 frames, 5 shapes)"  # not all its numbers


def test_an_episode_that_would_not_fit_in_memory_is_refused(monkeypatch):
    monkeypatch.setattr("ethogram.core.memory.available_memory", lambda: 1000)
    world = Sharing(agents=100, encoding="vector")
    with pytest.raises(TooLarge, match="An episode of 100 steps needs"):
        watch(world, at_random(world), jax.random.key(0))
