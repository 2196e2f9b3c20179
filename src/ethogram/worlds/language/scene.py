"""A game as a scene: who goes where, who says what, who knows whose target."""

from itertools import product
from string import ascii_lowercase

import jax
import numpy as np
from jaxtyping import Float

from ethogram.core.scene import Scene, Shape, tints
from ethogram.worlds.language.state import State, distances

ROBOT, TARGET = 0.025, 0.035  # radius and half an edge; the targets lie in a square of side 1
MARGIN = 0.1
FRAME_SECONDS = 0.25


def word_names(capacity: int) -> tuple[str, ...]:
    """How words are shown: silence, then a, b, ... z, aa, ab, ... for symbols 1, 2, ..."""
    length, names = 1, ["silence"]
    while len(names) <= capacity:
        names += map("".join, product(ascii_lowercase, repeat=length))
        length += 1
    return tuple(names[: capacity + 1])


def record(initial: State, states: State) -> Scene:
    """Draw up an episode: the start, and each state reached.

    A target and the robots that must reach it have the same tint.  Lines join each robot to the
    one it guides and to that one's target.  Beside a robot stands the word that it said on the
    way to this frame, the heaviest of its weights; nothing stands for silence.

    Args:
        initial: the state in which the episode started.
        states: arrays with the steps as leading axis.

    """
    played = jax.tree.map(lambda first, rest: np.concatenate([first[None], rest]), initial, states)
    goal, guides = np.asarray(initial.goal), np.asarray(initial.guides)
    frames, robots, targets = len(played.time), len(goal), len(initial.target)
    tint = np.concatenate([np.arange(targets), goal])
    distance = np.asarray(jax.vmap(distances)(played))
    position = np.concatenate([played.target, played.position], 1)
    return Scene(
        title="Unknown targets: lines join a robot, the one it guides, and that one's target",
        bounds=_bounds(position),
        frame_seconds=FRAME_SECONDS,
        palette=tints(
            *(f"target {t + 1} and the robots that must reach it" for t in range(targets))
        ),
        shapes=(
            *(Shape("square", TARGET, f"target {t + 1}") for t in range(targets)),
            *(Shape("circle", ROBOT, str(r + 1)) for r in range(robots)),
        ),
        links=_links(guides, goal, targets),
        position=position,
        tint=np.broadcast_to(tint, (frames, targets + robots)),
        words=word_names(played.said.shape[-1] - 1)[1:],
        said=np.concatenate([np.full((frames, targets), -1), played.said.argmax(-1) - 1], 1),
        captions=tuple(
            f"{_moment(step)}: {_knowledge(guides)}; mean distance {distance[step].mean():.2f}"
            for step in range(frames)
        ),
        series={"distance": distance},
    )


def _bounds(position: Float[np.ndarray, "frame shape axis"]) -> tuple[float, float, float, float]:
    """The square, and what lies outside it: nothing holds robots back."""
    left, bottom = (min(0.0, float(low)) - MARGIN for low in position.min((0, 1)))
    right, top = (max(1.0, float(high)) + MARGIN for high in position.max((0, 1)))
    return left, bottom, right, top


def _links(guides: np.ndarray, goal: np.ndarray, targets: int) -> tuple[tuple[int, int], ...]:
    """Each guide with the robot it guides, once, and with that robot's target."""
    pairs = {
        (min(robot, guided), max(robot, guided)) for robot, guided in enumerate(guides.tolist())
    }
    known = enumerate(goal[guides].tolist())
    return (
        *((targets + first, targets + second) for first, second in sorted(pairs)),
        *((targets + robot, target) for robot, target in known),
    )


def _moment(step: int) -> str:
    return f"step {step}" if step else "start"


def _knowledge(guides: np.ndarray) -> str:
    return ", ".join(f"{robot + 1} guides {guided + 1}" for robot, guided in enumerate(guides))
