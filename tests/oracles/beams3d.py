"""A soft body, one bond and one voxel after the other: loops and NumPy, no batches.

The equations are those of Hiller and Lipson (2014) as the thesis' simulator has them, with its
numbers.
"""

import math
from itertools import combinations

import numpy as np

EDGE, MASS, YOUNG, SHEAR = 0.01, 1.0, 5e6, 5e6 / 2.7
INERTIA, FIRST = MASS * EDGE**2 / 6, MASS * EDGE / 2
STATIC, DYNAMIC, BOND, FLOOR, GLOBAL = 1.0, 0.5, 1.0, 0.8, 0.01
A1, B1, B2, B3, A2 = (
    YOUNG * EDGE,
    YOUNG * EDGE,
    YOUNG * EDGE**2 / 2,
    YOUNG * EDGE**3 / 6,
    SHEAR * EDGE**3 / 6,
)
CRITICAL = 2 * math.sqrt(MASS * YOUNG * EDGE)
SPIN = 10 * GLOBAL * 2 * math.sqrt(INERTIA * YOUNG * EDGE**3) / INERTIA
TIME = 0.2 / (2 * 3.1415926 * math.sqrt(YOUNG * EDGE / MASS))
SMALL = 0.01732


class Body:
    """Its state, and a step of it."""

    def __init__(self, cells):
        self.position = [EDGE * (np.array(cell) + 0.5) for cell in cells]
        self.orientation = [np.array([1.0, 0.0, 0.0, 0.0]) for _ in cells]
        self.momentum = [np.zeros(3) for _ in cells]
        self.spin = [np.zeros(3) for _ in cells]
        places = [tuple(map(int, cell)) for cell in cells]
        self.bonds = [
            (one, two, axis)
            for axis in range(3)
            for one, cell in enumerate(places)
            for two, other in enumerate(places)
            if other == tuple(c + (a == axis) for a, c in enumerate(cell))
        ]
        self.small = [True] * len(self.bonds)
        self.last = [(np.zeros(3),) * 3] * len(self.bonds)  # d, th1, th2 of the step before
        self.started = False
        self.pairs = far_apart(len(places), self.bonds)

    def step(self, edges, gravity):
        """Command edges (m) for one step under a gravity (m/s^2)."""
        forces = [np.zeros(3) for _ in edges]
        torques = [np.zeros(3) for _ in edges]
        for number, (one, two, axis) in enumerate(self.bonds):
            force, moment1, moment2 = self.pull(number, one, two, axis, edges)
            forces[one] += force
            forces[two] -= force
            torques[one] -= moment1
            torques[two] -= moment2
        for one, two in self.pairs:
            offset = self.position[two] - self.position[one]
            distance, reach = np.linalg.norm(offset), 0.75 * (edges[one] + edges[two])
            if distance < reach:
                push = A1 * (reach - distance) * offset / distance
                forces[one] -= push
                forces[two] += push
        for voxel, edge in enumerate(edges):
            self.move(voxel, edge, forces[voxel] + MASS * np.asarray(gravity), torques[voxel])
        self.started = True

    def pull(self, number, one, two, axis, edges):
        """Force on the bond's first voxel, and the two moments."""
        rest = (edges[one] + edges[two]) / 2
        offset = to_x(axis, self.position[two] - self.position[one])
        q1, q2 = (
            np.array([q[0], *to_x(axis, q[1:])])
            for q in (self.orientation[one], self.orientation[two])
        )
        seen = turn(conjugate(q1), offset)
        bend = product(conjugate(q1), q2)
        sideways, extension = (abs(seen[1]) + abs(seen[2])) / seen[0], seen[0] / rest
        before = self.small[number]
        if before:
            small = not (
                bend[0] <= math.cos(1.1 * SMALL / 2) or sideways > 0.055 or extension > 1.43
            )
        else:
            small = bend[0] > math.cos(SMALL / 2) and sideways < 0.05 and extension < 1.30
        if small:
            frame = conjugate(q1)
            d = np.array([seen[0] - rest, seen[1], seen[2]])
            th1, th2 = np.zeros(3), rotation_vector(bend)
        else:
            aligned = align(seen)
            frame = product(aligned, conjugate(q1))
            d = np.array([np.linalg.norm(offset) - rest, 0.0, 0.0])
            th1, th2 = rotation_vector(aligned), rotation_vector(product(frame, q2))
        th = th1 + th2
        force = np.array([A1 * d[0], B1 * d[1] - B2 * th[2], B1 * d[2] + B2 * th[1]])
        moment1, moment2 = (
            np.array(
                [
                    A2 * (own[0] - other[0]),
                    B2 * d[2] + B3 * (2 * own[1] + other[1]),
                    -B2 * d[1] + B3 * (2 * own[2] + other[2]),
                ]
            )
            for own, other in ((th1, th2), (th2, th1))
        )
        if small == before:
            if self.started:
                rates = [
                    (now - then) / TIME
                    for now, then in zip((d, th1, th2), self.last[number], strict=True)
                ]
                damped = damping(*rates)
                force, moment1, moment2 = (
                    force + damped[0],
                    moment1 + damped[1],
                    moment2 + damped[2],
                )
            self.last[number] = d, th1, th2
        self.small[number] = small
        back = conjugate(frame)
        return [from_x(axis, turn(back, part)) for part in (force, moment1, moment2)]

    def move(self, voxel, edge, force, torque):
        """Drag, the floor, then momenta, then the place."""
        momentum = self.momentum[voxel]
        force = force - GLOBAL * CRITICAL * momentum / MASS
        depth = edge / 2 - self.position[voxel][2]
        if depth > 0:
            normal = 2 * YOUNG * EDGE * depth
            force[2] += normal - FLOOR * CRITICAL * momentum[2] / MASS
            sideways = np.linalg.norm(momentum[:2])
            if sideways == 0:
                if np.linalg.norm(force[:2]) < STATIC * normal:
                    force[:2] = 0
            elif DYNAMIC * normal * TIME < sideways:
                force[:2] -= DYNAMIC * normal * momentum[:2] / sideways
            else:
                force[:2], momentum[:2] = 0, 0
        self.momentum[voxel] = momentum = momentum + force * TIME
        self.position[voxel] = self.position[voxel] + momentum * TIME / MASS
        self.spin[voxel] = (self.spin[voxel] + torque * TIME) * (1 - SPIN * TIME)
        q = self.orientation[voxel]
        rate = product(np.array([0.0, *(self.spin[voxel] / INERTIA)]), q)
        q = q + TIME / 2 * rate
        self.orientation[voxel] = q / np.linalg.norm(q)


def damping(u, w1, w2):
    """What damps the force and the two moments."""
    ca, cb, cc, ct, cd = (
        2 * math.sqrt(k * m)
        for k, m in ((A1, MASS), (B1, MASS), (B2, FIRST), (A2, INERTIA), (B3, INERTIA))
    )
    z, w = BOND / 2, w1 + w2
    return (
        z * np.array([ca * u[0], cb * u[1] - cc * w[2], cb * u[2] + cc * w[1]]),
        *(
            z
            / 2
            * np.array(
                [
                    ct * (own[0] - other[0]),
                    cc * u[2] + cd * (2 * own[1] + other[1]),
                    -cc * u[1] + cd * (2 * own[2] + other[2]),
                ]
            )
            for own, other in ((w1, w2), (w2, w1))
        ),
    )


def far_apart(voxels, bonds):
    """Pairs of surface voxels more than three bonds apart along the shortest path."""
    reach = np.full((voxels, voxels), np.inf)
    np.fill_diagonal(reach, 0)
    count = [0] * voxels
    for one, two, _ in bonds:
        reach[one, two] = reach[two, one] = 1
        count[one] += 1
        count[two] += 1
    for through in range(voxels):
        reach = np.minimum(reach, reach[:, through, None] + reach[through])
    return [
        (one, two)
        for one, two in combinations(range(voxels), 2)
        if reach[one, two] > 3 and count[one] < 6 and count[two] < 6
    ]


def to_x(axis, v):
    return np.array([(v[0], v[1], v[2]), (v[1], -v[0], v[2]), (v[2], v[1], -v[0])][axis])


def from_x(axis, v):
    return np.array([(v[0], v[1], v[2]), (-v[1], v[0], v[2]), (-v[2], v[1], v[0])][axis])


def conjugate(q):
    return np.array([q[0], -q[1], -q[2], -q[3]])


def product(p, q):
    w = p[0] * q[0] - np.dot(p[1:], q[1:])
    return np.array([w, *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])


def turn(q, v):
    return product(product(q, np.array([0.0, *v])), conjugate(q))[1:]


def rotation_vector(q):
    s = 1 - q[0] ** 2
    if s <= 0:
        return np.zeros(3)
    if s < 1 - 0.9988**2:
        return q[1:] * 2 * math.sqrt((2 - 2 * q[0]) / s)
    return q[1:] * 2 * math.acos(min(q[0], 1.0)) / math.sqrt(s)


def align(v):
    if abs(v[1] / v[0]) < SMALL and abs(v[2] / v[0]) < SMALL:
        y, z = v[2] / (2 * v[0]), -v[1] / (2 * v[0])
        return np.array([1 - (y * y + z * z) / 2, 0.0, y, z])
    n = v / np.linalg.norm(v)
    angle = math.acos(n[0])
    if angle > math.pi - 1e-7:
        return np.array([0.0, 0.0, 1.0, 0.0])
    k = math.sin(angle / 2) / math.hypot(n[1], n[2])
    return np.array([math.cos(angle / 2), 0.0, n[2] * k, -n[1] * k])
