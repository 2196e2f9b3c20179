"""Cars on the one-way grid in highway-env."""

import random
from collections.abc import Callable
from itertools import count

from ethogram.worlds.traffic import Graph, Traffic

LANE = 4.0  # m, width
WAY = 3e5  # m of a route, more than any car drives here
ASIDE = {-1: "LANE_RIGHT", 0: "IDLE", 1: "LANE_LEFT"}


def highway(world: Traffic, cars: int, seed: int) -> Callable[[], int]:
    """A step of cars on the world's graph, with reads and writes: how many cars took it.

    A step reads each car's speed, position, lane, and the car ahead in its lane with the distance
    to it, and writes its target speed and lane, both drawn.  The road is driven without the
    environment around it, which would look at every car once more.  Cars that have collided drive
    on, where highway-env would let them stand for ever.  They steer through the vertices, which
    have no length here.

    Args:
        world: whose graph and settings are taken.
        cars: how many.
        seed: of what is drawn.

    """
    import numpy as np
    from highway_env.road.road import Road
    from highway_env.vehicle.controller import ControlledVehicle

    draw = random.Random(seed)
    road = Road(_network(world.graph), np_random=np.random.RandomState(seed))
    ControlledVehicle.LENGTH = float(world.car_length)
    for _ in range(cars):
        way = _way(world.graph, draw)
        index = (*way[0][:2], draw.randrange(len(road.network.graph[way[0][0]][way[0][1]])))
        lane = road.network.get_lane(index)
        along = draw.uniform(0.0, lane.length)
        car = ControlledVehicle(
            road, lane.position(along, 0.0), lane.heading_at(along), target_lane_index=index
        )
        car.route = way
        road.vehicles.append(car)
    choices = [(draw.randrange(-1, 2), draw.randrange(-1, 2)) for _ in range(9973)]
    numbers = count()
    duration, gain = float(world.time_step), float(world.acceleration)
    fastest = float(world.max_speed)
    change = gain / ControlledVehicle.KP_A  # of the target: how a car comes to accelerate so much

    def advance() -> int:
        seen = 0.0
        for car in road.vehicles:
            car.crashed = False
            position = car.lane.local_coordinates(car.position)[0]
            seen += car.speed + position + car.lane_index[2]
            leader, _ = road.neighbour_vehicles(car)
            if leader is not None:
                seen += car.lane_distance_to(leader)
            faster, aside = choices[next(numbers) % len(choices)]
            car.target_speed = min(max(car.speed + faster * change, 0.0), fastest)
            car.act(ASIDE[aside])
        road.step(duration)
        if not seen:
            raise RuntimeError("highway-env: nothing was seen: the benchmark measures no driving")
        return cars

    return advance


def _network(graph: Graph):
    """The graph, with lanes side by side."""
    import numpy as np
    from highway_env.road.lane import StraightLane
    from highway_env.road.road import RoadNetwork

    network, places = RoadNetwork(), np.array(graph.places)
    for _, lanes, start, end in graph.sections:
        along = places[end] - places[start]
        right = np.array([-along[1], along[0]]) / np.linalg.norm(along)  # y points down
        for lane in range(lanes):
            aside = right * LANE * (lane + 0.5)
            network.add_lane(
                str(start),
                str(end),
                StraightLane(places[start] + aside, places[end] + aside, LANE),
            )
    return network


def _way(graph: Graph, draw: random.Random) -> list[tuple[str, str, None]]:
    """A random way along sections."""
    section, way = draw.randrange(len(graph.sections)), []
    for _ in range(int(WAY / graph.sections[0].length)):
        _, _, start, end = graph.sections[section]
        way.append((str(start), str(end), None))
        section = draw.choice(graph.onward[section])
    return way
