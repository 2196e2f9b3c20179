"""Who is next to whom: cars in order along the elements, and the nearest one in a lane.

Cars are put in order by element, then by position, then by number.  The nearest car of a lane is
then the next place in that order with a car of the lane: no two cars need be compared.  Few cars
are ordered, and looked through, by counting and comparing places, which a processor does for eight
at a time and without a branch; many by sorting and running minima.  The work of the first grows
with the square of the cars and is the smaller up to some 120, that of the second as n log n.
"""

import equinox as eqx
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float, Int

from ethogram.core.batching import put, take
from ethogram.worlds.traffic.state import Road, State

FEW = 120  # cars at most that are counted
AT, SPEED, ELEMENT, NUMBER = range(4)  # columns of a row


class Queue(eqx.Module):
    """The present cars in order; the place after the last one stands for nobody."""

    rank: Int[Array, "car"]  # the place of each car
    # of the car at each place: position (m), speed (m/s), element and number, -1 for nobody
    rows: Float[Array, "place 4"]
    in_lane: Bool[Array, "lane car"]  # whether the car at each place is in the lane
    further: Bool[Array, "car"]  # whether the car at each place is further on than the one before
    first: Int[Array, "entry"]  # the place of the first car on each element, and on none

    def next_in_lane(self) -> Int[Array, "entry"]:
        """Of each lane and place, one after the other, the next place that is of the lane."""
        return next_true(self.in_lane).reshape(-1)

    def last_in_lane(self) -> Int[Array, "entry"]:
        """Of each lane and place, the last place before that is of the lane."""
        return last_true(self.in_lane).reshape(-1)

    def beyond(self) -> Int[Array, "car"]:
        """For each car, the first place of a car that is further on."""
        return take(next_true(self.further[None])[0], self.rank + 1)

    def level(self) -> Int[Array, "car"]:
        """For each car, the first place of a car that is as far."""
        return take(last_true(self.further[None])[0], self.rank + 1)


def queue(state: State, road: Road) -> Queue:
    """Put the cars in order."""
    cars, elements = len(state.element), len(road.length)
    element = jnp.where(state.present, state.element, elements)  # those that are out come last
    rank, order = in_order(element, state.position)
    at = state.position
    number = jnp.arange(cars, dtype=at.dtype)
    rows = take(jnp.stack([at, state.speed, element.astype(at.dtype), number], -1), order)
    lane = take(jnp.where(state.present, state.lane, 0), order)
    before = jnp.roll(rows, 1, 0)
    new_element = (rows[:, ELEMENT] != before[:, ELEMENT]).at[0].set(True)
    entry = jnp.where(new_element, rows[:, ELEMENT].astype(jnp.int32), elements + 1)
    first = put(jnp.full(elements + 1, cars, jnp.int32), entry, jnp.arange(cars, dtype=jnp.int32))
    nobody = jnp.array([[jnp.inf, 0.0, -1.0, -1.0]], at.dtype)
    return Queue(
        rank=rank,
        rows=jnp.concatenate([rows, nobody]),
        in_lane=lane == jnp.arange(1, road.max_lanes + 1)[:, None],
        further=new_element | (rows[:, AT] > before[:, AT]),
        first=first.at[elements].set(cars),
    )


def in_order(
    element: Int[Array, "car"], position: Float[Array, "car"]
) -> tuple[Int[Array, "car"], Int[Array, "car"]]:
    """The place of each car, by element, position and number; and the car at each place."""
    number = jnp.arange(len(element), dtype=jnp.int32)
    if len(element) > FEW:
        order = lax.sort((element, position, number), num_keys=3)[2]
        return put(jnp.zeros_like(number), order, number), order
    behind = position[:, None] < position
    tied = (position[:, None] == position) & (number[:, None] < number)
    same = element[:, None] == element
    before = (element[:, None] < element) | (same & (behind | tied))
    rank = before.sum(0, dtype=jnp.int32)
    return rank, put(jnp.zeros_like(number), rank, number)


def next_true(flags: Bool[Array, "row place"]) -> Int[Array, "row after"]:
    """The first true place from each place on; the number of places if there is none."""
    count = flags.shape[-1]
    place = jnp.arange(count, dtype=jnp.int32)
    if count > FEW:
        found = lax.cummin(jnp.where(flags, place, count), axis=1, reverse=True)
    else:
        ahead = flags[:, :, None] & (place[:, None] >= place)
        found = jnp.where(ahead, place[:, None], count).min(1)
    return jnp.pad(found, ((0, 0), (0, 1)), constant_values=count)


def last_true(flags: Bool[Array, "row place"]) -> Int[Array, "row after"]:
    """The last true place before each place; the number of places if there is none."""
    count = flags.shape[-1]
    place = jnp.arange(count, dtype=jnp.int32)
    if count > FEW:
        found = lax.cummax(jnp.where(flags, place, -1), axis=1)
    else:
        passed = flags[:, :, None] & (place[:, None] <= place)
        found = jnp.where(passed, place[:, None], -1).max(1)
    return jnp.pad(jnp.where(found < 0, count, found), ((0, 0), (1, 0)), constant_values=count)
