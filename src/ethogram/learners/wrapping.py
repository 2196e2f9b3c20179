"""Any learner in any world: the wrappers that give a world the spaces that a learner can use.

A learner says in its attribute `spaces` which it can use (`ethogram.learners.base.Spaces`); one
that says nothing can use all.  Observations that it cannot use are cut into bins, as many as there
may be with no more than `MAX_ROWS` different observations; actions that it cannot use become
choices.
"""

from math import prod
from typing import Any

from ethogram.core.errors import EthogramError, shown
from ethogram.core.spaces import Space
from ethogram.core.world import World
from ethogram.core.wrappers import DiscretizeAction, DiscretizeObservation, Wrapper
from ethogram.core.wrappers.discretize import digit_sizes
from ethogram.learners.base import Spaces

MIN_BINS, MAX_BINS = 2, 10
MAX_ROWS = 100_000


def wrap_for(learner: Any, world: World) -> World:
    """The world in the wrappers that a learner needs; as it is, if it needs none.

    Args:
        learner: a class of learners, or one; for evolution, that of the fitness
            (`ethogram.learners.fitness.PolicyFitness`).
        world: any.

    Raises:
        EthogramError: a space cannot be made one that the learner can use; the message names the
            role, and the wrapper in which more can be said.

    """
    if isinstance(learner, str) or not isinstance(world, World):
        raise EthogramError(
            f"wrap_for: {shown(learner)} in {shown(world)}; allowed: a learner or its class, such "
            "as ethogram.LEARNERS['qlearning'], and a world."
        )
    spaces: Spaces = getattr(learner, "spaces", Spaces())
    roles = world.roles.values()
    if not all(isinstance(role.observation, spaces.observation) for role in roles):
        world = DiscretizeObservation(world, bins=_bins([role.observation for role in roles]))
    if not all(isinstance(role.action, spaces.action) for role in roles):
        world = DiscretizeAction(world)
    return world


def wrappers_for(learner: Any, world: World) -> tuple[str, ...]:
    """The wrappers of `wrap_for` in words, the innermost first.

    Raises:
        EthogramError: as `wrap_for`.

    """
    found: list[str] = []
    at = wrap_for(learner, world)
    while at is not world:
        assert isinstance(at, Wrapper)
        bins = f"(bins={at.bins})" if isinstance(at, DiscretizeObservation) else ""
        found.insert(0, type(at).__name__ + bins)
        at = at.world
    return tuple(found)


def matrix(learners: dict[str, Any], worlds: dict[str, World]) -> str:
    """A table in Markdown of what each learner needs in each world, or why it cannot act there.

    Args:
        learners: by name, what `wrap_for` takes.
        worlds: by name.

    """
    lines = [f"| | {' | '.join(learners)} |", "| --- " * (len(learners) + 1) + "|"]
    for name, world in worlds.items():
        cells = [_cell(learner, world) for learner in learners.values()]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cell(learner: Any, world: World) -> str:
    try:
        names = wrappers_for(learner, world)
    except EthogramError as error:
        return f"no: {error}"
    return ", ".join(f"`{name}`" for name in names) or "as it is"


def _bins(spaces: list[Space]) -> int:
    """The most bins, within limits, with which no space has more than `MAX_ROWS` values."""
    for bins in range(MAX_BINS, MIN_BINS, -1):
        if all(prod(digit_sizes(space, bins)) <= MAX_ROWS for space in spaces):
            return bins
    return MIN_BINS
