"""A soft body in the plane by sequential impulses: loops over springs and contacts, in NumPy.

Impulses of every spring are accumulated, as in the thesis' simulator; nothing is solved by blocks.
"""

import math
from itertools import combinations

import numpy as np

EDGE, SIDE, MASS, DRAG, TIME = 3.0, 0.9, 0.2025, 1.0, 1 / 60
INERTIA = MASS * 2 * SIDE**2 / 12
CORNERS = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
FRICTION = math.sqrt(20)
RESTITUTION, SLOP = 0.1, 0.005


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


class Body:
    """Rigid bodies, springs between them, and level ground at y = 0."""

    def __init__(self, cells, *, default, place=(0.0, 0.0), gravity=0.0, ground=False):
        self.frequency = 8.0 if default else 5.0
        self.gravity, self.ground = gravity, ground
        owner = self._welded(cells)
        parts = sorted(set(owner.values()))
        self.where, self.square = [], {}
        for part in parts:
            members = [square for square, of in owner.items() if of == part]
            centres = {square: self._centre(cells, square) for square in members}
            middle = np.mean(list(centres.values()), axis=0)
            number = len(self.where)
            for square, centre in centres.items():
                self.square[square] = (number, centre - middle)
            mass = MASS * len(members)
            inertia = sum(INERTIA + MASS * ((c - middle) ** 2).sum() for c in centres.values())
            self.where.append([middle + np.array(place), 0.0, mass, inertia])
        self.velocity = [np.zeros(3) for _ in parts]
        self.springs = [
            (voxel, *spring) for voxel in range(len(cells)) for spring in _springs(default)
        ]
        self.impulse = [0.0] * len(self.springs)
        self.pushes = {}

    @staticmethod
    def _centre(cells, square):
        voxel, corner = square
        middle = EDGE * (np.array(cells[voxel]) + 0.5)
        return middle + (EDGE - SIDE) / 2 * np.array(CORNERS[corner])

    def _welded(self, cells):
        """The rigid body that each square is part of, by the smallest of its squares."""
        squares = [(voxel, corner) for voxel in range(len(cells)) for corner in range(4)]
        owner = {square: square for square in squares}
        for one, other in combinations(squares, 2):
            beside = sum(map(abs, np.subtract(cells[one[0]], cells[other[0]]))) == 1
            apart = self._centre(cells, one) - self._centre(cells, other)
            if beside and abs(np.linalg.norm(apart) - SIDE) < 1e-9:
                low, high = sorted([owner[one], owner[other]])
                owner = {square: low if of == high else of for square, of in owner.items()}
        return owner

    def _row(self, number, lever, direction):
        _, _, mass, inertia = self.where[number]
        row = np.array([*direction, cross(lever, direction)])
        return row, row / np.array([mass, mass, inertia])

    def _lever(self, square, local=(0.0, 0.0)):
        number, offset = self.square[square]
        angle = self.where[number][1]
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        return number, turn @ (offset + np.array(local)), turn @ np.array(local)

    def step(self, control, *, sweeps=10):
        for velocity in self.velocity:
            velocity[1] -= self.gravity * TIME
            velocity *= 1 - TIME * DRAG
        contacts = self._contacts()
        springs = [self._spring(*spring, control) for spring in self.springs]
        for number, spring in enumerate(springs):
            self._apply(spring, self.impulse[number])
        for contact in contacts:
            self._push(contact, *self.pushes[contact["key"]])
        for _ in range(sweeps):
            for number, spring in enumerate(springs):
                speed = sum(row @ self.velocity[body] for body, row, _ in spring["ends"])
                gamma, bias = spring["gamma"], spring["bias"]
                more = -(speed + bias + gamma * self.impulse[number]) / (spring["softness"] + gamma)
                self.impulse[number] += more
                self._apply(spring, more)
            for contact in contacts:
                self._resolve(contact)
        for body, velocity in enumerate(self.velocity):
            self.where[body][0] = self.where[body][0] + TIME * velocity[:2]
            self.where[body][1] += TIME * velocity[2]
        for _ in range(10):
            for contact in contacts:
                self._lift(contact)

    def _spring(self, voxel, first, second, at_first, at_second, length, control):
        u = control[voxel]
        one, r1, arm1 = self._lever((voxel, first), at_first)
        other, r2, arm2 = self._lever((voxel, second), at_second)
        apart = self.where[other][0] + r2 - self.where[one][0] - r1
        distance = np.linalg.norm(apart)
        n = apart / distance
        towards = math.sqrt(0.75) if u >= 0 else math.sqrt(1.25)
        target = length(EDGE) + abs(u) * (length(EDGE * towards) - length(EDGE))
        reduced = 1 / (2 / MASS + (cross(arm1, n) ** 2 + cross(arm2, n) ** 2) / INERTIA)
        omega = 2 * math.pi * self.frequency
        k, d = reduced * omega**2, 2 * reduced * 0.3 * omega
        gamma = 1 / (TIME * (d + TIME * k))
        ends = [(one, *self._row(one, r1, -n)), (other, *self._row(other, r2, n))]
        return {
            "ends": ends,
            "softness": sum(row @ response for _, row, response in ends),
            "gamma": gamma,
            "bias": (distance - target) * TIME * k * gamma,
        }

    def _apply(self, spring, impulse):
        for body, _, response in spring["ends"]:
            self.velocity[body] += impulse * response

    def _contacts(self):
        found, pushes = [], {}
        for square in self.square if self.ground else ():
            for corner in CORNERS:
                body, lever, _ = self._lever(square, SIDE / 2 * np.array(corner))
                if self.where[body][0][1] + lever[1] >= 0:
                    continue
                along, across = (self._row(body, lever, d) for d in ((0.0, 1.0), (1.0, 0.0)))
                speed = along[0] @ self.velocity[body]
                rebound = -RESTITUTION * speed if speed < -1 else 0.0
                key = square, corner
                found.append(
                    {"key": key, "body": body, "along": along, "across": across, "to": rebound}
                )
                pushes[key] = self.pushes.get(key, (0.0, 0.0))
        self.pushes = pushes
        return found

    def _push(self, contact, along, across):
        change = along * contact["along"][1] + across * contact["across"][1]
        self.velocity[contact["body"]] += change

    def _resolve(self, contact):
        pushing, dragging = self.pushes[contact["key"]]
        row, response = contact["across"]
        limit = FRICTION * pushing
        slip = row @ self.velocity[contact["body"]]
        after = min(max(dragging - slip / (row @ response), -limit), limit)
        self._push(contact, 0.0, after - dragging)
        row, response = contact["along"]
        lacking = contact["to"] - row @ self.velocity[contact["body"]]
        lifted = max(pushing + lacking / (row @ response), 0.0)
        self._push(contact, lifted - pushing, 0.0)
        self.pushes[contact["key"]] = lifted, after

    def _lift(self, contact):
        square, corner = contact["key"]
        body, lever, _ = self._lever(square, SIDE / 2 * np.array(corner))
        depth = -(self.where[body][0][1] + lever[1])
        row, response = self._row(body, lever, (0.0, 1.0))
        push = min(max(0.2 * (depth - SLOP), 0.0), 0.2) / (row @ response)
        self.where[body][0] = self.where[body][0] + push * response[:2]
        self.where[body][1] += push * response[2]

    def area(self, voxel):
        corners = []
        for corner, sign in enumerate(CORNERS):
            body, lever, _ = self._lever((voxel, corner), SIDE / 2 * np.array(sign))
            corners.append(self.where[body][0] + lever)
        around = zip(corners, corners[1:] + corners[:1], strict=True)
        return sum(cross(a, b) for a, b in around) / 2 / EDGE**2

    def middle(self, voxel):
        """The mean of the centres of a voxel's squares."""
        places = [self._lever((voxel, corner)) for corner in range(4)]
        return np.mean([self.where[body][0] + lever for body, lever, _ in places], axis=0)


def _springs(default):
    """Squares, anchors on them, and the length that an edge asks for."""

    def side(x):
        return x - 2 * SIDE

    def crossed(x):
        return math.hypot(SIDE, x - 2 * SIDE)

    def diagonal(x):
        return (x - SIDE) * math.sqrt(2)

    half = SIDE / 2
    found = []
    for first, second in ((0, 1), (3, 2), (0, 3), (1, 2)):
        axis = 0 if CORNERS[first][0] != CORNERS[second][0] else 1
        out = CORNERS[first][1 - axis]

        def anchor(towards, beside, axis=axis):
            return np.roll([towards * half, beside * half], axis)

        kinds = [(out, out, side)]
        if default:
            kinds += [(-out, -out, side), (out, -out, crossed), (-out, out, crossed)]
        found += [(first, second, anchor(1, a), anchor(-1, b), length) for a, b, length in kinds]
    centre = np.zeros(2)
    return [*found, (0, 2, centre, centre, diagonal), (1, 3, centre, centre, diagonal)]
