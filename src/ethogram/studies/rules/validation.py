"""Drivers after training: in more and less traffic, among other drivers, before a stopped car.

Nothing is learned here, and fines change nothing that a driver does.  Drivers act as in training,
by actions drawn from their policy; in traffic also by its most probable ones ("greedy").
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any, Literal, NamedTuple, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float, Int, Key

from ethogram.core.rollout import Policy, Position, rollout
from ethogram.core.world import PerRole, Transition, World
from ethogram.core.wrappers import RolePolicy
from ethogram.learners.episodes import episode_returns, episode_sums, play_episodes
from ethogram.learners.ppo import PPO, PPOState
from ethogram.studies.rules.plan import Settings, cars_of, learner_of, world_of
from ethogram.worlds.traffic import State, Traffic
from ethogram.worlds.traffic.drivers import IDM, MOBIL, Krauss, Obedient, Reckless
from ethogram.worlds.traffic.driving import as_body
from ethogram.worlds.traffic.rules import braking_distance

TRAFFIC = (10, 20, 30, 40, 50, 60, 70, 80)  # n_car of figure 4.6
Acting = Literal["drawn", "greedy"]  # how drivers choose actions
Group = Literal["driver", "human"]
ACTING: tuple[Acting, ...] = get_args(Acting)
HUMANS: dict[str, Callable[[Traffic], RolePolicy]] = {
    "MOBIL": lambda world: MOBIL(IDM(as_body(world))),
    "Krauss": lambda world: Krauss(as_body(world)),
    "obedient": lambda world: Obedient(as_body(world)),
    "reckless": lambda world: Reckless(as_body(world)),
}
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of human drivers
GROUPS: tuple[Group, ...] = get_args(Group)
ROADS = ("clear", "blocked")  # whether a car stands ahead
APPROACHES = 32  # per trial and road
SECONDS = 8.0  # of an approach
START, LEAST_GAP, SPEEDS = 2.0, 20.0, (10.0, 13.0)  # m along the section, m, m/s
FOR_EVER = 1_000_000  # steps for which the car ahead stands


class Fare(NamedTuple):
    """How cars fared in an episode: of those of a group, which are some of the cars."""

    efficiency: Array  # E, mean over cars (eq. 4.16), m/s summed over steps
    deviation: Array  # of E among cars
    collisions: Array  # C, mean over cars (eq. 4.17)
    breaches: Array  # steps in which a car broke each rule, mean over cars: [..., rule]


class Approach(NamedTuple):
    """What drivers did on the way to a place where a car stands, or none: shares of approaches."""

    left_lane: Array  # in which the driver left the right lane before that place
    collision: Array  # in which it collided
    right_lane_rule: Array  # in which it broke the right lane rule before that place
    distance_rule: Array  # share of the steps in which it broke the distance rule


def fare(sums: dict[str, Array], members: Bool[Array, "car"]) -> Fare:
    """Means over the cars of a group, where sums have the axes [..., car]."""
    count = jnp.maximum(members.sum(), 1)

    def mean(values: Array) -> Array:
        return jnp.where(members, values, 0.0).sum(-1) / count

    efficiency = mean(sums["speed"])
    square = mean((sums["speed"] - efficiency[..., None]) ** 2)
    broken = jnp.moveaxis(sums["breaches"], -1, 0).astype(float)
    return Fare(
        efficiency=efficiency,
        deviation=jnp.sqrt(square),
        collisions=mean(sums["collision"].astype(float)),
        breaches=jnp.moveaxis(mean(broken), 0, -1),
    )


def in_traffic(
    settings: Settings, state: PPOState, keys: Key[Array, "trial"], *, explore: bool
) -> tuple[Fare, Float[Array, "trial level"]]:
    """How drivers fare at each level of traffic, and what they earn.

    Returns:
        Float[trial, level], means over cars and episodes; and R (eq. 4.15) alike.

    """
    world = world_of(settings, cars=max(TRAFFIC))
    episodes = settings.validation_episodes
    return _in_traffic(world, learner_of(settings, world), state, keys, episodes, explore)


@eqx.filter_jit
def _in_traffic(
    world: Traffic,
    learner: PPO,
    state: PPOState,
    keys: Key[Array, "trial"],
    episodes: int,
    explore: bool,
) -> tuple[Fare, Float[Array, "trial level"]]:
    def at(state: PPOState, key: Key[Array, ""], cars: Int[Array, ""]) -> Any:
        policy = learner.policy(state, explore=explore)
        played = _play(dataclasses.replace(world, cars=cars), policy, key, episodes)
        members = jnp.arange(world.max_cars) < cars
        earned = episode_returns(played)["driver"]
        found = fare(episode_sums(played), members), jnp.where(members, earned, 0.0).sum(-1) / cars
        return jax.tree.map(lambda part: part.mean(0), found)

    def every_level(state: PPOState, key: Key[Array, ""]) -> Any:
        levels = jnp.array(TRAFFIC)
        return jax.vmap(partial(at, state))(jax.random.split(key, len(levels)), levels)

    found: tuple[Fare, Array] = _each_trial(every_level, state, keys)
    return found


def among_humans(settings: Settings, state: PPOState, keys: Key[Array, "trial"]) -> Fare:
    """How both groups fare where a share of the cars has human drivers of a kind.

    All cars have the role `human`, which sees what a driver sees and more: who drives which car is
    a number of the program, and not its form.

    Returns:
        Float[trial, human, share, group], means over cars and episodes; 0 of a group without cars.

    """
    world = world_of(settings, cars=0, humans=cars_of(settings))
    learner = learner_of(settings, world_of(settings))
    return _among_humans(world, learner, state, keys, settings.validation_episodes)


@eqx.filter_jit
def _among_humans(
    world: Traffic, learner: PPO, state: PPOState, keys: Key[Array, "trial"], episodes: int
) -> Fare:
    features = learner.world.roles["driver"].observation.shape[-1]
    models = [make(world) for make in HUMANS.values()]
    number = jnp.arange(world.humans)

    def at(state: PPOState, key: Key[Array, ""], kind: Array, share: Array) -> Fare:
        is_human = number >= world.humans - jnp.round(share * world.humans)
        policy = learner.policy(state, explore=True)

        def act(key: Key[Array, ""], observation: PerRole) -> PerRole:
            seen = observation["human"]
            keys = jax.random.split(key, len(models) + 1)
            learned = policy(keys[0], {"driver": seen[:, :features]})["driver"]
            modelled = jnp.stack(
                [model(each, seen) for model, each in zip(models, keys[1:], strict=True)]
            )[kind]
            chosen = jnp.where(is_human.reshape(-1, *(1,) * (learned.ndim - 1)), modelled, learned)
            nobody = jnp.ones((world.max_cars, *chosen.shape[1:]), chosen.dtype)
            return {"driver": nobody, "human": chosen}

        sums = episode_sums(_play(world, act, key, episodes))
        sums = {name: values[:, world.max_cars :] for name, values in sums.items()}
        both = [fare(sums, members) for members in (~is_human, is_human)]
        return jax.tree.map(lambda *parts: jnp.stack([part.mean(0) for part in parts]), *both)

    def every_mixture(state: PPOState, key: Key[Array, ""]) -> Fare:
        kind, share = jnp.meshgrid(jnp.arange(len(models)), jnp.array(SHARES), indexing="ij")
        each = jax.random.split(key, kind.size)
        found = jax.vmap(partial(at, state))(each, kind.reshape(-1), share.reshape(-1))
        return jax.tree.map(lambda part: part.reshape(kind.shape + part.shape[1:]), found)

    found: Fare = _each_trial(every_mixture, state, keys)
    return found


def before_a_stopped_car(
    settings: Settings, state: PPOState, keys: Key[Array, "trial"]
) -> Approach:
    """What drivers do who come upon a car that stands in the right lane, or upon none.

    A driver is alone on its section, in the right lane, at a speed from which it could stop within
    what it sees and not any more before that car: it breaks the distance rule whatever it does, and
    only in the left lane it gets past.  There it breaks the right lane rule where it sees nobody to
    the right: not beside the car, but with no car there.

    Returns:
        Float[trial, road], means over `APPROACHES`; the same ones on both roads.

    """
    steps = max(1, round(SECONDS / float(settings.world.time_step)))
    world = dataclasses.replace(world_of(settings, cars=2), steps=steps)
    return _before_a_stopped_car(world, learner_of(settings, world), state, keys)


@eqx.filter_jit
def _before_a_stopped_car(
    world: Traffic, learner: PPO, state: PPOState, keys: Key[Array, "trial"]
) -> Approach:
    def approach(state: PPOState, blocked: Array, key: Key[Array, ""]) -> Approach:
        for_start, for_drive = jax.random.split(key)
        start, place = upon_a_stopped_car(world, for_start, blocked)
        policy = learner.policy(state, explore=True)
        at = Position(start, world.observe(start))
        played: Transition = rollout(world, policy, for_drive, world.steps, at)[1]
        after, broken = played.next_state, played.outcome.metrics["breaches"][:, 0]
        before = (after.element[:, 0] == start.element[0]) & (after.position[:, 0] < place)
        before = jnp.cumprod(before & ~jnp.roll(played.episode_end, 1).at[0].set(False)) > 0
        collided = played.outcome.metrics["collision"][:, 0]
        first = jnp.cumsum(played.episode_end) - played.episode_end == 0
        return Approach(
            left_lane=(before & (after.lane[:, 0] > 1)).any(),
            collision=(collided & first).any(),
            right_lane_rule=(before & broken[:, 2]).any(),
            distance_rule=(before & broken[:, 1]).sum() / jnp.maximum(before.sum(), 1),
        )

    def one(state: PPOState, key: Key[Array, ""]) -> Approach:
        def on(blocked: Array) -> Approach:
            each = jax.random.split(key, APPROACHES)
            every = jax.vmap(partial(approach, state, blocked))(each)
            return jax.tree.map(lambda part: part.mean(0), every)

        return jax.vmap(on)(jnp.array([road == "blocked" for road in ROADS]))

    found: Approach = _each_trial(one, state, keys)
    return found


@eqx.filter_jit
def episodes_of(
    world: Traffic, learner: PPO, state: PPOState, keys: Key[Array, "trial"]
) -> Transition:
    """One whole episode of each trial, for its scene."""

    def one(state: PPOState, key: Key[Array, ""]) -> Transition:
        played: Transition = rollout(
            world, learner.policy(state, explore=True), key, world.horizon
        )[1]
        return played

    found: Transition = _each_trial(one, state, keys)
    return found


def upon_a_stopped_car(
    world: Traffic, key: Key[Array, ""], blocked: Bool[Array, ""]
) -> tuple[State, Float[Array, ""]]:
    """A start, and the place on the section where a car stands, if one does."""
    for_state, for_gap, for_speed = jax.random.split(key, 3)
    state, _ = world.reset(for_state)
    speed = jax.random.uniform(for_speed, minval=SPEEDS[0], maxval=SPEEDS[1])
    speed = jnp.minimum(speed, world.top_speed)
    braking = braking_distance(speed[None], world.acceleration, "distance")[0]
    most = world.car_length + braking
    gap = LEAST_GAP + jax.random.uniform(for_gap) * jnp.maximum(most - LEAST_GAP, 0.0)
    return dataclasses.replace(
        state,
        element=jnp.broadcast_to(state.element[0], 2),
        exit=jnp.broadcast_to(state.exit[0], 2),
        position=jnp.stack([jnp.full_like(gap, START), START + gap]).astype(state.position.dtype),
        lane=jnp.ones(2, jnp.int32),
        speed=jnp.stack([speed, jnp.zeros_like(speed)]).astype(state.speed.dtype),
        dead=jnp.array([0, FOR_EVER], jnp.int32),
        present=jnp.array([True, False]) | blocked,
    ), START + gap


def _play(
    world: World,
    policy: Policy,
    key: Key[Array, ""],
    episodes: int,
) -> Transition:
    return play_episodes(world, policy, key, episodes, keep=_numbers)


def _numbers(transition: Transition) -> Transition:
    """Of a transition what is counted."""
    outcome = dataclasses.replace(transition.outcome, observation={})
    return dataclasses.replace(
        transition, state=None, next_state=None, observation={}, action={}, outcome=outcome
    )


def _each_trial(
    of_one: Callable[[PPOState, Key[Array, ""]], Any], state: PPOState, keys: Key[Array, "trial"]
) -> Any:
    """One trial after the other, to keep memory low."""
    return lax.map(lambda each: of_one(*each), (state, keys))
