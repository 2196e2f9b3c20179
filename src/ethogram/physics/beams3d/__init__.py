"""Soft bodies as lattices of elastic beams in three dimensions (thesis, chapter 5).

A body is a set of cubic voxels, each a rigid mass with an orientation; neighbours are joined by a
beam that stretches, bends and twists and whose rest length follows the edges commanded to its two
voxels.  Bodies lie on a floor with friction, under gravity, and do not pass through themselves.

The model is the one that the thesis takes from Kriegman's simulator: Hiller and Lipson, "Dynamic
Simulation of Soft Multimaterial 3D-Printed Objects" (2014), with linear beams, no poisson effect
on the volume, and explicit integration.  Trajectories agree with that simulator's to 1e-8 m over
10 000 steps in 64 bits, distances to 0.5% in 32 bits.

Arrays have components first, then voxels or bonds, then any batch axes.  Every function is written
for one robot, without batch axes, and takes trailing ones as they come: robots then lie side by
side in memory, which is three times as fast as leading ones.  `simulate`, the one way through time,
gives robots that `jax.vmap` batches this layout; `jax.vmap` works over anything: states, edges,
gravity, materials, and bodies made equal in size by `stack` or `pad`.

Precision is JAX's: 32 bits, or 64 where `jax_enable_x64` is set.
"""

from ethogram.physics.beams3d.lattice import Lattice, Size, lattice, pad, stack
from ethogram.physics.beams3d.material import Material
from ethogram.physics.beams3d.motion import State, at_rest, centre, sensed_scale
from ethogram.physics.beams3d.simulate import simulate
from ethogram.physics.native import Kernel

__all__ = [
    "Kernel",
    "Lattice",
    "Material",
    "Size",
    "State",
    "at_rest",
    "centre",
    "lattice",
    "pad",
    "sensed_scale",
    "simulate",
    "stack",
]
