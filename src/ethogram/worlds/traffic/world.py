"""Cars on a road graph, each with a driver, fined for breaking traffic rules (thesis, section 4.3).

A car is on an element of the graph (`ethogram.worlds.traffic.graph`), some metres along it, in a
lane.  Its driver accelerates and changes lanes; it moves (`dynamics`), collides with those that it
comes too close to (`collisions`), sees the nearest cars ahead (`observation`), earns its speed and
pays for the rules it breaks (`rules`).  Dead cars stay where they are for some time, obstacles to
all; then they are removed, or restored.

Units: metres, seconds; a step is `time_step` seconds.  `speed_unit="km/h"` reads `max_speed` and
`intersection_speed` in km/h.

Deviations from the printed text, each with a setting that undoes it: the new speed decides both
where a car gets and whether it leaves its element (`transition`); cars in different lanes do not
collide, and of the next elements only the chosen one counts (`collision`); restored cars
do not collide with those that they still overlap (`revive`); a driver keeps the distance
v^2 / (2 a) that it needs to stop, not 2 a v^2 (`braking`); the dead earn nothing and are not fined
(`fine_dead`), where the text lets them earn during their impact.  Without a setting: all
cars start apart from each other along the whole of the road, as if its sections were one line; and
the end of an episode is a time limit, hence a truncation.
"""

from typing import Annotated, Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float, Int, Key
from pydantic import Field

from ethogram.core.batching import take
from ethogram.core.errors import InvalidSettings
from ethogram.core.keys import random_words, scaled
from ethogram.core.rollout import first_episode
from ethogram.core.scene import Scene
from ethogram.core.settings import Number, Positive, setting
from ethogram.core.spaces import Box, Discrete, MultiDiscrete
from ethogram.core.world import Outcome, PerRole, Role, Transition, World
from ethogram.worlds.traffic import dynamics
from ethogram.worlds.traffic.collisions import SLOTS, Collision, aged, collided, contact, spared
from ethogram.worlds.traffic.graph import Graph, Name, as_graph
from ethogram.worlds.traffic.neighbours import Queue, queue
from ethogram.worlds.traffic.observation import LANES, OWN, Sight, ahead, behind, observed
from ethogram.worlds.traffic.rules import Braking, breaches
from ethogram.worlds.traffic.scene import record
from ethogram.worlds.traffic.start import PARTS, scattered
from ethogram.worlds.traffic.state import Road, State

Cars = Annotated[int, Field(ge=0, le=100_000)]
Steps = Annotated[int, Field(ge=1, le=1_000_000)]
Weight = Annotated[float, Field()]
Revive = Literal["spared", "literal"]
SpeedUnit = Literal["m/s", "km/h"]

UNITS = {"m/s": 1.0, "km/h": 1 / 3.6}  # in m/s
CHOICES = 3  # of each part of an action: -1, 0, 1


class Traffic(World):
    """Drivers on a road graph; the role `driver`, and `human` if there are any.

    Action of each: two choices of three, (1 + a_x, 1 + a_y): brake, keep the speed or accelerate;
    and to the right, keep the lane or to the left.  As a joint action it is 3 (1 + a_x) + 1 + a_y.
    Observation, entry by entry, scaled to [0, 1], or [-1, 1] for relative speeds, by its range:

    - distance to the next element, m;
    - lane, from 1, the rightmost;
    - speed, m/s;
    - 1 if alive, 0 if dead;
    - 1 on a section, 0 on a vertex;
    - of the lanes to the right, its own, to the left: the distance of the nearest car ahead, m;
    - of the same: own speed less that car's, m/s.

    A `human` sees behind, too: as many entries again as the last six, of the nearest cars behind.
    A car that is not there, or not any more, observes 0.

    Attributes:
        graph: "grid_oneway", "grid_twoway", a `Graph`, or sections (length, lanes, from, to).
        cars: n_car, of the role `driver`; up to `max_cars`, as an array too.
        max_cars: for how many drivers there is room: all numbers within it share one program.
        humans: cars of the role `human`, for policies that are given.
        steps: T, of an episode, from 1 to 1 000 000.
        time_step: dt, s.
        max_speed: v_max, m/s.
        acceleration: a_max, m/s^2.
        car_length: l_car, m.
        view_distance: d_view, m.
        vertex_length: m; not in the thesis, and as long as a step at the maximum speed.
        start_gap: x_gap, m, between cars at the start; not in the thesis.
        impact_acceleration: a_coll, m/s^2; not in the thesis.
        impact_steps: t_coll, for which cars that collided are pushed apart.
        dead_steps: t_dead, for which they are dead in all.
        intersection_speed: the most that is allowed at an intersection, m/s.
        intersection_weight: w_1, fine for breaking the intersection rule.
        distance_weight: w_2, for the distance rule.
        right_lane_weight: w_3, for the right lane rule.
        collided: whether cars that have been dead are "restored" or "removed".
        speed_unit: "m/s", or "km/h" for the two speeds above.
        transition: "new_speed" decides where a car is; "literal", as printed, the old one whether
            it leaves its element.
        collision: "lanes" tells them apart; "literal" does not.
        impact: whether cars that collided move before they stand.
        revive: "spared" by the cars that they overlap, while they do, or "literal".
        braking: "distance" v^2 / (2 a), or "literal", 2 a v^2.
        fine_dead: whether the dead earn and are fined as the living.
        joint_action: whether an action is one choice of nine.
        scale: whether observations are scaled.

    """

    graph: Graph = eqx.field(
        default="grid_oneway",
        static=True,
        converter=as_graph,
        metadata={
            "setting": Name | tuple[tuple[float, int, int, int], ...],
            "checked by converter": True,
        },
    )
    cars: int | Int[Array, ""] = setting(40, Cars)
    max_cars: int = setting(40, Annotated[int, Field(ge=1, le=100_000)], static=True)
    humans: int = setting(0, Cars, static=True)
    steps: int = setting(500, Steps, static=True)
    time_step: Number = setting(0.2, Positive)
    max_speed: Number = setting(50.0, Positive)
    acceleration: Number = setting(2.0, Positive)
    car_length: Number = setting(7.0, Positive)
    view_distance: Number = setting(50.0, Positive)
    vertex_length: Number = setting(10.0, Positive)
    start_gap: Number = setting(10.0, Annotated[float, Field(ge=0)])
    impact_acceleration: Number = setting(5.0, Annotated[float, Field(ge=0)])
    impact_steps: int | Int[Array, ""] = setting(10, Annotated[int, Field(ge=0, le=1_000_000)])
    dead_steps: int | Int[Array, ""] = setting(20, Steps)
    intersection_speed: Number = setting(10.0, Annotated[float, Field(ge=0)])
    intersection_weight: Number = setting(1.0, Weight)
    distance_weight: Number = setting(1.0, Weight)
    right_lane_weight: Number = setting(1.0, Weight)
    collided: Literal["restored", "removed"] = setting(
        "restored", Literal["restored", "removed"], static=True
    )
    speed_unit: SpeedUnit = setting("m/s", SpeedUnit, static=True)
    transition: dynamics.Transition = setting("new_speed", dynamics.Transition, static=True)
    collision: Collision = setting("lanes", Collision, static=True)
    impact: bool = setting(True, bool, static=True)
    revive: Revive = setting("spared", Revive, static=True)
    braking: Braking = setting("distance", Braking, static=True)
    fine_dead: bool = setting(False, bool, static=True)
    joint_action: bool = setting(False, bool, static=True)
    scale: bool = setting(True, bool, static=True)

    def __check_init__(self) -> None:
        """Refuse cars that there is no room for, and elements that a car could jump over.

        Raises:
            InvalidSettings: naming the setting, its value and what is allowed.

        """
        cars, gap = _most(self.cars), _most(self.start_gap)
        if cars is not None and cars > self.max_cars:
            raise InvalidSettings(
                f"Traffic: cars = {cars:g} is more than max_cars = {self.max_cars}."
            )
        room = sum(section.length for section in self.graph.sections)
        if room * PARTS >= 2**31:
            raise InvalidSettings(
                f"Traffic: {room:g} m of sections; allowed: less than {2**31 // PARTS} m."
            )
        if cars is not None and gap is not None and (cars + self.humans) * gap >= room:
            raise InvalidSettings(
                f"Traffic: {cars + self.humans:g} cars at start_gap = {gap:g} m need more than the "
                f"{room:g} m of the graph's sections."
            )
        dead, impact = _most(self.dead_steps), _most(self.impact_steps)
        if dead is not None and impact is not None and impact > dead:
            raise InvalidSettings(
                f"Traffic: impact_steps = {impact:g} is more than dead_steps = {dead:g}."
            )
        self._check_lengths()

    def _check_lengths(self) -> None:
        numbers = self.vertex_length, self.max_speed, self.time_step
        if any(isinstance(each, jax.core.Tracer) or np.ndim(each) for each in numbers):
            return
        vertex, speed, step = (float(each) for each in numbers)
        shortest = min(vertex, *(section.length for section in self.graph.sections))
        leap = speed * UNITS[self.speed_unit] * step
        if shortest < leap * (1 - 1e-6):  # up to the rounding of 32 bits
            raise InvalidSettings(
                f"Traffic: at max_speed = {speed:g} {self.speed_unit} a step of time_step = "
                f"{step:g} s is {leap:g} m; allowed: no more than the shortest element, which is "
                f"{shortest:g} m."
            )

    @property
    def horizon(self) -> int:
        """Every episode lasts `steps` steps, or until all cars are removed."""
        return self.steps

    @property
    def roles(self) -> dict[str, Role]:
        """`driver`, and `human` if there are any."""
        action = Discrete(CHOICES**2) if self.joint_action else MultiDiscrete((CHOICES, CHOICES))
        counts = {"driver": self.max_cars, "human": self.humans}
        return {
            role: Role(count, self._box(sees_behind=role == "human"), action)
            for role, count in counts.items()
            if count
        }

    def reset(self, key: Key[Array, ""]) -> tuple[State, PerRole]:
        """Cars at random places on the sections, at rest, further apart than `start_gap`."""
        count = self._count
        along, lanes = random_words(key, 2, count)
        number = jnp.arange(count)
        present = (number < self.cars) | (number >= self.max_cars)
        lengths = self._road.length[: len(self.graph.sections)]
        element, position = scattered(along, present, lengths, self.start_gap)
        road = self._road
        state = State(
            element=element,
            position=position,
            lane=1 + scaled(lanes, take(road.lanes, element)),
            speed=jnp.zeros(count),
            exit=take(road.end, element),
            dead=jnp.zeros(count, jnp.int32),
            impact=jnp.zeros(count, jnp.int32),
            spared_by=jnp.full((count, SLOTS), -1, jnp.int32),
            present=present,
            time=jnp.int32(0),
        )
        return state, self.observe(state)

    def observe(self, state: State) -> PerRole:
        """What each driver sees of its car and of those ahead."""
        line = queue(state, self._road)
        return self._observation(state, line, self._ahead(state, line))

    def step(self, key: Key[Array, ""], state: State, action: PerRole) -> tuple[State, Outcome]:
        """Drive, collide; then observe, earn and be fined in the state reached."""
        road, driven = self._road, state.alive
        after = self._drive(key, state, action)
        after, restored = aged(after, restore=self.collided == "restored")
        line = queue(after, road)
        touching = contact(after, line, road, self.car_length, self.collision)
        if self.revive == "spared":
            after = spared(after, restored, touching)
        after, collision = collided(after, driven, touching, self.dead_steps)
        sight = self._ahead(after, line)
        broken = self._breaches(after, sight)
        return after, Outcome(
            observation=self._observation(after, line, sight),
            reward=self._by_role(self._earned(after, broken)),
            terminated=self._by_role(self._terminated(after)),
            truncated=self._by_role(jnp.broadcast_to(after.time >= self.steps, self._count)),
            acting=self._by_role(driven),
            metrics={
                "speed": after.speed,
                "distance": after.speed * self.time_step,
                "collision": collision,
                "breaches": broken,
            },
        )

    def scene(self, trajectory: Transition) -> Scene:
        """The states that the first episode reached, one per step."""
        episode = first_episode(self, trajectory)
        return record(
            episode.next_state,
            episode.outcome.metrics,
            self.graph,
            length=np.asarray(self._road.length),
            car_length=float(self.car_length),
            time_step=float(self.time_step),
            drivers=self.max_cars,
        )

    def ranges(self, *, sees_behind: bool) -> Float[Array, "feature"]:
        """The end of each entry's range, unscaled."""
        length = self._road.length.max()
        own = [length, self.graph.max_lanes, self.top_speed, 1.0, 1.0]
        lanes = [self.view_distance] * len(LANES) + [self.top_speed] * len(LANES)
        return jnp.stack([jnp.asarray(each, float) for each in own + lanes * (1 + sees_behind)])

    @property
    def top_speed(self) -> Number:
        """v_max, m/s."""
        return self.max_speed * UNITS[self.speed_unit]

    @property
    def allowed_speed(self) -> Number:
        """The most that is allowed at an intersection, m/s."""
        return self.intersection_speed * UNITS[self.speed_unit]

    @property
    def _count(self) -> int:
        return self.max_cars + self.humans

    @property
    def _road(self) -> Road:
        tables, sections = self.graph.tables, self.graph.sections
        lengths = jnp.array([section.length for section in sections], float)
        vertices = jnp.broadcast_to(self.vertex_length, self.graph.vertices)
        return Road(
            length=jnp.concatenate([lengths, vertices]),
            lanes=jnp.asarray(tables.lanes, jnp.int32),
            following=jnp.asarray(tables.following, jnp.int32),
            preceding=jnp.asarray(tables.preceding, jnp.int32),
            end=jnp.asarray(tables.end, jnp.int32),
            exits=jnp.asarray(tables.exits, jnp.int32),
            choices=jnp.asarray(tables.choices, jnp.int32),
            sections=len(sections),
            max_lanes=self.graph.max_lanes,
        )

    def _drive(self, key: Key[Array, ""], state: State, action: PerRole) -> State:
        chosen = jnp.concatenate([action[role] for role in self.roles]).astype(jnp.int32)
        if self.joint_action:
            chosen = jnp.stack([chosen // CHOICES, chosen % CHOICES], -1)
        accelerate, steer = chosen[:, 0] - 1, chosen[:, 1] - 1
        alive = state.alive
        moving = dynamics.impacting(state, self.impact_steps, self.dead_steps) & self.impact
        push = state.impact * self.impact_acceleration
        acceleration = jnp.where(alive, accelerate * self.acceleration, push)
        faster = dynamics.accelerated(state.speed, acceleration, self.time_step, self.top_speed)
        speed = jnp.where(alive | moving, faster, 0.0)
        lane_speed = jnp.where(alive, steer, 0)  # eq. 4.2
        bits = random_words(key, self._count)
        return dynamics.moved(
            state, self._road, speed, lane_speed, self.time_step, bits, self.transition
        )

    def _ahead(self, state: State, line: Queue) -> Sight:
        return ahead(state, line, self._road, self.view_distance, self.top_speed)

    def _breaches(self, state: State, sight: Sight) -> Bool[Array, "car rule"]:
        broken = breaches(
            state,
            self._road,
            sight,
            car_length=self.car_length,
            view=self.view_distance,
            max_acceleration=self.acceleration,
            intersection_speed=self.allowed_speed,
            braking=self.braking,
        )
        return broken & self._earning(state)[:, None]

    def _earning(self, state: State) -> Bool[Array, "car"]:
        return state.present if self.fine_dead else state.alive

    def _earned(self, state: State, broken: Bool[Array, "car rule"]) -> Float[Array, "car"]:
        weights = (self.intersection_weight, self.distance_weight, self.right_lane_weight)
        fine = sum(weight * broken[:, rule] for rule, weight in enumerate(weights))
        return jnp.where(self._earning(state), state.speed / self.top_speed - fine, 0.0)  # eq. 4.14

    def _terminated(self, state: State) -> Bool[Array, "car"]:
        """Who earns nothing any more: those that are out, and the dead that will be."""
        will_be_out = self.collided == "removed" and not self.fine_dead
        return ~state.present | (state.dead > 0) if will_be_out else ~state.present

    def _box(self, *, sees_behind: bool) -> Box:
        largest = self.ranges(sees_behind=sees_behind)
        relative = _relative(len(largest))
        if self.scale:
            return Box(jnp.where(relative, -1.0, 0.0), 1.0, largest.shape)
        return Box(jnp.where(relative, -largest, 0.0), largest, largest.shape)

    def _observation(self, state: State, line: Queue, sight: Sight) -> PerRole:
        sights = [sight]
        if self.humans:
            sights.append(behind(state, line, self._road, self.view_distance, self.top_speed))
        largest = self.ranges(sees_behind=bool(self.humans))
        origin, scale = jnp.zeros(len(largest)), jnp.ones(len(largest))
        if self.scale:
            origin = origin.at[1].set(1.0)
            scale = largest.at[1].set(max(1, self.graph.max_lanes - 1))
        seen = observed(state, self._road, sights, origin, scale)
        features = {"driver": OWN + 2 * len(LANES)}
        return {
            role: self.roles[role].observation.nearest(part[:, : features.get(role)])
            for role, part in self._by_role(seen).items()
        }

    def _by_role(self, values: Array) -> PerRole:
        parts = {"driver": values[: self.max_cars], "human": values[self.max_cars :]}
        return {role: part for role, part in parts.items() if len(part)}


def _relative(features: int) -> np.ndarray:
    """Which entries of an observation are relative speeds."""
    entry = np.arange(features) - OWN
    return (entry >= 0) & (entry % (2 * len(LANES)) >= len(LANES))


def _most(value: Any) -> float | None:
    """The largest of a setting's values; none if they are not known yet."""
    return None if isinstance(value, jax.core.Tracer) else np.asarray(value).max().item()
