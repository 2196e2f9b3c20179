"""Soft bodies in the plane: voxels of rigid squares and springs (thesis, chapter 6).

A body is a set of square voxels.  Each has a rigid square in every corner, springs between them,
and the area that it is commanded to have; squares of neighbours that face each other are welded.
Bodies touch a terrain with friction, under gravity.

The model is that of the simulator 2D-VSR-Sim in the year 2020, which the thesis used: rigid bodies
and implicit springs solved by sequential impulses.  Here the springs between two squares are one
block of a matrix, and sweeps go over rigid bodies, not over springs: it is what the original's
sweeps converge to.  Area ratios agree with that simulator's to 1.2e-4 at every step.

Deviations: welds are exact; squares of one body that no joint links pass through each other; a
corner of a square touches one segment of a polyline at a time.

Arrays have components first, then colours and rigid bodies (or voxels), then any batch axes.

Precision is JAX's: 32 bits, or 64 where `jax_enable_x64` is set.
"""

from ethogram.physics.lattice2d.avalanche import Avalanches, avalanches
from ethogram.physics.lattice2d.contacts import Terrain, flat
from ethogram.physics.lattice2d.lattice import Lattice, lattice, lattices
from ethogram.physics.lattice2d.material import Material
from ethogram.physics.lattice2d.motion import State, at_rest
from ethogram.physics.lattice2d.simulate import simulate

__all__ = [
    "Avalanches",
    "Lattice",
    "Material",
    "State",
    "Terrain",
    "at_rest",
    "avalanches",
    "flat",
    "lattice",
    "lattices",
    "simulate",
]
