import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.worlds.softbody import SoftBody3D
from ethogram.worlds.softbody.controllers import (
    Controller,
    NonSensing,
    Sensing,
    policy,
    weighted_sum,
)
from ethogram.worlds.softbody.sensors import Sensors, flatten, unflatten

ANGLE = 0.7  # 2 pi f k dt
CLOCK = jnp.array([np.sin(ANGLE), np.cos(ANGLE)])


def sensors(voxels: int) -> Sensors:
    count = jnp.arange(voxels, dtype=jnp.float32)
    return Sensors(1 + 0.01 * count, 0.1 * count, 1 + count, CLOCK)


@pytest.mark.parametrize(("voxels", "genes"), [(4, 51), (6, 100), (8, 165)])
def test_a_sensing_controller_has_as_many_parameters_as_the_sheet_says(
    voxels: int, genes: int
) -> None:
    assert Sensing(voxels).search_space.size == genes
    assert NonSensing(voxels).search_space.size == 2 * voxels


@pytest.mark.parametrize(
    ("actuation", "size", "expected"),
    [
        ("plain", 0.5, 1.05 + 0.1 * np.sin(ANGLE + 0.3)),
        ("plain", -0.5, 0.95 + 0.1 * np.sin(ANGLE + 0.3)),
        ("shrink_limited", 0.5, 1.05 + 0.1 * np.sin(ANGLE + 0.3)),
        ("shrink_limited", -0.5, 0.95 + 0.05 * np.sin(ANGLE + 0.3)),
        ("shrink_limited", -1.0, 0.9),
    ],
)
def test_a_non_sensing_voxel_swings_about_its_size(
    actuation: str, size: float, expected: float
) -> None:
    controller = NonSensing(2, actuation)
    scale = controller.drive(jnp.array([0.0, 0.0, size, 0.3]))(sensors(2))
    np.testing.assert_allclose(scale, [1 + 0.1 * np.sin(ANGLE), expected], rtol=1e-6)


def network(weights: np.ndarray, seen: Sensors) -> np.ndarray:
    """Outputs of the network, weight by weight, in the order that the docstring gives."""
    voxels = len(seen.scale)
    inputs = [
        float(value)
        for triple in zip(seen.scale, seen.speed, seen.acceleration, strict=True)
        for value in triple
    ] + [float(seen.clock[0])]
    units, rest = round(0.65 * voxels), iter(weights.tolist())
    hidden = [0.0] * units
    for value in inputs:
        for unit in range(units):
            hidden[unit] += next(rest) * value
    outputs = np.zeros(voxels)
    for value in hidden:
        for voxel in range(voxels):
            outputs[voxel] += next(rest) * max(value, 0.0)
    assert next(rest, None) is None
    return outputs


def test_the_network_is_the_one_described_under_both_output_laws() -> None:
    weights = 5 * np.random.default_rng(1).normal(size=51)
    outputs = network(weights, sensors(4))
    assert np.abs(outputs).max() > 10, "the limits are reached"
    bounded = Sensing(4, "tanh").drive(jnp.asarray(weights))(sensors(4))
    np.testing.assert_allclose(bounded, 1 + 0.1 * np.tanh(outputs), rtol=1e-5)
    free = Sensing(4, "unbounded").drive(jnp.asarray(weights))(sensors(4))
    np.testing.assert_allclose(free, np.clip(1 + 0.1 * outputs, 0.25, 1.1), rtol=1e-4)


@pytest.mark.parametrize("controller", [NonSensing(4), Sensing(4)])
def test_robots_side_by_side_are_each_driven_by_their_own_parameters(
    controller: Controller,
) -> None:
    genes = np.random.default_rng(2).normal(size=(controller.search_space.size, 3))
    one = sensors(4)
    three = Sensors(
        *(jnp.stack([part] * 3, -1) for part in (one.scale, one.speed, one.acceleration)),
        one.clock,
    )
    together = controller.drive(jnp.asarray(genes))(three)
    for robot in range(3):
        alone = controller.drive(jnp.asarray(genes[:, robot]))(one)
        np.testing.assert_allclose(together[:, robot], alone, rtol=1e-5)


def test_random_sizes_and_phases_lie_where_the_sheet_says_and_only_sizes_are_limited() -> None:
    space = NonSensing(2).search_space
    pi = np.float32(np.pi)
    np.testing.assert_array_equal(space.low, [-1, -pi, -1, -pi])
    np.testing.assert_array_equal(space.high, [1, pi, 1, pi])
    np.testing.assert_array_equal(space.upper, [1, np.inf, 1, np.inf])
    np.testing.assert_array_equal(space.lower, -space.upper)
    assert np.isinf(Sensing(4).search_space.upper).all()


def test_a_policy_turns_observations_into_edges_in_metres() -> None:
    controller = NonSensing(4)
    parameters = jnp.linspace(-1, 1, 8)
    observation = {"robot": flatten(sensors(4))[None]}
    action = policy(controller, parameters, 0.01)(jax.random.key(0), observation)
    expected = 0.01 * controller.drive(parameters)(sensors(4))
    np.testing.assert_allclose(action["robot"], expected[None], rtol=1e-6)


def test_observations_hold_the_sensors_voxel_by_voxel_then_the_clock() -> None:
    seen = flatten(sensors(2))
    expected = [1.0, 0.0, 1.0, 1.01, 0.1, 2.0, np.sin(ANGLE), np.cos(ANGLE)]
    np.testing.assert_allclose(seen, expected, rtol=1e-6)
    again = unflatten(seen)
    np.testing.assert_array_equal(again.acceleration, sensors(2).acceleration)
    np.testing.assert_array_equal(again.clock, CLOCK)


def test_sensors_read_strain_speed_acceleration_and_the_clock() -> None:
    world = SoftBody3D(body="##", acceleration_scale=0.01)
    state = world.at_rest()
    state = type(state)(
        **vars(state)
        | {
            "strain": jnp.array([0.1]),
            "momentum": jnp.array([[3.0, 0.0], [4.0, 0.0], [0.0, 0.0]]),
            "force": jnp.array([[0.0, 200.0], [0.0, 0.0], [0.0, 0.0]]),
            "edge": jnp.array([0.011, 0.009]),
            "steps": jnp.int32(3),
        }
    )
    found = world.sense(state)
    np.testing.assert_allclose(found.scale, [1.1, 1.1], rtol=1e-6)
    np.testing.assert_allclose(found.speed, [5.0, 0.0], rtol=1e-6)
    np.testing.assert_allclose(found.acceleration, [0.0, 2.0], rtol=1e-6)
    angle = 2 * np.pi * 40 * 3 * 1.423525111117e-4
    np.testing.assert_allclose(found.clock, [np.sin(angle), np.cos(angle)], rtol=1e-5)
    commanded = SoftBody3D(body="##", sensed_scale="commanded", acceleration_scale=1.0).sense(state)
    np.testing.assert_allclose(commanded.scale, [1.1, 0.9], rtol=1e-6)
    np.testing.assert_allclose(commanded.acceleration, [0.0, 200.0], rtol=1e-6)


@pytest.mark.parametrize(
    ("axes", "product"),
    [
        ((0, 0), "rsio,rsi->rso"),
        ((0, None), "rsio,si->rso"),
        ((None, 0), "sio,rsi->rso"),
    ],
)
def test_sums_of_batches_within_batches_are_those_of_each(
    axes: tuple[int | None, int | None], product: str
) -> None:
    runs, robots, inputs, outputs = 2, 3, 5, 4
    draw = np.random.default_rng(0).normal
    weights = draw(size=(runs, robots, inputs, outputs)[axes[0] is None :]).astype(np.float32)
    values = draw(size=(runs, robots, inputs)[axes[1] is None :]).astype(np.float32)

    def total(weights: jax.Array, values: jax.Array) -> jax.Array:
        return jax.vmap(jax.vmap(weighted_sum), axes)(weights, values)

    found = jax.jit(total)(weights, values)
    np.testing.assert_allclose(found, np.einsum(product, weights, values), rtol=1e-5, atol=1e-5)
    slope = jax.grad(lambda weights: total(weights, values).sum())(weights)
    plain = jax.grad(lambda weights: jnp.einsum(product, weights, values).sum())(weights)
    np.testing.assert_allclose(slope, plain, rtol=1e-5, atol=1e-5)
