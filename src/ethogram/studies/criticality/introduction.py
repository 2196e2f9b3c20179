"""What the study's page opens with."""

from ethogram.core.introduction import Introduction
from ethogram.studies.thesis import chapter

INTRODUCTION = Introduction(
    text="A soft robot in the plane is made of square voxels that grow and shrink. A body that is "
    "neither rigid nor loose should suit many tasks: the thesis looks for it at the edge between "
    "both, where a pulse in one voxel starts avalanches of all sizes. Each voxel is driven for "
    "0.4 s in a body that floats, and the voxels whose area changes are counted; criticality is "
    "how near the sizes of these avalanches are to a power law. A genetic algorithm grows bodies "
    "of 20 voxels or more on a grid of 20 x 20 cells towards criticality, and they are compared "
    "with random bodies and with hand-made ones.",
    source=chapter(6),
    symbols={
        "active": "a voxel whose area ratio changes by more than tau in a step of 1/60 s",
        "size": "of an avalanche: how many voxels were ever active",
        "duration": "of an avalanche: in how many steps some voxel was active",
        "score": "f = R^2 + exp(-2 D), from 0 to 2: how straight the logarithms of sizes and of "
        "their counts lie, and how near their running sums are to those of the line",
        "opt, rnd, psrnd": "evolved, random and pseudo-random bodies",
    },
    case="evolved-0",
    frame=5,
    caption="A pulse in one voxel of an evolved body. Coloured voxels are, or have been, active.",
)
