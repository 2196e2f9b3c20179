"""A sharing episode as a scene: who is where, who wants to go where, who speaks, who earns."""

import numpy as np
from jaxtyping import Float

from ethogram.core.scene import Scene, Shape, tints
from ethogram.worlds.sharing.state import State

AGENT, RESOURCE = 0.35, 1.2  # radius and half an edge; agents stand one unit apart
FRAME_SECONDS = 0.4


def record(
    states: State,
    reward: Float[np.ndarray, "step agent"],
    resources: int,
    title: str = "Sharing: one validation episode",
) -> Scene:
    """Draw up an episode from the states it reached.

    Args:
        states: arrays with the steps as leading axis.
        reward: what each agent earned in each of them.
        resources: how many resources there are.
        title: of the scene.

    """
    place, wish, spoke = (
        np.asarray(part) for part in (states.resource, states.preference, states.spoke)
    )
    steps, agents = place.shape
    total = np.cumsum(reward, 0)
    across = np.linspace(-1, 1, max(resources, 1)) * 2.0 * resources
    sites = np.stack([across, np.full(resources, 4.0)], -1)
    fixed = np.broadcast_to(sites, (steps, resources, 2))
    speech = np.where(spoke, (place == wish) * resources + wish - 1, -1)
    quiet = np.full((steps, resources), -1)
    return Scene(
        title=title,
        bounds=(across[0] - 3, -1.0, across[-1] + 3, 6.0 + agents / 4),
        frame_seconds=FRAME_SECONDS,
        palette=tints("a resource", *(f"wants resource {j + 1}" for j in range(resources))),
        shapes=(
            *(Shape("square", RESOURCE, f"resource {j + 1}") for j in range(resources)),
            *(Shape("circle", AGENT, str(i + 1)) for i in range(agents)),
        ),
        position=np.concatenate([fixed, _standing(place, sites)], 1),
        tint=np.concatenate([np.zeros((steps, resources), int), wish], 1),
        words=tuple(
            f"{how} {j + 1}" for how in ("coming to", "staying on") for j in range(resources)
        ),
        said=np.concatenate([quiet, speech], 1),
        captions=tuple(
            f"step {step + 1}, mean return {total[step].mean():.1f}" for step in range(steps)
        ),
        series={"return": total},
    )


def _standing(
    place: np.ndarray, sites: Float[np.ndarray, "resource axis"]
) -> Float[np.ndarray, "step agent axis"]:
    """Agents on a resource stand in a column on it; the others wait in a row below."""
    steps, agents = place.shape
    waiting = np.stack([np.linspace(sites[0, 0], sites[-1, 0], agents), np.zeros(agents)], -1)
    position = np.broadcast_to(waiting, (steps, agents, 2)).copy()
    for j, site in enumerate(sites):
        here = place == j + 1
        rank = np.cumsum(here, 1) - 1
        column = site + np.stack([rank % 2 - 0.5, rank // 2 - 0.5], -1)
        position[here] = column[here]
    return position
