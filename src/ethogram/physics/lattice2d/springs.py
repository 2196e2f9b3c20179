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
from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float

from ethogram.physics.lattice2d.lattice import COLOURS, SIGNS
from ethogram.physics.lattice2d.material import Material
from ethogram.physics.lattice2d.squares import Squares, cross

PAIRS = ((0, 1), (2, 3), (0, 2), (1, 3), (0, 3), (1, 2))  # of squares: sides of a voxel, diagonals
SIDES, DIAGONALS = PAIRS[:4], PAIRS[4:]
SHORTEST = 1e-9  # m: what keeps a direction finite


class Spring(NamedTuple):
    """A spring between two squares of a voxel that is not mirrored."""

    pair: int
    first: tuple[int, int]  # the anchor, as signs of a corner; (0, 0) is the centre
    second: tuple[int, int]
    kind: str  # of its length at rest


@cache
def springs(which: str) -> tuple[Spring, ...]:
    """The springs of a voxel (thesis, figure 6.1): "all" 18, or the 6 of the "outline".

    Those between two squares on a side join a facing corner of each: outer corners, which lie on
    the outline, inner ones, or one of each.
    """
    outer, inner = 1, -1
    kinds = [(outer, outer, "side")]
    if which == "all":
        kinds += [(inner, inner, "side"), (outer, inner, "crossed"), (inner, outer, "crossed")]
    found = []
    for pair, (first, second) in enumerate(SIDES):
        is_level = SIGNS[first][0] != SIGNS[second][0]  # along x
        outward = int(SIGNS[first][1 if is_level else 0])
        for one, other, kind in kinds:
            anchors = (1, one * outward), (-1, other * outward)  # along the side, across it
            a, b = anchors if is_level else (anchors[0][::-1], anchors[1][::-1])
            found.append(Spring(pair, a, b, kind))
    centre = (0, 0)
    found += [Spring(PAIRS.index(pair), centre, centre, "diagonal") for pair in DIAGONALS]
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


class Blocks(NamedTuple):
    """Sums over the springs between two squares; k = 1 / gamma, e = m_e dt omega^2 (l - l*).

    Pairs of squares are in the order of `PAIRS`.
    """

    linear: Float[Array, "3 pair voxel *batch"]  # k n n': xx, xy, yy (kg)
    first: Float[Array, "2 pair voxel *batch"]  # k n (r_1 x n) (kg m)
    second: Float[Array, "2 pair voxel *batch"]  # k n (r_2 x n)
    angular: Float[Array, "3 pair voxel *batch"]  # k (r_i x n) (r_j x n): 11, 12, 22 (kg m^2)
    pull: Float[Array, "4 pair voxel *batch"]  # e n, e (r_1 x n), e (r_2 x n) (N s, N m s)


def blocks(material: Material, at: Squares, control: Float[Array, "voxel *batch"]) -> Blocks:
    """The springs of all voxels, with the squares where they are.

    Args:
        material: of the voxels.
        at: the squares.
        control: of each voxel, in [-1, 1].

    """
    listed = springs(material.springs)
    length_of = lengths(material)
    targets = {kind: target(length_of[kind], control) for kind in length_of}
    first, second = zip(*(PAIRS[spring.pair] for spring in listed), strict=True)
    arm_1 = at.corners(first, [spring.first for spring in listed])
    arm_2 = at.corners(second, [spring.second for spring in listed])
    r_1, r_2 = (at.levers(ends) + arm for ends, arm in ((first, arm_1), (second, arm_2)))
    apart = at.between(first, second) + (arm_2 - arm_1)
    length = jnp.maximum(jnp.sqrt((apart**2).sum(0)), SHORTEST)
    n = apart / length
    turn_1, turn_2 = cross(r_1, n), cross(r_2, n)
    mass, moment = material.square_mass, material.square_inertia
    reduced = 1 / (2 / mass + (cross(arm_1, n) ** 2 + cross(arm_2, n) ** 2) / moment)  # m_e
    k = reduced * material.spring_inertia
    stretch = length - jnp.stack([targets[spring.kind] for spring in listed])
    e = reduced * material.spring_pull * stretch
    # all that follows reads these, and would compute them again and again
    n, turn_1, turn_2, k, e = lax.optimization_barrier(  # type: ignore[no-untyped-call]
        (n, turn_1, turn_2, k, e)
    )
    (x, y), k1, k2 = n, k * turn_1, k * turn_2
    return Blocks(
        linear=_by_pair(k * x * x, k * x * y, k * y * y),
        first=_by_pair(k1 * x, k1 * y),
        second=_by_pair(k2 * x, k2 * y),
        angular=_by_pair(k1 * turn_1, k1 * turn_2, k2 * turn_2),
        pull=_by_pair(e * x, e * y, e * turn_1, e * turn_2),
    )


def _by_pair(*terms: Float[Array, "spring voxel *batch"]) -> Float[Array, "c pair voxel *batch"]:
    """Sums over the springs between two squares; sides have equally many, diagonals one."""
    each = jnp.stack(terms)
    sides, diagonals = each[:, : -len(DIAGONALS)], each[:, -len(DIAGONALS) :]
    by_side = sides.reshape(len(terms), len(SIDES), -1, *sides.shape[2:])
    total = by_side[:, :, 0]
    for spring in range(1, by_side.shape[2]):
        total += by_side[:, :, spring]
    return jnp.concatenate([total, diagonals], 1)


def on_squares(blocks: Blocks) -> Float[Array, "9 colour voxel *batch"]:
    """What the springs of a voxel do to each of its squares, if the others do not move.

    The block of the matrix (xx, xy, yy, xw, yw, ww; kg, kg m, kg m^2), and the impulse that springs
    begin with (N s, N s, N m s).
    """
    on: list[Any] = [0.0] * COLOURS
    of = blocks
    first = jnp.concatenate([of.linear, of.first, of.angular[:1], of.pull[:3]])
    second = jnp.concatenate([of.linear, of.second, of.angular[2:], -of.pull[:2], -of.pull[3:]])
    for pair, (one, other) in enumerate(PAIRS):
        on[one] += first[:, pair]
        on[other] += second[:, pair]
    return jnp.stack(on, 1)


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
    for pair, (first, second) in enumerate(PAIRS):
        xx, xy, yy = springs.linear[:, pair]
        mine, its = springs.first[:, pair], springs.second[:, pair]
        if colour == first:
            vx, vy, w = velocity[second]
        elif colour == second:
            (vx, vy, w), mine, its = velocity[first], its, mine
        else:
            continue
        total += jnp.stack(
            [
                xx * vx + xy * vy + its[0] * w,
                xy * vx + yy * vy + its[1] * w,
                mine[0] * vx + mine[1] * vy + springs.angular[1, pair] * w,
            ]
        )
    return total
