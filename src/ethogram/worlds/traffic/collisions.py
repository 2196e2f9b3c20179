"""Who collides, and what becomes of those who have (eq. 4.7, section 4.4).

Two cars collide that are closer than the length of a car: in the same element and the same lane, or
across the boundary to the element that one of them has chosen as its next.  Across a boundary lanes
do not count, as of two elements one is a vertex, which has one lane.  Both collide, whoever hit
whom; a car that is dead already stays so for no longer.  As printed (`rule="literal"`), lanes never
count, and all elements that could be next do.

A car that was restored is immune until it overlaps no other; who drives into it collides.
"""

import dataclasses
from typing import Literal, NamedTuple

import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int

from ethogram.core.batching import least, put, take
from ethogram.core.settings import Number
from ethogram.worlds.traffic.dynamics import to_next_element
from ethogram.worlds.traffic.neighbours import AT, ELEMENT, Queue
from ethogram.worlds.traffic.state import Road, State

Collision = Literal["lanes", "literal"]


class Contact(NamedTuple):
    """Per car, whether another is closer than the length of a car."""

    ahead: Bool[Array, "car"]
    behind: Bool[Array, "car"]


def contact(state: State, line: Queue, road: Road, car_length: Number, rule: Collision) -> Contact:
    """Who overlaps whom (eq. 4.7)."""
    cars = len(state.element)
    if rule == "lanes":
        place = (state.lane - 1) * (cars + 1) + line.rank + 1
        nearest = take(line.next_in_lane(), place)
    else:
        nearest = line.rank + 1
    row = take(line.rows, nearest)
    same = row[:, ELEMENT] == state.element
    hits = state.present & same & (row[:, AT] - state.position < car_length)  # eq. 4.7
    hit = take(put(jnp.zeros(cars, bool), jnp.where(hits, nearest, cars), hits), line.rank)
    stop = jnp.where(state.present, to_next_element(state, road), jnp.inf)
    first, rear = _at_boundaries(state, line, road, stop, rule)
    where_to = state.exit if rule == "lanes" else state.element
    crosses = state.present & (stop + take(first, where_to) < car_length)  # eq. 4.7
    crossed = state.present & (take(rear, state.element) + state.position < car_length)
    return Contact(ahead=hits | crosses, behind=hit | crossed)


def _at_boundaries(
    state: State, line: Queue, road: Road, stop: Float[Array, "car"], rule: Collision
) -> tuple[Float[Array, "element"], Float[Array, "element"]]:
    """Positions of the first cars beyond a boundary, and distances to it of the last before it."""
    elements = len(road.length)
    nobody = jnp.full(elements + 1, jnp.inf, stop.dtype)
    first = take(line.rows[:, AT], line.first)
    if rule == "lanes":
        return first[:elements], least(nobody, state.exit, stop)[:elements]
    rear = least(nobody, state.element, stop)
    return take(first, road.following).min(1), take(rear, road.preceding).min(1)


def aged(state: State, *, restore: bool, immune: bool) -> State:
    """One step less to be dead for; who has been so for long enough is restored, or removed."""
    over = state.present & (state.dead == 1)
    dead = jnp.maximum(state.dead - 1, 0)
    return dataclasses.replace(
        state,
        dead=dead,
        impact=jnp.where(dead > 0, state.impact, 0),
        immune=state.immune | over if restore and immune else state.immune,
        present=state.present if restore else state.present & ~over,
    )


def collided(
    state: State, driven: Bool[Array, "car"], touching: Contact, dead_steps: Number
) -> tuple[State, Bool[Array, "car"]]:
    """Status after a step: who was driven, touches another and is not immune is dead (eq. 4.7).

    Args:
        state: after the move.
        driven: who was alive during it.
        touching: others, after the move.
        dead_steps: for how long.

    """
    touches = touching.ahead | touching.behind
    collision = driven & ~state.immune & touches
    sign: Int[Array, "car"] = jnp.where(touching.ahead, -1, 1)
    after = dataclasses.replace(
        state,
        dead=jnp.where(collision, dead_steps, state.dead).astype(jnp.int32),
        impact=jnp.where(collision, sign, state.impact),
        immune=state.immune & touches,
    )
    return after, collision
