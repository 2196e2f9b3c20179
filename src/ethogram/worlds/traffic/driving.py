"""How a driver reads what it observes, in metres and seconds, and how a wish becomes an action."""

from typing import Any, Literal, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int, Key

from ethogram.core.keys import random_words, unit
from ethogram.core.module import Module
from ethogram.core.settings import Number
from ethogram.worlds.traffic.observation import LANES, OWN
from ethogram.worlds.traffic.world import CHOICES, Traffic

Choice = Literal["random", "nearest"]


class Car(NamedTuple):
    """What a driver knows of other cars; arrays of one shape."""

    gap: Array  # m, from bumper to bumper; that to nobody is infinite
    speed: Array  # m/s


class View(NamedTuple):
    """An observation in metres and metres per second."""

    stop: Float[Array, "car"]  # distance to the next element
    lane: Int[Array, "car"]
    speed: Float[Array, "car"]
    on_section: Bool[Array, "car"]
    ahead: Car  # of each car and relative lane
    behind: Car | None  # of drivers that see behind
    lanes: int  # that a section has at most


class Body(Module):
    """What a driver must know of its car and its world to read observations and to act."""

    largest: Float[Array, "feature"]  # the end of each entry's range
    acceleration: Number  # a_max, m/s^2
    car_length: Number  # m
    view_distance: Number  # m
    top_speed: Number  # m/s
    intersection_speed: Number  # m/s
    time_step: Number  # s
    lanes: int = eqx.field(static=True)
    scale: bool = eqx.field(static=True)
    joint_action: bool = eqx.field(static=True)

    def view(self, observation: Float[Array, "car feature"]) -> View:
        """Read an observation, scaled or not."""
        features = observation.shape[1]
        values = observation * self.largest[:features] if self.scale else observation
        lane = jnp.round(observation[:, 1] * max(1, self.lanes - 1)) + 1
        speed = values[:, 2]
        others = [self._others(values[:, first:], speed) for first in range(OWN, features, 6)]
        return View(
            stop=values[:, 0],
            lane=(lane if self.scale else observation[:, 1]).astype(jnp.int32),
            speed=speed,
            on_section=observation[:, 4] > 0.5,
            ahead=others[0],
            behind=others[1] if len(others) > 1 else None,
            lanes=self.lanes,
        )

    def _others(self, values: Float[Array, "car rest"], speed: Float[Array, "car"]) -> Car:
        distance, relative = values[:, : len(LANES)], values[:, len(LANES) : 2 * len(LANES)]
        nobody = distance >= self.view_distance * (1 - 1e-6)
        gap = jnp.where(nobody, jnp.inf, distance - self.car_length)
        return Car(gap, jnp.where(nobody, speed[:, None], speed[:, None] - relative))

    def act(
        self, key: Key[Array, ""], acceleration: Float[Array, "car"], steer: Any, choice: Choice
    ) -> Array:
        """The action for an acceleration in m/s^2, and a change of lane (-1, 0, 1)."""
        wish = jnp.clip(acceleration / self.acceleration, -1.0, 1.0)
        if choice == "random":
            size = (unit(random_words(key, len(wish))) < jnp.abs(wish)).astype(jnp.int32)
        else:
            size = jnp.round(jnp.abs(wish)).astype(jnp.int32)
        accelerate = 1 + jnp.sign(wish).astype(jnp.int32) * size
        steer = 1 + jnp.broadcast_to(steer, wish.shape).astype(jnp.int32)
        if self.joint_action:
            return CHOICES * accelerate + steer
        return jnp.stack([accelerate, steer], -1)


def as_body(world: "Traffic | Body") -> Body:
    """What drivers must know of a world."""
    if isinstance(world, Body):
        return world
    return Body(
        largest=world.ranges(sees_behind=True),
        acceleration=world.acceleration,
        car_length=world.car_length,
        view_distance=world.view_distance,
        top_speed=world.top_speed,
        intersection_speed=world.allowed_speed,
        time_step=world.time_step,
        lanes=world.graph.max_lanes,
        scale=world.scale,
        joint_action=world.joint_action,
    )


def in_lane(others: Car, lane: int) -> Car:
    """The cars in one of the three lanes."""
    return Car(others.gap[:, lane], others.speed[:, lane])
