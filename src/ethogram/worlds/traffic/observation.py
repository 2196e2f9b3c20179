"""What drivers see: the nearest car ahead in their own and the adjacent lanes (eqs. 4.8 to 4.10).

A car ahead is one further on in the same element and the lane y + j, or any car on an element that
may come next, up to the distance of view.  In a lane that does not exist nobody is seen.  Where
nobody is seen the distance is the distance of view, and the relative speed the maximum speed.
"""

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int

from ethogram.core.batching import least, take
from ethogram.core.settings import Number
from ethogram.worlds.traffic.dynamics import to_next_element
from ethogram.worlds.traffic.neighbours import AT, ELEMENT, SPEED, Queue
from ethogram.worlds.traffic.state import Road, State

LANES = (-1, 0, 1)  # j: to the right, own, to the left
OWN = 5  # entries of an observation before those of the lanes


class Sight(eqx.Module):
    """Per car and relative lane j = -1, 0, 1, the nearest car."""

    distance: Float[Array, "car 3"]  # delta_x, m
    relative_speed: Float[Array, "car 3"]  # delta_v, m/s: own less the other's


def ahead(state: State, line: Queue, road: Road, view: Number, max_speed: Number) -> Sight:
    """The nearest cars in front."""
    cars, elements = len(state.element), len(road.length)
    lane = state.lane[:, None] + jnp.array(LANES)
    exists = _exists(state, road, lane)
    place = jnp.where(exists, lane - 1, 0) * (cars + 1) + line.beyond()[:, None]
    row = take(line.rows, take(line.next_in_lane(), place))
    same = exists & (row[..., ELEMENT] == state.element[:, None])  # eq. 4.8
    near = jnp.where(same, row[..., AT] - state.position[:, None], jnp.inf)
    entries = take(line.rows, take(line.first, road.following))  # eq. 4.9
    nearest = entries[..., AT].argmin(1)[:, None, None]
    entry = jnp.take_along_axis(entries, nearest, 1)[:, 0]
    onward = take(entry, jnp.minimum(state.element, elements - 1))
    stop = to_next_element(state, road)
    far = jnp.where(exists, (stop + onward[:, AT])[:, None], jnp.inf)
    speed = jnp.where(near <= far, row[..., SPEED], onward[:, SPEED, None])
    return _seen(jnp.minimum(near, far), state.speed[:, None] - speed, view, max_speed)  # eq. 4.10


def behind(state: State, line: Queue, road: Road, view: Number, max_speed: Number) -> Sight:
    """The nearest cars at the back: of the element, or on the way to it."""
    cars, elements = len(state.element), len(road.length)
    lane = state.lane[:, None] + jnp.array(LANES)
    exists = _exists(state, road, lane)
    place = jnp.where(exists, lane - 1, 0) * (cars + 1) + line.level()[:, None]
    row = take(line.rows, take(line.last_in_lane(), place))
    same = exists & (row[..., ELEMENT] == state.element[:, None])
    near = jnp.where(same, state.position[:, None] - row[..., AT], jnp.inf)
    stop = jnp.where(state.present, to_next_element(state, road), jnp.inf)
    nobody = jnp.full(elements + 1, jnp.inf, stop.dtype)
    rear = least(nobody, state.exit, stop)
    is_rear = state.present & (stop == take(rear, state.exit))
    speeds = least(nobody, state.exit, jnp.where(is_rear, state.speed, jnp.inf))
    far = jnp.where(exists, (take(rear, state.element) + state.position)[:, None], jnp.inf)
    their_speed = take(speeds, state.element)[:, None]
    speed = jnp.where(near <= far, row[..., SPEED], jnp.where(jnp.isfinite(far), their_speed, 0))
    return _seen(jnp.minimum(near, far), state.speed[:, None] - speed, view, max_speed)


def observed(
    state: State, road: Road, sights: list[Sight], origin: Array, scale: Array
) -> Float[Array, "car feature"]:
    """Entries of an observation, less their origin, by their scale; of cars that are out, 0.

    Args:
        state: of the cars.
        road: that they are on.
        sights: what is seen ahead, and behind if that is seen.
        origin: Float[feature].
        scale: Float[feature].

    """
    kind = state.position.dtype
    stop = to_next_element(state, road)
    status, is_section = state.dead == 0, state.element < road.sections
    own = [stop, state.lane, state.speed, status, is_section]
    entries = [jnp.stack([each.astype(kind) for each in own], -1)]
    for sight in sights:
        entries += [sight.distance, sight.relative_speed]
    values = (jnp.concatenate(entries, -1) - origin) / scale
    return jnp.where(state.present[:, None], values, 0.0)


def _exists(state: State, road: Road, lane: Int[Array, "car 3"]) -> Bool[Array, "car 3"]:
    return (lane >= 1) & (lane <= take(road.lanes, state.element)[:, None])


def _seen(
    distance: Float[Array, "car 3"],
    relative_speed: Float[Array, "car 3"],
    view: Number,
    max_speed: Number,
) -> Sight:
    """Distances within the view, and relative speeds of those who are seen."""
    is_seen = distance <= view
    return Sight(
        distance=jnp.where(is_seen, distance, view),
        relative_speed=jnp.where(is_seen, relative_speed, max_speed),
    )
