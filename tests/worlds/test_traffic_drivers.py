from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.worlds.test_traffic import FASTER, KEEP, KEY, LEFT, RING, STRAIGHT, placed

from ethogram.core.errors import InvalidSettings
from ethogram.core.rollout import rollout
from ethogram.core.wrappers import GivenPolicies
from ethogram.worlds.traffic import Traffic
from ethogram.worlds.traffic.drivers import (
    IDM,
    MOBIL,
    ConstantSpeed,
    Follower,
    Krauss,
    Obedient,
    Reckless,
)
from ethogram.worlds.traffic.driving import Body, Car

WORLD = Traffic(graph=RING, cars=3, max_cars=3)
NOBODY = (jnp.inf, 0.0)


@eqx.filter_jit
def observe(world, state):
    return world.observe(state)


def follow(driver, speed, gap, other):
    return driver.follow(jnp.asarray(speed), Car(jnp.asarray(gap), jnp.asarray(other)))


def test_idm_at_the_equilibrium_gap_neither_brakes_nor_accelerates():
    idm = IDM(WORLD, desired_speed=20.0)
    # s_e = (s0 + v T) / sqrt(1 - (v / v0)^4): at 10 m/s (2 + 16) / sqrt(15 / 16)
    gap = 18 / np.sqrt(15 / 16)
    np.testing.assert_allclose(follow(idm, 10.0, gap, 10.0), 0.0, atol=1e-6)
    assert follow(idm, 10.0, gap + 1, 10.0) > 0 > follow(idm, 10.0, gap - 1, 10.0)


def test_idm_by_hand():
    idm = IDM(WORLD, desired_speed=20.0)
    np.testing.assert_allclose(follow(idm, 0.0, *NOBODY), 0.73, rtol=1e-6)
    np.testing.assert_allclose(follow(idm, 20.0, *NOBODY), 0.0, atol=1e-6)
    # s* = 2 + 16 + 10 x 10 / (2 sqrt(0.73 x 1.67)) = 63.285; 0.73 (1 - 1/16 - (63.285 / 30)^2)
    np.testing.assert_allclose(follow(idm, 10.0, 30.0, 0.0), -2.5642, rtol=1e-3)
    # away from a much faster car the wanted gap is no less than s0
    np.testing.assert_allclose(follow(idm, 10.0, 4.0, 40.0), 0.73 * (1 - 1 / 16 - 1 / 4), rtol=1e-6)


@pytest.mark.parametrize(("headway", "grows"), [(0.3, True), (1.6, False)])
def test_a_disturbance_grows_along_a_platoon_of_idm_drivers_whose_headway_is_short(headway, grows):
    # unstable where f_v^2 / 2 - f_v f_l - f_s is negative (Wilson, 2008), here by numbers
    idm = IDM(WORLD, desired_speed=30.0, time_headway=headway, comfortable_acceleration=0.5)
    speed, step, cars = 10.0, 0.05, 15
    gap = (2 + speed * headway) / np.sqrt(1 - (1 / 3) ** 4)

    def advance(carry, time):
        x, v = carry
        a = idm.follow(v[1:], Car(x[:-1] - x[1:], v[:-1]))
        leader = jnp.where(
            (time > 10) & (time < 12), -0.1, jnp.where((time > 12) & (time < 14), 0.1, 0)
        )
        v = v + step * jnp.concatenate([leader[None], a])
        return (x + step * v, v), v

    start = -gap * jnp.arange(cars), jnp.full(cars, speed)
    speeds = jax.lax.scan(advance, start, step * jnp.arange(4000.0))[1]
    swing = np.asarray(speeds.max(0) - speeds.min(0))
    assert (swing[-1] > swing[1]) == grows


def test_krauss_drives_at_the_safe_speed():
    krauss = Krauss(WORLD, imperfection=0.0)
    # 10 + (20 - 2.5 - 10) / ((10 + 10) / 9 + 1) = 10 + 7.5 / 3.2222
    np.testing.assert_allclose(
        krauss.safe_speed(jnp.asarray(10.0), Car(jnp.asarray(20.0), jnp.asarray(10.0))),
        12.3276,
        rtol=1e-4,
    )
    # behind a car at rest, 22.5 m on: 20 / (9 / 9 + 1)
    np.testing.assert_allclose(
        krauss.safe_speed(jnp.asarray(9.0), Car(jnp.asarray(22.5), jnp.asarray(0.0))),
        10.0,
        rtol=1e-6,
    )
    np.testing.assert_allclose(follow(krauss, 9.0, 22.5, 0.0), 2.6, rtol=1e-4)
    np.testing.assert_allclose(follow(krauss, 12.9, *NOBODY), 0.5, rtol=1e-3)  # up to 13 m/s
    np.testing.assert_allclose(follow(krauss, 9.0, 2.5, 0.0), -45.0, rtol=1e-5)
    lost = Krauss(WORLD).noise(KEY, jnp.zeros(2000))
    assert (lost >= -1.3).all()
    assert (lost <= 0).all()
    np.testing.assert_allclose(lost.mean(), -0.65, atol=0.03)  # sigma a / 2


class Wished(Follower):
    """An acceleration that depends on the gap alone."""

    body: Body
    choice: str = eqx.field(static=True, default="nearest")

    def follow(self, speed, ahead):
        del speed
        return jnp.where(jnp.isfinite(ahead.gap), jnp.clip(ahead.gap / 10 - 3, -9, 1), 1.0)


def view_of(world, cars):
    """What the human, the first car, sees among others."""
    state = placed(world, cars)
    seen = observe(world, state)["human"]
    return Wished(IDM(world).body).body.view(seen)


def test_mobil_changes_lanes_above_the_threshold_only():
    world = Traffic(graph=RING, cars=0, max_cars=1, humans=4)

    def choice(cars, **settings):
        everyone = [
            (1, 95.0, 1, 0.0),
            *cars,
            *[(1, 5.0 + 20 * n, 1, 0.0) for n in range(4 - len(cars))],
        ]
        view = view_of(world, everyone)
        mobil = MOBIL(Wished(IDM(world).body), **settings)
        return int(mobil.lane_change(view)[0])

    me = (0, 40.0, 1, 10.0)
    # own lane: 22 m bumper to bumper, a = -0.8; on the left 25 m, a = -0.5: a gain of 0.3
    both = [me, (0, 69.0, 1, 10.0), (0, 72.0, 2, 10.0)]
    assert choice(both) == 1
    assert choice(both, threshold=0.31) == 0
    # a new follower, 12 m behind, would have to brake with 1.8 instead of accelerating with 1
    behind = [*both, (0, 21.0, 2, 10.0)]
    assert choice(behind, politeness=0.0) == 1
    assert choice(behind, politeness=0.5) == 0
    assert choice(behind, politeness=0.0, safe_braking=1.7) == 0


def test_mobil_needs_to_see_behind():
    with pytest.raises(InvalidSettings, match="the role 'human'"):
        MOBIL(IDM(WORLD))(KEY, jnp.zeros(WORLD.roles["driver"].observation.shape)[None])


def test_an_acceleration_becomes_choices_of_that_mean():
    world = Traffic(cars=80, max_cars=80)
    body = IDM(world).body
    for wish, mean in ((0.5, 0.25), (-1.5, -0.75), (7.0, 1.0), (-jnp.inf, -1.0), (0.0, 0.0)):
        acts = [body.act(jax.random.key(n), jnp.full(80, wish), 0, "random") for n in range(30)]
        assert abs(np.mean([act[:, 0] - 1 for act in acts]) - mean) < 0.04
    nearest = body.act(KEY, jnp.array([0.9, 1.1, -0.9, -1.1]), 1, "nearest")
    np.testing.assert_array_equal(nearest, [[1, 2], [2, 2], [1, 2], [0, 2]])


@pytest.mark.parametrize("settings", [{}, {"scale": False}, {"speed_unit": "km/h"}])
def test_what_is_observed_can_be_read_in_metres_and_seconds(settings):
    world = Traffic(graph=RING, cars=3, max_cars=3, **settings)
    state = placed(world, [(0, 20.0, 1, 4.0), (0, 50.0, 2, 3.0), (0, 60.0, 1, 6.0)])
    view = IDM(world).body.view(observe(world, state)["driver"])
    np.testing.assert_allclose(view.stop, [80.0, 50.0, 40.0], rtol=1e-5)
    np.testing.assert_array_equal(view.lane, [1, 2, 1])
    np.testing.assert_allclose(view.ahead.gap[0], [np.inf, 33.0, 23.0], rtol=1e-5)
    np.testing.assert_allclose(view.ahead.speed[0, 1:], [6.0, 3.0], rtol=1e-5)


def test_a_driver_keeps_its_speed_and_a_reckless_one_overtakes():
    state = placed(WORLD, [(0, 20.0, 1, 10.0), (0, 50.0, 1, 3.0), (1, 60.0, 2, 10.1)])
    seen = observe(WORLD, state)["driver"]
    act = ConstantSpeed(WORLD)(KEY, seen)
    np.testing.assert_array_equal(act, [[KEEP, STRAIGHT], [FASTER, STRAIGHT], [KEEP, STRAIGHT]])
    act = Reckless(WORLD)(KEY, seen)
    np.testing.assert_array_equal(act[:, 0], [FASTER] * 3)
    assert act[0, 1] == LEFT


def played(world, policy, steps=300):
    run = partial(rollout, world, policy, KEY, steps)
    return eqx.filter_jit(lambda: run(keep=lambda t: (t.outcome.metrics, t.outcome.reward)))()[1]


def test_a_lone_obedient_driver_breaks_no_rule_and_gets_on():
    world = Traffic(cars=1, max_cars=1, joint_action=True)
    drive = Obedient(world)
    metrics, _ = played(world, lambda key, seen: {"driver": drive(key, seen["driver"])}, 500)
    assert metrics["breaches"][1:, :, :2].sum() == 0
    assert metrics["breaches"][:, :, 2].sum() <= 1  # who starts on the left
    assert metrics["distance"].sum() > 850  # at 10 m/s 1000 m


def test_the_obedient_are_safer_than_the_reckless():
    world = Traffic(cars=20, max_cars=20)
    found = {}
    for kind in (Obedient, Reckless):
        drive = kind(world)
        metrics, _ = played(
            world, lambda key, seen, drive=drive: {"driver": drive(key, seen["driver"])}
        )
        found[kind] = int(metrics["collision"].sum())
    assert found[Obedient] < found[Reckless] / 2


def test_given_drivers_play_humans_among_learners():
    world = Traffic(cars=3, max_cars=4, humans=3)
    assert {role: each.agents for role, each in world.roles.items()} == {"driver": 4, "human": 3}
    assert world.roles["human"].observation.shape == (17,)
    mixed = GivenPolicies(world, {"human": MOBIL(IDM(world))})
    metrics, reward = played(mixed, lambda key, seen: {"driver": jnp.ones((4, 2), jnp.int32)}, 40)
    assert set(reward) == {"driver"}
    assert metrics["distance"][:, :4].sum() == 0
    assert (metrics["distance"][:, 4:].sum(0) > 5).all()
