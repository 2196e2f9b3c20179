"""Springs of a voxel: implicit, and for all between two squares one block of a matrix.

A spring of length l, target l*, between anchors at r_1 and r_2 from the centres of two rigid
bodies, along the unit vector n, has the Jacobian J = (-n, -r_1 x n, n, r_2 x n).  A soft distance
constraint with the reduced mass m_e of the two squares, frequency omega and damping ratio zeta asks
for J v + (l - l*) dt k gamma + gamma lambda = 0 with k = m_e omega^2 and
1 / gamma = m_e dt (2 zeta omega + dt omega^2).  Without lambda, over all springs, that is one
implicit Euler step of the velocities v,

    (M + sum J' J / gamma) v = M v_free - sum J' m_e dt omega^2 (l - l*).

So however many springs are between two squares, they make one symmetric block.  It is what sweeps
of sequential impulses over the springs converge to.

As in the original, m_e is that of the two squares, whatever rigid bodies they are welded to.
"""

from functools import cache
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from ethogram.physics.lattice2d.lattice import COLOURS, SIGNS
from ethogram.physics.lattice2d.material import Material
from ethogram.physics.lattice2d.squares import Squares, cross

PAIRS = ((0, 1), (2, 3), (0, 2), (1, 3), (0, 3), (1, 2))  # of squares: sides of a voxel, diagonals
SIDES = PAIRS[:4]
SHORTEST = 1e-9  # m: what keeps a direction finite


class Spring(NamedTuple):
    """A spring between two squares of a voxel that is not mirrored."""

    pair: int
    first: tuple[int, int]  # the anchor, as signs of a corner; (0, 0) is the centre
    second: tuple[int, int]
    kind: str  # of its length at rest


@cache
def springs(which: str) -> tuple[Spring, ...]:
    """The springs of a voxel (figure 6.1 of the thesis): "all" 18, or the 6 of the "outline"."""
    found = []
    for pair, (first, second) in enumerate(SIDES):
        axis = 0 if SIGNS[first][0] != SIGNS[second][0] else 1
        outward = int(SIGNS[first][1 - axis])

        def anchors(lateral: tuple[int, int], axis: int = axis) -> list[tuple[int, int]]:
            facing = (1, -1)
            both = list(zip(facing, lateral, strict=True))
            return [(a, b) if axis == 0 else (b, a) for a, b in both]

        found.append(Spring(pair, *anchors((outward, outward)), "side"))
        if which == "all":
            found.append(Spring(pair, *anchors((-outward, -outward)), "side"))
            found.append(Spring(pair, *anchors((outward, -outward)), "crossed"))
            found.append(Spring(pair, *anchors((-outward, outward)), "crossed"))
    centre = (0, 0)
    found += [Spring(pair, centre, centre, "diagonal") for pair in (4, 5)]
    return tuple(found)


def lengths(material: Material) -> dict[str, Float[Array, "3"]]:
    """Length of each kind of spring in a voxel that is contracted, at rest, expanded, m."""
    edges, side = material.edges, material.square
    gap = edges - 2 * side
    return {
        "side": gap,
        "crossed": jnp.sqrt(side**2 + gap**2),
        "diagonal": (edges - side) * jnp.sqrt(2.0),
    }


def target(
    lengths: Float[Array, "3"], control: Float[Array, "voxel *batch"]
) -> Float[Array, "voxel *batch"]:
    """Length that a control in [-1, 1] asks for: contracted at 1, expanded at -1, m."""
    contracted, resting, expanded = lengths
    towards = jnp.where(control >= 0, contracted - resting, resting - expanded)
    return resting + control * towards


class Pair(NamedTuple):
    """Sums over the springs between two squares: k = 1 / gamma, e = m_e dt omega^2 (l - l*)."""

    linear: Float[Array, "3 voxel *batch"]  # k n n': xx, xy, yy (kg)
    first: Float[Array, "2 voxel *batch"]  # k n (r_1 x n) (kg m)
    second: Float[Array, "2 voxel *batch"]  # k n (r_2 x n)
    angular: Float[Array, "3 voxel *batch"]  # k (r_i x n) (r_j x n): 11, 12, 22 (kg m^2)
    pull: Float[Array, "4 voxel *batch"]  # e n, e (r_1 x n), e (r_2 x n) (N s, N m s)


class Blocks(NamedTuple):
    """The matrix of all springs, and the impulses that they begin with."""

    pairs: tuple[Pair, ...]  # in the order of `PAIRS`
    diagonal: Float[Array, "6 colour voxel *batch"]  # of each square: xx, xy, yy, xw, yw, ww
    impulse: Float[Array, "3 colour voxel *batch"]  # on each square (N s, N m s)


def blocks(material: Material, at: Squares, control: Float[Array, "voxel *batch"]) -> Blocks:
    """The springs of all voxels, with the squares where they are.

    Args:
        material: of the voxels.
        at: the squares.
        control: of each voxel, in [-1, 1].

    """
    length = lengths(material)
    targets = {kind: target(length[kind], control) for kind in length}
    by_pair: list[list[Pair]] = [[] for _ in PAIRS]
    for spring in springs(material.springs):
        by_pair[spring.pair].append(_pulled(material, at, spring, targets[spring.kind]))
    pairs = tuple(jax.tree.map(lambda *terms: sum(terms[1:], terms[0]), *each) for each in by_pair)
    diagonal, impulse = [[0.0] * COLOURS for _ in range(2)]
    for (first, second), of in zip(PAIRS, pairs, strict=True):
        diagonal[first] += jnp.concatenate([of.linear, of.first, of.angular[:1]])
        diagonal[second] += jnp.concatenate([of.linear, of.second, of.angular[2:]])
        impulse[first] += of.pull[:3]
        impulse[second] -= jnp.concatenate([of.pull[:2], of.pull[3:]])
    return Blocks(pairs, jnp.stack(diagonal, 1), jnp.stack(impulse, 1))


def _pulled(material: Material, at: Squares, spring: Spring, target: Array) -> Pair:
    """One spring of all voxels."""
    first, second = PAIRS[spring.pair]
    arm_1, arm_2 = at.corner(first, spring.first), at.corner(second, spring.second)
    r_1 = [lever + arm for lever, arm in zip(at.lever[:, first], arm_1, strict=True)]
    r_2 = [lever + arm for lever, arm in zip(at.lever[:, second], arm_2, strict=True)]
    apart = [
        between + (b - a)
        for between, a, b in zip(at.between(first, second), arm_1, arm_2, strict=True)
    ]
    length = jnp.maximum(jnp.sqrt(apart[0] ** 2 + apart[1] ** 2), SHORTEST)
    n = apart[0] / length, apart[1] / length
    turn_1, turn_2 = cross(r_1, n), cross(r_2, n)
    mass, moment = material.square_mass, material.square_inertia
    reduced = 1 / (2 / mass + (cross(arm_1, n) ** 2 + cross(arm_2, n) ** 2) / moment)  # m_e
    k = reduced * material.spring_inertia
    e = reduced * material.spring_pull * (length - target)
    (x, y), (kx, ky) = n, (k * n[0], k * n[1])
    return Pair(
        linear=jnp.stack([kx * x, kx * y, ky * y]),
        first=jnp.stack([kx * turn_1, ky * turn_1]),
        second=jnp.stack([kx * turn_2, ky * turn_2]),
        angular=jnp.stack([k * turn_1**2, k * turn_1 * turn_2, k * turn_2**2]),
        pull=jnp.stack([e * x, e * y, e * turn_1, e * turn_2]),
    )


def impulse_on(
    colour: int, springs: Blocks, velocity: list[Float[Array, "3 voxel *batch"]]
) -> Float[Array, "3 voxel *batch"]:
    """What the springs of each voxel do to its square of a colour because the others move.

    Args:
        colour: of the square.
        springs: of all voxels.
        velocity: of the voxels' squares, by colour.

    """
    total = jnp.zeros_like(velocity[colour])
    for (first, second), of in zip(PAIRS, springs.pairs, strict=True):
        xx, xy, yy = of.linear
        if colour == first:
            (vx, vy, w), mine, its = velocity[second], of.first, of.second
        elif colour == second:
            (vx, vy, w), mine, its = velocity[first], of.second, of.first
        else:
            continue
        total += jnp.stack(
            [
                xx * vx + xy * vy + its[0] * w,
                xy * vx + yy * vy + its[1] * w,
                mine[0] * vx + mine[1] * vy + of.angular[1] * w,
            ]
        )
    return total
