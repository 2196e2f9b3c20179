"""The world of soft robots in the plane: placing, tasks, sensors, energy, and its scene."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.core.errors import InvalidSettings
from ethogram.core.rollout import rollout
from ethogram.physics.lattice2d.contacts import height
from ethogram.worlds.softbody import SoftBody2D
from ethogram.worlds.softbody.sensors import CLOCK
from ethogram.worlds.softbody.sensors2d import PER_VOXEL, voxels
from ethogram.worlds.softbody.tasks import TASKS, Task, task_of
from ethogram.worlds.softbody.world2d import ROLE, energy_fitness

KEY = jax.random.key(0)
ELL = "#./##"
LEVEL = ((0.0, 0.0), (100.0, 0.0))


def world_of(body=ELL, **settings):
    return SoftBody2D(body=body, **settings)


class Episode:
    """A robot, stepped."""

    def __init__(self, world):
        self.world, self.state = world, world.reset(KEY)[0]
        self.advance = jax.jit(world.step)
        self.rewards, self.outcome = [], None

    def run(self, steps, control=0.0):
        count = self.world.body.voxels
        for _ in range(steps):
            asked = {ROLE: jnp.broadcast_to(jnp.asarray(control, float), (1, count))}
            self.state, self.outcome = self.advance(KEY, self.state, asked)
            self.rewards.append(float(self.outcome.reward[ROLE][0]))
        return self

    @property
    def voxels(self):
        return voxels(self.world.body, self.world.material, self.state.body)

    @property
    def centre(self):
        return np.asarray(self.world.centre(self.voxels))

    @property
    def readings(self):
        observed = np.asarray(self.world.observe(self.state)[ROLE][0])
        return observed[:-CLOCK].reshape(-1, PER_VOXEL)


@pytest.fixture(scope="module")
def landed():
    return Episode(world_of()).run(120)


@pytest.mark.parametrize("task", TASKS)
def test_a_robot_starts_with_its_left_edge_at_the_start_and_a_metre_above_the_ground(task):
    world = world_of(task=task)
    state, _ = world.reset(KEY)
    found = voxels(world.body, world.material, state.body)
    corners = np.asarray(found.centre) - 1.5
    assert corners[0].min() == pytest.approx(TASKS[task].start, abs=1e-5)
    ground = np.asarray(height(world.terrain, found.centre[0] - 1.5))
    assert (corners[1] - ground).min() == pytest.approx(1.0, abs=1e-4)


def test_a_robot_on_a_slope_is_lifted_above_its_highest_ground():
    rising = Task(((0.0, 0.0), (10.0, 0.0), (20.0, 10.0)), start=9.0, seconds=1.0)
    world = world_of("##", task=rising)
    found = voxels(world.body, world.material, world.reset(KEY)[0].body)
    # the right voxel ends at x = 15, where the ground is 5 m high
    assert np.asarray(found.centre)[1].min() - 1.5 == pytest.approx(6.0, abs=1e-4)


def test_returns_are_the_way_of_the_centre():
    episode = Episode(world_of())
    before = episode.centre
    episode.run(40, np.sin(np.arange(3)))
    assert sum(episode.rewards) == pytest.approx(episode.centre[0] - before[0], abs=1e-4)


def test_nothing_is_commanded_in_the_first_step_and_while_a_robot_settles():
    still, asked = (Episode(world_of()).run(1, control) for control in (0.0, 1.0))
    np.testing.assert_array_equal(still.state.body.moved, asked.state.body.moved)
    asked.run(1, 1.0)
    still.run(1)
    assert not np.array_equal(still.state.body.moved, asked.state.body.moved)
    settling = Task(LEVEL, start=11.0, seconds=1.0, settling=0.1)
    one, other = (Episode(world_of(task=settling)).run(6, control) for control in (0.0, 1.0))
    np.testing.assert_array_equal(one.state.body.moved, other.state.body.moved)


def test_a_jump_is_worth_its_highest_rise():
    jump = Task(LEVEL, start=11.0, seconds=3.0, settling=1.0, rises=True)
    episode = Episode(world_of(task=jump)).run(61)
    standing, heights = episode.centre[1], []
    for control in (1.0, -1.0, 0.0):
        for _ in range(12):
            episode.run(1, control)
            heights.append(episode.centre[1])
    assert sum(episode.rewards) == pytest.approx(max(heights) - standing, abs=1e-4)
    assert sum(episode.rewards) > 0.01
    assert min(episode.rewards) == 0


def test_voxels_on_the_ground_feel_it_and_those_above_do_not(landed):
    assert landed.readings[:, 0].tolist() == [1.0, 1.0, 0.0]  # the bottom row first


def test_at_rest_velocities_and_areas_are_sensed_as_half(landed):
    np.testing.assert_allclose(landed.readings[:, 1:3], 0.5, atol=0.01)
    np.testing.assert_allclose(landed.readings[:, 3], 0.5, atol=0.05)


def test_a_velocity_is_sensed_along_the_voxels_own_axes():
    world = world_of("##", task=Task(LEVEL, start=11.0, seconds=1.0))
    state, _ = world.reset(KEY)
    turned = state.body.heading[::-1]  # cosine 0, sine 1
    # every rigid body about the origin by a right angle: where it was to the right, it is above
    rest = world.body.vertex * world.material.edge + world.body.centre * world.material.square
    moved = jnp.stack([-rest[1] - rest[0], rest[0] - rest[1]])
    upwards = state.body.velocity.at[1].set(2.0)
    body = eqx.tree_at(
        lambda each: (each.moved, each.heading, each.velocity),
        state.body,
        (moved, turned, upwards),
    )
    found = voxels(world.body, world.material, body)
    np.testing.assert_allclose(found.velocity[0], 2.0, atol=1e-4)  # up is along its x axis
    np.testing.assert_allclose(found.velocity[1], 0.0, atol=1e-4)
    np.testing.assert_allclose(found.area, 1.0, atol=1e-4)


def test_energy_counts_what_pushes_beyond_the_resting_area():
    world = world_of("###")
    found = voxels(world.body, world.material, world.reset(KEY)[0].body)
    found = found._replace(area=jnp.array([0.9, 0.9, 1.1]))
    energy = world.energy(found, jnp.array([0.5, -1.0, -0.2]))
    assert float(energy) == pytest.approx((0.25 + 0.04) / 3)
    assert energy_fitness(2.0, 0.5) == pytest.approx(2 / 201)


def test_the_cave_is_as_wide_and_high_as_the_size_of_a_body_says():
    world = world_of("####/####", task="escape")  # X = 3 * 3 + 1.5, Y = 3 + 1.5
    x, y = 10.5, 4.5
    across, up = np.array([0, 1.1, 1.4, 2.5, 10]), np.array([1.4, 1.4, 1.0, 0.7, 0.6])
    expected = np.stack([x * across, y * up], 1)
    np.testing.assert_allclose(world.terrain.ceiling, expected, rtol=1e-6)


def test_a_robot_does_not_rise_through_a_ceiling():
    lid = jnp.array([(0.0, 5.2), (99.0, 5.2)])
    low = Task(LEVEL, start=11.0, seconds=1.0, ceiling=lambda *_: lid)
    world = world_of("#", task=low, gravity=0.0)
    episode = Episode(world)
    body = eqx.tree_at(
        lambda each: each.velocity,
        episode.state.body,
        episode.state.body.velocity.at[1].set(3.0),
    )
    episode.state = eqx.tree_at(lambda state: state.body, episode.state, body)
    episode.run(60)
    assert episode.centre[1] + 1.5 < 5.3


def test_an_episode_is_as_long_as_its_task_or_as_the_steps_say():
    assert world_of(task="jump").horizon == 30 * 60
    assert world_of(steps=7).horizon == 7
    episode = Episode(world_of(steps=3)).run(3)
    assert bool(episode.outcome.truncated[ROLE][0])


def test_tasks_that_there_are_not_are_refused():
    with pytest.raises(InvalidSettings, match="task = 'fly'; allowed: a Task, or one of loc"):
        task_of("fly")


def test_a_scene_shows_every_voxel_on_its_ground():
    world = world_of(steps=5)

    def act(key, observation):
        del key, observation
        return {ROLE: jnp.zeros((1, 3))}

    _, trajectory = jax.jit(lambda key: rollout(world, act, key, 5))(KEY)
    scene = world.scene(trajectory)
    assert scene.position.shape == (6, 3, 2)
    assert len(scene.background) == 1
    x, y = np.moveaxis(scene.vertices[0], -1, 0)
    (x1, x2), (y1, y2) = ((each[:, 2] - each[:, 0], each[:, 3] - each[:, 1]) for each in (x, y))
    np.testing.assert_allclose(np.abs(x1 * y2 - x2 * y1) / 2, 9.0, rtol=1e-3)  # no crossing sides


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"seconds": 0.0}, "Task: seconds = 0.0; allowed: above 0"),
        ({"start": float("nan")}, "Task: start = nan"),
        ({"settling": -1.0}, "Task: settling = -1.0"),
        ({"ground": ((0.0, 0.0),)}, "Terrain: ground"),
    ],
)
def test_tasks_without_time_place_or_ground_are_refused(settings, says):
    with pytest.raises(InvalidSettings, match=says):
        Task(**{"ground": LEVEL, "start": 1.0, "seconds": 1.0} | settings)


def test_bodies_of_the_thesis_have_names():
    assert len(world_of("biped").cells) == 20
    assert len(world_of("revT").cells) == 20
