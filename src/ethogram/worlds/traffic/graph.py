"""The road graph: one-way sections between vertices, checked when it is made (section 4.3.1).

Elements p are numbered: the sections first, in their order, then the vertices.  A section leads to
the vertex at its end; a vertex leads to the sections that begin there.  A car draws which of them
it takes as it enters the vertex; without U-turns none leads back to where it came from.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from ethogram.core.errors import InvalidSettings, UnknownName, shown

Name = Literal["grid_oneway", "grid_twoway"]

SIDE = 3  # vertices along each side of the grids
# of the 78 orientations of the grid without source or sink, the most even one
ONE_WAY = (
    *((0, 1), (1, 2), (2, 5), (5, 8), (8, 7), (7, 6), (6, 3), (3, 0)),  # a clockwise ring
    *((1, 4), (7, 4), (4, 3), (4, 5)),  # into the centre, and out of it
)


class Section(NamedTuple):
    """A one-way road from one vertex to another."""

    length: float  # m
    lanes: int
    start: int  # vertex, counted from 0
    end: int


class Tables(NamedTuple):
    """The graph as arrays; elements that there are not are `elements`, one beyond the last."""

    lanes: np.ndarray  # w(p), Int[element]; 1 in vertices
    following: np.ndarray  # n(p), Int[element, choice]
    preceding: np.ndarray  # the elements that lead to each, Int[element, choice]
    end: np.ndarray  # the vertex that a section leads to, Int[element]; of vertices nothing
    exits: np.ndarray  # where those can go on who come out of a section, Int[element, choice]
    choices: np.ndarray  # how many of these there are, Int[element]; 1 for vertices


@dataclass(frozen=True)
class Graph:
    """Sections between vertices, such that every section can be reached from every other.

    Raises:
        InvalidSettings: a section has no length or no lane, a section is a dead end, or a vertex
            or a section cannot be reached.

    """

    sections: tuple[Section, ...]
    u_turns: bool = False  # whether cars may go back where they come from
    places: tuple[tuple[float, float], ...] = field(default=(), compare=False)  # of vertices, m

    def __post_init__(self) -> None:
        """Check the sections."""
        for number, section in enumerate(self.sections):
            _check_section(number, section)
        self._check_vertices()
        self._check_ways()

    @cached_property
    def vertices(self) -> int:
        """|I|, how many vertices there are."""
        return 1 + max(max(section.start, section.end) for section in self.sections)

    @property
    def elements(self) -> int:
        """|S| + |I|."""
        return len(self.sections) + self.vertices

    @property
    def max_lanes(self) -> int:
        """The most lanes that a section has."""
        return max(section.lanes for section in self.sections)

    @cached_property
    def onward(self) -> tuple[tuple[int, ...], ...]:
        """Of each section, the sections that can be taken at its end."""
        return tuple(
            tuple(
                number
                for number, after in enumerate(self.sections)
                if after.start == before.end and (self.u_turns or after.end != before.start)
            )
            for before in self.sections
        )

    @cached_property
    def tables(self) -> Tables:
        """The graph as arrays."""
        count, sections = self.elements, self.sections
        leads = [[len(sections) + section.end] for section in sections] + [
            [number for number, section in enumerate(sections) if section.start == vertex]
            for vertex in range(self.vertices)
        ]
        led = [[p for p in range(count) if q in leads[p]] for q in range(count)]
        exits = [*self.onward, *[(0,)] * self.vertices]
        return Tables(
            lanes=np.array([*(section.lanes for section in sections), *[1] * self.vertices]),
            following=_padded(leads, count),
            preceding=_padded(led, count),
            end=np.array([each[0] for each in leads[: len(sections)]] + [0] * self.vertices),
            exits=_padded(exits, count),
            choices=np.array([len(each) for each in exits]),
        )

    def _check_vertices(self) -> None:
        known = {vertex for section in self.sections for vertex in (section.start, section.end)}
        for vertex in range(self.vertices):
            if vertex not in known:
                raise InvalidSettings(
                    f"Graph: no section begins or ends at vertex {vertex}; allowed: vertices "
                    "counted from 0 without gaps."
                )
        if self.places and len(self.places) != self.vertices:
            raise InvalidSettings(
                f"Graph: {len(self.places)} places of {self.vertices} vertices; allowed: one each."
            )

    def _check_ways(self) -> None:
        back: list[list[int]] = [[] for _ in self.sections]
        for number, onward in enumerate(self.onward):
            if not onward:
                turn = "" if self.u_turns else " but back (u_turns=True allows that)"
                raise InvalidSettings(
                    f"Graph: section {number} ({_named(self.sections[number])}) is a dead end: "
                    f"nothing leads on from vertex {self.sections[number].end}{turn}."
                )
            for after in onward:
                back[after].append(number)
        for ways, lost in ((self.onward, "cannot be reached from"), (back, "does not lead to")):
            for number in sorted(set(range(len(ways))) - _reached(ways)):
                raise InvalidSettings(
                    f"Graph: section {number} ({_named(self.sections[number])}) {lost} section 0 "
                    f"({_named(self.sections[0])}); allowed: every section leads to every other."
                )


def grid_oneway(length: float = 100.0, lanes: int = 2) -> Graph:
    """Figure 4.3: a main crossing, four three-way intersections, four turns, 12 sections."""
    return _grid(ONE_WAY, length, lanes)


def grid_twoway(length: float = 100.0, lanes: int = 2) -> Graph:
    """The same roads in both directions: 24 sections, no U-turns."""
    return _grid((*ONE_WAY, *((end, start) for start, end in ONE_WAY)), length, lanes)


def as_graph(given: Any) -> Graph:
    """A graph by name, or of sections (length, lanes, from, to), or as it is.

    Raises:
        UnknownName: no graph has the name.
        InvalidSettings: it is none of these, or a graph that cars cannot drive on for ever.

    """
    if isinstance(given, Graph):
        return given
    if isinstance(given, str):
        if given not in GRAPHS:
            raise UnknownName("graph", given, GRAPHS)
        return _by_name(given)
    return Graph(_as_sections(given))


@cache
def _by_name(name: str) -> Graph:
    return GRAPHS[name]()


def _grid(ways: Iterable[tuple[int, int]], length: float, lanes: int) -> Graph:
    spots = [(length * (v % SIDE), -length * (v // SIDE)) for v in range(SIDE**2)]
    return Graph(tuple(Section(length, lanes, *way) for way in ways), places=tuple(spots))


def _as_sections(given: Any) -> tuple[Section, ...]:
    try:
        sections = tuple(Section(*each) for each in given)
    except TypeError:
        sections = ()
    if not sections:
        raise InvalidSettings(
            f"Graph: sections = {shown(given)}; allowed: one or more of (length, lanes, from, to)."
        )
    return sections


def _check_section(number: int, section: Section) -> None:
    length, lanes, *ends = section
    wrong = ""
    if not isinstance(length, int | float) or not (0 < length < float("inf")):
        wrong = f"length {shown(length)}; allowed: metres, above 0"
    elif not isinstance(lanes, int) or lanes < 1:
        wrong = f"{shown(lanes)} lanes; allowed: a whole number, 1 or more"
    elif not all(isinstance(end, int) and end >= 0 for end in ends) or ends[0] == ends[1]:
        wrong = f"ends {shown(ends)}; allowed: two vertices, counted from 0"
    if wrong:
        raise InvalidSettings(f"Graph: section {number} has {wrong}.")


def _named(section: Section) -> str:
    return f"{section.start}>{section.end}"


def _reached(ways: Any) -> set[int]:
    """What can be reached from section 0."""
    found, front = {0}, [0]
    while front:
        new = set(ways[front.pop()]) - found
        found |= new
        front += new
    return found


def _padded(rows: Any, filler: int) -> np.ndarray:
    width = max(map(len, rows))
    return np.array([[*row, *[filler] * (width - len(row))] for row in rows])


GRAPHS: Mapping[str, Any] = {"grid_oneway": grid_oneway, "grid_twoway": grid_twoway}
