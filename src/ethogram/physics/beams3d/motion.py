"""State of soft bodies, and one step of time: forces, then momenta, then places.

The integration is semi-implicit Euler.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int

from ethogram.physics.beams3d.bonds import Memory, bond_forces, over_batch
from ethogram.physics.beams3d.contacts import floor as floor_contact
from ethogram.physics.beams3d.contacts import self_collisions
from ethogram.physics.beams3d.lattice import Lattice
from ethogram.physics.beams3d.material import Material
from ethogram.physics.beams3d.rotations import Quaternion, Vector, normalised, product

MAX_STRAIN = 100.0  # beyond it the simulation has diverged


class State(eqx.Module):
    """State of a body: its voxels' poses and momenta, and its bonds.

    Who moves voxels by hand, against each other, sets `clearance` to 0: a kernel looks for contacts
    only where it is used up.
    """

    position: Float[Array, "3 voxel *batch"]  # m
    orientation: Float[Array, "4 voxel *batch"]  # unit quaternion: w, x, y, z
    momentum: Float[Array, "3 voxel *batch"]  # kg m/s
    angular_momentum: Float[Array, "3 voxel *batch"]  # kg m^2/s
    force: Float[Array, "3 voxel *batch"]  # N, change of momentum per time in the last step
    edge: Float[Array, "voxel *batch"]  # m, as commanded for the last step
    strain: Float[Array, "bond *batch"]  # of the bonds in the last step
    memory: Memory
    steps: Int[Array, "..."]  # taken so far: by all alike, or by each
    diverged: Bool[Array, "*batch"]  # once a strain passed 100, or something was not finite
    clearance: Float[Array, "*batch"]  # m, by which all are apart beyond touching; 0: not known


def at_rest(lattice: Lattice, material: Material, batch: tuple[int, ...] = ()) -> State:
    """A body that nothing has moved yet, with its lowest corner at the origin.

    Args:
        lattice: the body.
        material: of its voxels.
        batch: the axes of a batch of robots, all alike.

    """
    edge = jnp.asarray(material.edge, float)  # not weakly typed, as no later state is
    lift = (lattice.cell.T + 0.5) * edge
    lift = jnp.broadcast_to(lift.reshape(lift.shape + (1,) * len(batch)), lift.shape + batch)
    still = jnp.zeros_like(lift)
    bonds = (lattice.bonds, *batch)
    return State(
        position=lift,
        orientation=jnp.zeros_like(lift, shape=(4, *lift.shape[1:])).at[0].set(1.0),
        momentum=still,
        angular_momentum=still,
        force=still,
        edge=jnp.broadcast_to(edge, lift.shape[1:]),
        strain=jnp.zeros_like(lift, shape=bonds),
        memory=Memory(jnp.ones(bonds, bool), jnp.zeros_like(lift, shape=(9, *bonds))),
        steps=jnp.int32(0),
        diverged=jnp.zeros(batch, bool),
        clearance=jnp.zeros_like(lift, shape=batch),
    )


def step(
    lattice: Lattice,
    material: Material,
    state: State,
    edge: Float[Array, "voxel *batch"],
    gravity: Float[Array, "3 ..."],
    *,
    floor: bool = True,
) -> State:
    """The state after `material.time_step`.

    Args:
        lattice: the body.
        material: of voxels and floor.
        state: where it is.
        edge: commanded from now on (m).
        gravity: acceleration (m/s^2), the same for all robots or one each.
        floor: whether there is one, at z = 0.

    """
    pose = state.position, state.orientation
    pull, memory = bond_forces(lattice, material, pose, edge, state.memory, state.steps == 0)
    touch = self_collisions(lattice, material, state.position, edge)
    drag = material.global_damping * material.contact_dashpot / material.mass * state.momentum
    others = pull.force + touch - drag
    force = Vector(*(part + material.mass * g for part, g in zip(others, gravity, strict=True)))
    momentum = Vector(*state.momentum)
    if floor:
        momentum, force = floor_contact(material, state.position[2], edge, momentum, force)
    time = material.time_step
    moved = integrated(material, state, momentum, force, pull.torque, time)
    torn = pull.strain > MAX_STRAIN
    if lattice.is_padded:
        torn &= over_batch(lattice.bond_used, torn)
    failed = torn.any(0) | ~jnp.isfinite(moved.position).all((0, 1))
    return State(
        position=moved.position,
        orientation=moved.orientation,
        momentum=moved.momentum,
        angular_momentum=moved.angular_momentum,
        force=(moved.momentum - state.momentum) / time,
        edge=edge,
        strain=pull.strain,
        memory=memory,
        steps=state.steps + 1,
        diverged=state.diverged | failed,
        clearance=jnp.zeros_like(state.clearance),
    )


class Moved(NamedTuple):
    """Poses and momenta after a step."""

    position: Float[Array, "3 voxel *batch"]
    orientation: Float[Array, "4 voxel *batch"]
    momentum: Float[Array, "3 voxel *batch"]
    angular_momentum: Float[Array, "3 voxel *batch"]


def integrated(
    material: Material,
    state: State,
    momentum: Vector,
    force: Vector,
    torque: Float[Array, "3 voxel *batch"],
    time: Float[Array, ""],
) -> Moved:
    """Semi-implicit Euler: first momenta, then places by the new momenta.

    P' = P + F dt, p' = p + P' dt / m, H' = (H + M dt) (1 - 10 zeta 2 sqrt(I E L^3) / I dt), and
    q' = q + (0, H' / I) q dt / 2, normalised.

    Args:
        material: of the voxels.
        state: before the step; its momentum is not used, but that which the floor left.
        momentum: P, kg m/s.
        force: F, N.
        torque: M, N m.
        time: dt, s.

    """
    pushed = jnp.stack(momentum) + jnp.stack(force) * time
    spin = (state.angular_momentum + torque * time) * material.spin_decay
    return Moved(
        position=state.position + pushed * (time / material.mass),
        orientation=turned(state.orientation, spin / material.inertia, time),
        momentum=pushed,
        angular_momentum=spin,
    )


def turned(
    orientation: Float[Array, "4 voxel *batch"],
    spin: Float[Array, "3 voxel *batch"],
    time: Float[Array, ""],
) -> Float[Array, "4 voxel *batch"]:
    """Orientation after a turn at w (rad/s) for a time (s): q + (0, w) q time / 2, normalised."""
    q = Quaternion(*orientation)
    rate = product(Quaternion(jnp.zeros_like(q.w), *spin), q)
    half = time / 2
    return jnp.stack(
        normalised(Quaternion(*(now + half * change for now, change in zip(q, rate, strict=True))))
    )


def sensed_scale(lattice: Lattice, state: State) -> Float[Array, "voxel *batch"]:
    """Length of a voxel's bonds, relative to rest: the mean of 1 + strain; 1 without bonds."""
    ends = lattice.first, lattice.second
    count = jnp.stack([(end.items < lattice.bonds).sum(0) for end in ends]).sum(0)
    total = jnp.stack([end.total(state.strain[None])[0] for end in ends]).sum(0)
    return 1 + total * over_batch(1 / jnp.maximum(count, 1), total)


def centre(lattice: Lattice, state: State) -> Float[Array, "3 *batch"]:
    """The centre of mass, m."""
    if not lattice.is_padded:
        return state.position.sum(1) / lattice.voxels
    used = over_batch(lattice.used, state.position[0])
    return jnp.where(used, state.position, 0.0).sum(1) / lattice.used.sum()
