"""How cars move: speed, change of element, position, lane (eqs. 4.1 to 4.6).

The order is v, p, x, x_stop, y: the new speed decides both whether the car leaves its element and
how far it gets.  As printed (`transition="literal"`), the old speed decides whether it leaves.
"""

import dataclasses
from typing import Literal

import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int, UInt32

from ethogram.core.batching import take
from ethogram.core.keys import scaled
from ethogram.core.settings import Number
from ethogram.worlds.traffic.state import Road, State

Transition = Literal["new_speed", "literal"]


def accelerated(
    speed: Float[Array, "car"], acceleration: Float[Array, "car"], time_step: Number, limit: Number
) -> Float[Array, "car"]:
    """Speeds a step later, m/s (eq. 4.1)."""
    return jnp.minimum(limit, jnp.maximum(speed + acceleration * time_step, 0.0))  # eq. 4.1


def to_next_element(state: State, road: Road) -> Float[Array, "car"]:
    """x_stop, m (eq. 4.4)."""
    return take(road.length, state.element) - state.position  # eq. 4.4


def moved(
    state: State,
    road: Road,
    speed: Float[Array, "car"],
    lane_speed: Int[Array, "car"],
    time_step: Number,
    bits: UInt32[Array, "car"],
    transition: Transition,
) -> State:
    """The cars where a step takes them; who enters a vertex draws where to leave it.

    Args:
        state: at the start of the step.
        road: that they are on.
        speed: v_x at the end of the step, m/s.
        lane_speed: v_y, lanes per step; of cars that stand still 0.
        time_step: s.
        bits: a random word per car.
        transition: which speed decides whether a car leaves its element.

    """
    stop, advance = to_next_element(state, road), speed * time_step
    decisive = state.speed * time_step if transition == "literal" else advance
    leaves = state.present & (decisive > stop)
    element = jnp.where(leaves, state.exit, state.element)  # eq. 4.6
    overshoots = leaves if transition == "new_speed" else advance > stop
    position = jnp.where(overshoots, advance - stop, state.position + advance)  # eq. 4.3
    lane = jnp.clip(state.lane + lane_speed, 1, take(road.lanes, element))  # eq. 4.5
    onward = entered(state.element, state.exit, road, bits)
    return dataclasses.replace(
        state,
        element=element,
        position=position,
        lane=lane,
        speed=speed,
        exit=jnp.where(leaves, onward, state.exit),
        time=state.time + 1,
    )


def entered(
    left: Int[Array, "car"], element: Int[Array, "car"], road: Road, bits: UInt32[Array, "car"]
) -> Int[Array, "car"]:
    """What comes after an element just entered: after a vertex, a section at random."""
    width = road.exits.shape[1]
    choice = left * width + scaled(bits, take(road.choices, left))
    drawn = take(road.exits.reshape(-1), choice)
    return jnp.where(left < road.sections, drawn, take(road.end, element))


def impacting(state: State, steps: Number, dead_steps: Number) -> Bool[Array, "car"]:
    """Which cars move under their impact in the coming step."""
    return state.present & (state.dead > dead_steps - steps)
