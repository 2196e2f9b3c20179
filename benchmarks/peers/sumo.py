"""Cars on the one-way grid in SUMO, through libsumo."""

import random
import subprocess
import tempfile
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, ElementTree, SubElement

from ethogram.worlds.traffic import Graph, Traffic

WAIT = 1000  # steps at most until all cars are in
WAY = 1e6  # m of a route, more than any car drives here


class Sumo(NamedTuple):
    """A simulation of this process."""

    cars: tuple[str, ...]  # those that came in
    advance: Callable[[], int]  # a step with reads and writes: how many cars took it
    coast: Callable[[], int]  # a step of SUMO alone: the same


def sumo(world: Traffic, cars: int, seed: int) -> Sumo:
    """Cars on the world's graph, of the world's size, speed and acceleration.

    A step reads each car's speed, road, position, lane, and leader with the gap to it, and writes
    its acceleration and lane, both drawn.  The drivers are SUMO's, who obey as far as it is safe;
    nobody has right of way at a vertex, as in our world, and SUMO does not look for collisions.
    Cars drive at random for ever and are never teleported.

    Args:
        world: whose graph and settings are taken.
        cars: how many are to come in; fewer do if SUMO finds no room.
        seed: of SUMO and of what is drawn.

    """
    import libsumo

    folder = tempfile.TemporaryDirectory()
    path = Path(folder.name)
    libsumo.start(
        [
            "sumo",
            *("--net-file", str(_network(world.graph, path))),
            *("--route-files", str(_routes(world, cars, path, random.Random(seed)))),
            *("--step-length", _number(world.time_step), "--seed", str(seed)),
            *("--time-to-teleport", "-1", "--collision.action", "none"),
            *("--no-step-log", "true", "--no-warnings", "true"),
        ]
    )
    for _ in range(WAIT):
        libsumo.simulationStep()
        if libsumo.vehicle.getIDCount() == cars:
            break
    vehicle, names = libsumo.vehicle, tuple(libsumo.vehicle.getIDList())
    draw = random.Random(seed)
    choices = [(draw.randrange(-1, 2), draw.randrange(-1, 2)) for _ in range(9973)]
    numbers = count()
    duration, acceleration = float(world.time_step), float(world.acceleration)
    view = float(world.view_distance)
    last = world.graph.max_lanes - 1

    def advance() -> int:
        libsumo.simulationStep()
        seen = 0.0
        for name in names:
            road, lane = vehicle.getRoadID(name), vehicle.getLaneIndex(name)
            seen += vehicle.getSpeed(name) + vehicle.getLanePosition(name)
            leader = vehicle.getLeader(name, view)
            if leader:
                seen += leader[1]
            faster, aside = choices[next(numbers) % len(choices)]
            vehicle.setAcceleration(name, faster * acceleration, duration)
            if aside and not road.startswith(":"):  # a vertex has one lane
                vehicle.changeLane(name, min(max(lane + aside, 0), last), duration)
        if not seen:
            raise RuntimeError("SUMO: nothing was seen: the benchmark does not measure driving")
        return len(names)

    def coast() -> int:
        libsumo.simulationStep()
        return len(names)

    return Sumo(names, advance, coast)


def _network(graph: Graph, folder: Path) -> Path:
    """The graph as `netconvert` of SUMO builds it."""
    import sumo

    nodes, edges = Element("nodes"), Element("edges")
    for number, (x, y) in enumerate(graph.places):
        SubElement(nodes, "node", id=f"v{number}", x=str(x), y=str(y), type="unregulated")
    for number, (length, lanes, start, end) in enumerate(graph.sections):
        SubElement(
            edges,
            "edge",
            {"id": f"s{number}", "from": f"v{start}", "to": f"v{end}"},
            numLanes=str(lanes),
            length=str(length),
            speed="50",
        )
    built = folder / "grid.net.xml"
    subprocess.run(
        [
            Path(sumo.SUMO_HOME) / "bin" / "netconvert",
            *("--node-files", _written(nodes, folder / "grid.nod.xml")),
            *("--edge-files", _written(edges, folder / "grid.edg.xml")),
            *("--no-turnarounds", "true", "--output-file", built),
        ],
        check=True,
        capture_output=True,
    )
    return built


def _routes(world: Traffic, cars: int, folder: Path, draw: random.Random) -> Path:
    """Cars at random places, each with a random way."""
    graph = world.graph
    routes = Element("routes")
    SubElement(
        routes,
        "vType",
        id="car",
        length=_number(world.car_length),
        accel=_number(world.acceleration),
        decel=_number(world.acceleration),
        maxSpeed=_number(world.max_speed),
    )
    for car in range(cars):
        way = [draw.randrange(len(graph.sections))]
        for _ in range(int(WAY / graph.sections[0].length)):
            way.append(draw.choice(graph.onward[way[-1]]))
        vehicle = SubElement(
            routes,
            "vehicle",
            id=f"c{car}",
            type="car",
            depart="0",
            departPos="random_free",
            departLane="random",
        )
        SubElement(vehicle, "route", edges=" ".join(f"s{section}" for section in way))
    return _written(routes, folder / "grid.rou.xml")


def _number(value: Any) -> str:
    return f"{float(value):g}"


def _written(root: Element, path: Path) -> Path:
    ElementTree(root).write(path)
    return path
