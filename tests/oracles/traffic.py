"""The traffic world car by car, from the equations of chapter 4: lists, loops, dictionaries."""

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Car:
    p: int
    x: float
    y: int
    v: float
    exit: int
    dead: int = 0  # steps left
    impact: int = 0
    spared_by: tuple = ()
    present: bool = True

    @property
    def alive(self):
        return self.present and self.dead == 0


@dataclass
class Traffic:
    sections: list  # (length, lanes, from, to)
    cars: list
    dt: float = 0.2
    v_max: float = 50.0
    a_max: float = 2.0
    l_car: float = 7.0
    d_view: float = 50.0
    vertex: float = 10.0
    a_coll: float = 5.0
    t_coll: int = 10
    t_dead: int = 20
    removed: bool = False
    transition: str = "new_speed"
    collision: str = "lanes"
    impact: bool = True
    revive: str = "spared"
    braking: str = "distance"
    fine_dead: bool = False
    weights: tuple = (1.0, 1.0, 1.0)
    died: list = field(default_factory=list)

    def length(self, p):
        return self.sections[p][0] if self.is_section(p) else self.vertex

    def width(self, p):
        return self.sections[p][1] if self.is_section(p) else 1

    def is_section(self, p):
        return p < len(self.sections)

    def n(self, p):
        if self.is_section(p):
            return [len(self.sections) + self.sections[p][3]]
        vertex = p - len(self.sections)
        return [s for s, section in enumerate(self.sections) if section[2] == vertex]

    def ways(self, section):
        """Where a car can go at the end of a section: no U-turns."""
        came_from = self.sections[section][2]
        return [s for s in self.n(self.n(section)[0]) if self.sections[s][3] != came_from]

    def stop(self, car):
        return self.length(car.p) - car.x

    def step(self, actions, words):
        were_alive = [car.alive for car in self.cars]
        for car, (ax, ay), word in zip(self.cars, actions, words, strict=True):
            if car.present:
                self.move(car, ax - 1, ay - 1, int(word))
        restored = [self.age(car) for car in self.cars]
        self.died = [False] * len(self.cars)
        touching = [self.touching(i) for i in range(len(self.cars))]
        for i, car in enumerate(self.cars):
            others = {j for j in touching[i] if j is not None}
            if restored[i] and self.revive == "spared":
                car.spared_by = others
            front, back = ([j for j in touching[i][k : k + 2] if j is not None] for k in (0, 2))
            front, back = (set(those) - set(car.spared_by) for those in (front, back))
            if were_alive[i] and (front or back):
                car.dead, car.impact = self.t_dead, -1 if front else 1
                self.died[i] = True
            car.spared_by = set(car.spared_by) & others

    def move(self, car, ax, ay, word):
        old = car.v
        if car.alive:
            car.v = min(self.v_max, max(old + ax * self.a_max * self.dt, 0.0))
        elif self.impact and car.dead > self.t_dead - self.t_coll:
            car.v = min(self.v_max, max(old + car.impact * self.a_coll * self.dt, 0.0))
        else:
            car.v = 0.0
        stop, advance = self.stop(car), car.v * self.dt
        decisive = old * self.dt if self.transition == "literal" else advance
        leaves = decisive > stop
        beyond = advance > stop if self.transition == "literal" else leaves
        car.x = advance - stop if beyond else car.x + advance
        left = car.p
        if leaves:
            car.p = car.exit
            if self.is_section(left):
                ways = self.ways(left)
                car.exit = ways[word * len(ways) // 2**32]
            else:
                car.exit = self.n(car.p)[0]
        lane_speed = ay if car.alive else 0
        car.y = min(self.width(car.p), max(car.y + lane_speed, 1))

    def age(self, car):
        """Whether the car is restored."""
        if not (car.present and car.dead > 0):
            return False
        car.dead -= 1
        if car.dead > 0:
            return False
        car.impact = 0
        car.present = not self.removed
        return car.present

    def touching(self, i):
        """Whom car i overlaps: in front in the lane and across a boundary, and so behind."""
        return (
            self.in_front(i),
            self.nearest(i, lambda me, other: self.leads(me, other) and self.stop(me) + other.x),
            next((j for j in range(len(self.cars)) if j != i and self.in_front(j) == i), None),
            self.nearest(i, lambda me, other: self.leads(other, me) and self.stop(other) + me.x),
        )

    def in_front(self, i):
        """The next car in the lane, if it is overlapped."""
        me = self.cars[i]
        ahead = [
            (other.x, j)
            for j, other in enumerate(self.cars)
            if me.present and other.present and other.p == me.p and (other.x, j) > (me.x, i)
            if self.collision == "literal" or me.y == other.y
        ]
        x, j = min(ahead, default=(np.inf, None))
        return j if x - me.x < self.l_car else None

    def nearest(self, i, distance):
        """The nearest car across a boundary, if it is overlapped."""
        me, found = self.cars[i], []
        for j, other in enumerate(self.cars):
            if j == i or not (me.present and other.present):
                continue
            between = distance(me, other)
            if between is not False and between < self.l_car:
                found.append((between, j))
        return min(found, default=(None, None))[1]

    def leads(self, car, other):
        if self.collision == "literal":
            return other.p in self.n(car.p)
        return other.p == car.exit

    def seen(self, car):
        """(delta_x, delta_v) of the lanes to the right, own, to the left."""
        distances, speeds = [], []
        for j in (-1, 0, 1):
            visible = []
            if 1 <= car.y + j <= self.width(car.p):
                for other in self.cars:
                    if other is car or not other.present:
                        continue
                    ahead = other.x - car.x
                    if other.p == car.p and 0 < ahead <= self.d_view and other.y == car.y + j:
                        visible.append((ahead, other.v))
                    if other.p in self.n(car.p) and self.stop(car) + other.x <= self.d_view:
                        visible.append((self.stop(car) + other.x, other.v))
            if visible:
                distance, v = min(visible)
                distances.append(distance)
                speeds.append(car.v - v)
            else:
                distances.append(self.d_view)
                speeds.append(self.v_max)
        return distances, speeds

    def seen_behind(self, car):
        """The same of the nearest cars behind: of its element, or about to come to it."""
        distances, speeds = [], []
        for j in (-1, 0, 1):
            visible = []
            if 1 <= car.y + j <= self.width(car.p):
                for other in self.cars:
                    if other is car or not other.present:
                        continue
                    back = car.x - other.x
                    if other.p == car.p and 0 < back <= self.d_view and other.y == car.y + j:
                        visible.append((back, other.v))
                    if other.exit == car.p and self.stop(other) + car.x <= self.d_view:
                        visible.append((self.stop(other) + car.x, other.v))
            distance, v = min(visible, default=(self.d_view, car.v - self.v_max))
            distances.append(distance)
            speeds.append(car.v - v)
        return distances, speeds

    def observations(self):
        rows = []
        for car in self.cars:
            distances, speeds = self.seen(car)
            own = [self.stop(car), car.y, car.v, car.dead == 0, self.is_section(car.p)]
            rows.append([*own, *distances, *speeds] if car.present else [0.0] * 11)
        return np.array(rows, float)

    def breaches(self):
        rows = []
        for car in self.cars:
            distances, _ = self.seen(car)
            square = car.v**2
            literal = self.braking == "literal"
            needed = 2 * self.a_max * square if literal else square / (2 * self.a_max)
            on_section = self.is_section(car.p)
            rows.append(
                [
                    (not on_section or self.stop(car) < 2 * self.l_car) and car.v > 10,
                    distances[1] - self.l_car < needed,
                    on_section and car.y > 1 and distances[0] == self.d_view,
                ]
                if car.alive or (self.fine_dead and car.present)
                else [False] * 3
            )
        return np.array(rows)

    def rewards(self):
        paid = [car.present if self.fine_dead else car.alive for car in self.cars]
        speed = np.array([car.v / self.v_max for car in self.cars])
        return np.where(paid, speed - self.breaches() @ np.array(self.weights), 0.0)
