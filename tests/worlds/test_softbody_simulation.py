import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.core.errors import InvalidSettings
from ethogram.core.rollout import rollout
from ethogram.physics.beams3d import centre
from ethogram.worlds.softbody import SoftBody3D
from ethogram.worlds.softbody.controllers import NonSensing, Sensing, policy
from ethogram.worlds.softbody.gravity import schedule
from ethogram.worlds.softbody.simulation import SimulationResult, simulate
from ethogram.worlds.softbody.starts import Start, StartDistribution

STEPS, ROBOTS = 40, 5


@pytest.fixture(scope="module")
def world():
    return SoftBody3D(body="####", steps=STEPS)


@pytest.fixture(scope="module")
def genes():
    return jnp.asarray(np.random.default_rng(0).uniform(-1, 1, (51, ROBOTS)), jnp.float32)


@pytest.fixture(scope="module")
def even():
    return schedule("even", STEPS)


class Centre(eqx.Module):
    """Records where robots are: a module, so that simulations alike share a program."""

    world: SoftBody3D

    def __call__(self, state):
        return centre(self.world.body, state)


def simulated(world, genes, gravity, every=None, block_size=16, start=None) -> SimulationResult:
    record = Centre(world) if every else None
    return eqx.filter_jit(simulate)(
        world,
        Sensing(4),
        genes,
        gravity,
        start=start,
        record=record,
        record_every=every,
        block_size=block_size,
    )


def test_the_fast_way_is_the_worlds_own_way():
    """A rollout of the world, its rewards summed, gives each robot's distance.

    In 64 bits: in 32, rounding decides which voxels stick, and robots that sense go another way.
    """
    with jax.enable_x64(True):
        world = SoftBody3D(body="####", steps=STEPS)
        genes = jnp.asarray(np.random.default_rng(0).uniform(-1, 1, (51, ROBOTS)))
        found = simulated(world, genes, schedule("even", STEPS))

        @jax.jit
        def played(parameters):
            drive = policy(Sensing(4), parameters, world.material.edge)
            _, steps = rollout(world, drive, jax.random.key(0), STEPS)
            return steps.outcome.reward["robot"].sum()

        alone = [played(genes[:, robot]) for robot in range(ROBOTS)]
        assert np.abs(alone).max() > 1e-5
        np.testing.assert_allclose(found.distance, alone, rtol=1e-6)


def test_where_a_robot_goes_does_not_depend_on_others_or_on_being_recorded(world, genes, even):
    """To the last bit: what is simulated again goes the same way."""
    together = simulated(world, genes, even, block_size=None)
    for order, every in ((np.arange(ROBOTS)[::-1], None), (np.tile([2, 0], 80), 10)):
        found = simulated(world, genes[:, order], even, every, block_size=None)
        np.testing.assert_array_equal(found.distance, together.distance[order])
    assert found.recorded.shape == (4, 3, 160)
    np.testing.assert_array_equal(found.recorded[..., ::2], found.recorded[..., :1].repeat(80, -1))


@pytest.mark.slow
def test_sets_of_robots_under_vmap_are_one_row_of_robots_to_the_last_bit(world, genes, even):
    sets = jnp.stack([genes[:, :2], genes[:, 2:4]])
    pulls = jnp.stack([even, schedule("flat", STEPS)])

    @eqx.filter_jit
    def simulated_sets(world, sets, pulls, axis):
        def one(genes, pull):
            return simulate(world, Sensing(4), genes, pull, record=Centre(world), block_size=16)

        return jax.vmap(one, (0, axis))(sets, pulls)

    found = simulated_sets(world, sets, even, None)
    alone = simulated(world, genes[:, :4], even, every=STEPS)
    np.testing.assert_array_equal(found.distance.ravel(), alone.distance)
    assert found.recorded.shape == (2, 1, 3, 2)
    apart = simulated_sets(world, sets, pulls, 0)
    np.testing.assert_array_equal(apart.distance[0], alone.distance[:2])
    other = simulated(world, genes[:, 2:4], pulls[1])
    np.testing.assert_array_equal(apart.distance[1], other.distance)


def test_robots_simulated_one_by_one_go_nearly_as_far(world, genes, even):
    alone = simulated(world, genes, even, block_size=1)
    together = simulated(world, genes, even)
    np.testing.assert_allclose(alone.distance, together.distance, rtol=1e-3, atol=1e-4)


def test_each_robot_may_have_a_gravity_of_its_own(world, genes):
    programs = ["flat", "step", "sin", "evolution", "even"]
    schedules = [schedule(name, STEPS) for name in programs]
    apart = [simulated(world, genes[:, :1], gravity).distance[0] for gravity in schedules]
    same = jnp.tile(genes[:, :1], (1, ROBOTS))
    together = simulated(world, same, jnp.stack(schedules, -1)).distance
    np.testing.assert_array_equal(together, apart)
    assert len({round(float(distance), 9) for distance in apart}) == ROBOTS


def test_a_robot_that_diverges_has_no_distance_and_the_others_keep_theirs(world, even):
    genes = jnp.zeros((8, 3))
    sound = eqx.filter_jit(simulate)(world, NonSensing(4), genes, even)
    genes = genes.at[0, 1].set(jnp.nan)
    found = eqx.filter_jit(simulate)(world, NonSensing(4), genes, even)
    np.testing.assert_array_equal(found.diverged, [False, True, False])
    np.testing.assert_array_equal(jnp.isnan(found.distance), found.diverged)
    np.testing.assert_array_equal(found.distance[::2], sound.distance[::2])


@pytest.mark.parametrize("kind", [Sensing, pytest.param(NonSensing, marks=pytest.mark.slow)])
def test_distances_have_the_gradient_in_the_parameters_that_differences_show(kind):
    with jax.enable_x64(True):
        world, controller = SoftBody3D(body="####"), kind(4)
        gravity = schedule("even", 30)
        genes = jnp.asarray(
            np.random.default_rng(0).uniform(-1, 1, (controller.search_space.size, 1))
        )

        @jax.jit
        def gone(genes):
            return simulate(world, controller, genes, gravity, block_size=1).distance[0]

        slope = np.asarray(jax.jit(jax.grad(gone))(genes))
        nudges = 1e-6 * jnp.eye(len(genes))[..., None]
        differences = [(gone(genes + nudge) - gone(genes - nudge)) / 2e-6 for nudge in nudges]
    assert np.isfinite(slope).all()
    assert np.abs(slope).max() > 1e-7
    np.testing.assert_allclose(slope[:, 0], differences, rtol=1e-3, atol=1e-9)


def test_samples_must_divide_the_steps(world, genes, even):
    with pytest.raises(InvalidSettings, match="record_every = 7: it should divide the 40 steps"):
        simulate(world, Sensing(4), genes, even, record_every=7)


def test_a_block_has_robots(world, genes, even):
    with pytest.raises(InvalidSettings, match="block_size = 0: it should be at least 1"):
        simulate(world, Sensing(4), genes, even, block_size=0)


def test_a_start_at_rest_is_no_other_start(world, genes, even):
    still = StartDistribution(phase=0.0, height=0.0, speed=0.0).sample(jax.random.key(0), ROBOTS)
    found = simulated(world, genes, even, start=still)
    np.testing.assert_array_equal(found.distance, simulated(world, genes, even).distance)


def test_each_robot_has_its_own_start_whoever_is_beside_it(world, genes, even):
    start = StartDistribution().sample(jax.random.key(0), ROBOTS)
    found = simulated(world, genes, even, start=start).distance
    assert (found != simulated(world, genes, even).distance).all()
    turned = jax.tree.map(lambda part: part[..., ::-1], (genes, start))
    again = simulated(world, turned[0], even, start=turned[1]).distance
    np.testing.assert_array_equal(again[::-1], found)


@pytest.mark.slow
def test_sets_of_robots_under_vmap_have_the_same_starts_or_their_own(world, genes, even):
    start = StartDistribution().sample(jax.random.key(0), ROBOTS)
    found = simulated(world, genes, even, start=start).distance
    two = jax.tree.map(lambda part: jnp.stack([part, part]), start)

    @eqx.filter_jit
    def simulated_sets(world, sets, start, axis):
        def one(genes, start):
            return simulate(world, Sensing(4), genes, even, start=start, block_size=16).distance

        return jax.vmap(one, (0, axis))(sets, start)

    for starts, axis in ((start, None), (two, 0)):
        together = simulated_sets(world, jnp.stack([genes, genes]), starts, axis)
        np.testing.assert_array_equal(together, jnp.stack([found, found]))


def test_a_start_is_as_high_as_fast_and_as_late_as_it_says(world):
    start = Start(jnp.array([0.5]), jnp.array([0.002]), jnp.array([[0.03], [-0.04]]))
    state = world.started(start)
    np.testing.assert_allclose(state.position[2], 0.007, rtol=1e-6)
    mass = float(world.material.mass)
    np.testing.assert_allclose(world.sense(state, start).speed, 0.05, rtol=1e-6)
    np.testing.assert_allclose(state.momentum[:2, 0, 0], [0.03 * mass, -0.04 * mass], rtol=1e-6)
    clock = world.sense(state, start).clock[:, 0]
    np.testing.assert_allclose(clock, [np.sin(0.5), np.cos(0.5)], rtol=1e-6)


def test_starts_are_drawn_within_their_sizes_and_the_first_ones_stay():
    distribution = StartDistribution(phase=0.2, height=0.003, speed=0.04, sideways=0.05)
    start = distribution.sample(jax.random.key(1), 200)
    for part, low, high in (
        (start.phase, -0.2, 0.2),
        (start.height, 0.0, 0.003),
        (start.velocity[0], -0.04, 0.04),
        (start.velocity[1], -0.05, 0.05),
    ):
        assert low <= part.min() < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < part.max() <= high
    fewer = distribution.sample(jax.random.key(1), 3)
    np.testing.assert_array_equal(fewer.velocity, start.velocity[:, :3])
    np.testing.assert_array_equal(fewer.phase, start.phase[:3])
