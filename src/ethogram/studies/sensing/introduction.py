"""What the study's page opens with."""

from ethogram.core.introduction import Introduction
from ethogram.studies.thesis import chapter

INTRODUCTION = Introduction(
    text="A robot here is a body of soft cubes (voxels) on a floor, and it crawls by growing and "
    "shrinking them. Three bodies are compared: a worm of four voxels, a biped, and a tripod. A "
    "controller that does not sense drives every voxel by a sine wave of its own; one that senses "
    "is a neural network that is told what all voxels feel and decides how large each is to be. "
    "Controllers evolve on an even or on an uneven surface, and count for how far the robot gets "
    "along x in one simulation (fitness). The best of each run are then tried where gravity pulls "
    "in other ways: never sideways (flat), in the second half (step), to and fro (sin). The thesis "
    "does not say how the network\u2019s outputs become sizes; they are read in two ways, through "
    "tanh, which bounds them, and unbounded, and every claim is judged for either.",
    source=chapter(5),
    symbols={
        "fitness": "how far the robot gets along x (mm) under the gravity in which it evolved",
        "lead": "mean fitness, or distance, with sensing less that without (mm)",
        "ratio": "mean distance in a validation scenario over mean fitness: above 1, the robot "
        "gets further there than where it evolved",
        "silhouette": "how much nearer a run\u2019s behaviour is to its own kind of controller "
        "than to the other: 1 wholly, 0 not at all, negative: nearer to the other",
        "p": "of a Mann-Whitney U test: how often chance alone would part two conditions so far",
        "n_gen, n_pop, n_sim, p_mut": "generations and individuals of an evolution, steps of a "
        "simulation, the probability that a parameter of a child mutates (Table 5.1)",
    },
    case="tripod-shrink_limited-even",
    frame=22,
    caption="The best tripod that evolved without sensing, on its way to the right: voxels are "
    "blue while they are contracted, vermilion while they are expanded, and grey at rest. Marks on "
    "the floor are 10 mm apart.",
)
