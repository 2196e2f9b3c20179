"""The three rules, as predicates of what a driver observes (eqs. 4.11 to 4.13)."""

from typing import Literal

import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float

from ethogram.core.settings import Number
from ethogram.worlds.traffic.dynamics import to_next_element
from ethogram.worlds.traffic.observation import Sight
from ethogram.worlds.traffic.state import Road, State

Braking = Literal["distance", "literal"]
RULES = ("intersection", "distance", "right lane")


def breaches(
    state: State,
    road: Road,
    sight: Sight,
    *,
    car_length: Number,
    view: Number,
    max_acceleration: Number,
    intersection_speed: Number,
    braking: Braking,
) -> Bool[Array, "car rule"]:
    """Which rules each driver breaks, whether alive or not.

    Args:
        state: of the cars.
        road: that they are on.
        sight: what drivers see ahead.
        car_length: l_car, m.
        view: d_view, m.
        max_acceleration: a_max, m/s^2.
        intersection_speed: allowed at intersections, m/s.
        braking: "distance" compares with the braking distance v^2 / (2 a), "literal" with 2 a v^2.

    """
    on_section = state.element < road.sections
    is_close = ~on_section | (to_next_element(state, road) < 2 * car_length)
    intersection = is_close & (state.speed > intersection_speed)  # eq. 4.11
    needed = braking_distance(state.speed, max_acceleration, braking)
    distance = sight.distance[:, 1] - car_length < needed  # eq. 4.12
    right_lane = on_section & (state.lane > 1) & (sight.distance[:, 0] >= view)  # eq. 4.13
    return jnp.stack([intersection, distance, right_lane], -1)


def braking_distance(
    speed: Float[Array, "car"], max_acceleration: Number, braking: Braking
) -> Float[Array, "car"]:
    """How far a car gets until it stands, m; "literal": as eq. 4.12 has it."""
    square = speed * speed
    return (
        2 * max_acceleration * square if braking == "literal" else square / (2 * max_acceleration)
    )
