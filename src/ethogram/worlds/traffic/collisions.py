"""Who collides, and what becomes of those who have (eq. 4.7, section 4.4).

Two cars collide that are closer than the length of a car: in the same element and the same lane, or
across the boundary to the element that one of them has chosen as its next.  Across a boundary lanes
do not count, as of two elements one is a vertex, which has one lane.  Both collide, whoever hit
whom; a car that is dead already stays so for no longer.  As printed (`rule="literal"`), lanes never
count, and all elements that could be next do.

A car that was restored is spared by those that it overlaps then, for as long as it does: else a
pair that overlaps would collide for ever.  Others it may collide with, as any car.  Of the cars
that it overlaps in its lane the nearest count, one ahead and one behind, and so across boundaries.
"""

import dataclasses
from typing import Literal, NamedTuple

import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int

from ethogram.core.batching import least, put, take
from ethogram.core.settings import Number
from ethogram.worlds.traffic.dynamics import to_next_element
from ethogram.worlds.traffic.neighbours import AT, ELEMENT, NUMBER, Queue
from ethogram.worlds.traffic.state import Road, State

Collision = Literal["lanes", "literal"]


SLOTS = 4  # in a lane ahead, across a boundary ahead; in a lane behind, across one behind
AHEAD = slice(0, 2)


class End(NamedTuple):
    """Of each element, the car that is nearest to one of its ends."""

    distance: Float[Array, "element"]  # m
    number: Int[Array, "element"]  # of the car


def contact(
    state: State, line: Queue, road: Road, car_length: Number, rule: Collision
) -> Int[Array, "car slot"]:
    """Who overlaps whom (eq. 4.7): the numbers of up to `SLOTS` other cars, -1 for none."""
    cars = len(state.element)
    if rule == "lanes":
        place = (state.lane - 1) * (cars + 1) + line.rank + 1
        nearest = take(line.next_in_lane(), place)
    else:
        nearest = line.rank + 1
    row = take(line.rows, nearest)
    same = row[:, ELEMENT] == state.element
    hits = state.present & same & (row[:, AT] - state.position < car_length)  # eq. 4.7
    number = jnp.arange(cars, dtype=jnp.int32)
    nobody = jnp.full(cars, -1, jnp.int32)
    hit_by = take(put(nobody, jnp.where(hits, nearest, cars), number), line.rank)
    stop = jnp.where(state.present, to_next_element(state, road), jnp.inf)
    first, rear = _at_boundaries(state, line, road, stop, rule)
    where_to = state.exit if rule == "lanes" else state.element
    crosses = state.present & (stop + take(first.distance, where_to) < car_length)  # eq. 4.7
    crossed = state.present & (take(rear.distance, state.element) + state.position < car_length)
    others = (
        jnp.where(hits, row[:, NUMBER].astype(jnp.int32), -1),
        jnp.where(crosses, take(first.number, where_to), -1),
        hit_by,
        jnp.where(crossed, take(rear.number, state.element), -1),
    )
    return jnp.stack(others, -1)


def _at_boundaries(
    state: State, line: Queue, road: Road, stop: Float[Array, "car"], rule: Collision
) -> tuple[End, End]:
    """The first car beyond a boundary, and the last before it: of ties that of smallest number."""
    elements, cars = len(road.length), len(stop)
    rows = take(line.rows, line.first)
    first = End(rows[:, AT], rows[:, NUMBER].astype(jnp.int32))
    boundary = state.exit if rule == "lanes" else state.element
    distance = least(jnp.full(elements + 1, jnp.inf, stop.dtype), boundary, stop)
    is_rear = state.present & (stop == take(distance, boundary))
    number = jnp.where(is_rear, jnp.arange(cars, dtype=jnp.int32), cars)
    rear = End(distance, least(jnp.full(elements + 1, cars, jnp.int32), boundary, number))
    if rule == "lanes":
        return first, rear
    return _nearest(first, road.following), _nearest(rear, road.preceding)


def _nearest(ends: End, elements: Int[Array, "element other"]) -> End:
    """Of the ends of some elements, the one whose car is nearest."""
    distance = take(ends.distance, elements)
    nearest = distance.argmin(1)[:, None]
    number = jnp.take_along_axis(take(ends.number, elements), nearest, 1)
    return End(distance.min(1), number[:, 0])


def aged(state: State, *, restore: bool) -> tuple[State, Bool[Array, "car"]]:
    """One step less to be dead for; who has been so for long enough is restored, or removed.

    Returns:
        The state, and who was restored.

    """
    over = state.present & (state.dead == 1)
    dead = jnp.maximum(state.dead - 1, 0)
    after = dataclasses.replace(
        state,
        dead=dead,
        impact=jnp.where(dead > 0, state.impact, 0),
        present=state.present if restore else state.present & ~over,
    )
    return after, over & restore


def spared(state: State, restored: Bool[Array, "car"], touching: Int[Array, "car slot"]) -> State:
    """Who was restored has nothing to fear from those whom it overlaps now."""
    return dataclasses.replace(
        state, spared_by=jnp.where(restored[:, None], touching, state.spared_by)
    )


def collided(
    state: State,
    driven: Bool[Array, "car"],
    touching: Int[Array, "car slot"],
    dead_steps: Number,
) -> tuple[State, Bool[Array, "car"]]:
    """Status after a step: who was driven and touches another that does not spare it is dead.

    Args:
        state: after the move.
        driven: who was alive during it.
        touching: others, after the move.
        dead_steps: for how long (eq. 4.7).

    """
    same = state.spared_by[:, :, None] == touching[:, None, :]
    harmed = (touching >= 0) & ~same.any(1)
    collision = driven & harmed.any(-1)
    sign: Int[Array, "car"] = jnp.where(harmed[:, AHEAD].any(-1), -1, 1)
    after = dataclasses.replace(
        state,
        dead=jnp.where(collision, dead_steps, state.dead).astype(jnp.int32),
        impact=jnp.where(collision, sign, state.impact),
        spared_by=jnp.where(same.any(2), state.spared_by, -1),
    )
    return after, collision
