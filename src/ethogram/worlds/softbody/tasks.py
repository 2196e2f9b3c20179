"""Tasks for bodies in the plane: where they are put, for how long, and what they are rewarded for.

Thesis, section 6.4.2.  Ground and ceiling are polylines; where they end in steep slopes, these are
walls.  A body is placed with its left edge at a place and lifted until its lowest corner is 1 m
above the ground; then it drops.

- `locomotion`: level ground between walls, 20 s.  The reward is the way of the centre along +x.
- `jump`: a bowl 34 m wide, 10 s in which nothing is commanded, then 20 s.  The reward is what the
  centre rises above where it never was before: the return is the highest rise above its height
  after the first step that was commanded.
- `escape`: level ground under a ceiling that falls from 1.4 to 0.6 of the body's height, 40 s.  The
  reward is the way of the centre along +x.  Bodies taller than 1.4 of what their cells say minus
  half a cell start within the ceiling, as in the original.
- `hills`, `steps`: locomotion over sine waves and over stairs (beyond the thesis).
"""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from ethogram.core.errors import InvalidSettings
from ethogram.core.settings import Number
from ethogram.physics.lattice2d import Lattice, Terrain

Points = tuple[tuple[float, float], ...]
DROP = 1.0  # m, of the lowest corner above the ground at first
HILL_LENGTH, HILL_HEIGHT, STEP_LENGTH, STEP_HEIGHT = 30.0, 2.0, 20.0, 1.0  # m
FAR = 200.0  # m, where hills and steps end


@dataclass(frozen=True)
class Task:
    """A task; lengths in m, times in s."""

    ground: Points
    start: float  # x of the left edge
    seconds: float  # of control
    settling: float = 0.0  # before it, without control
    rises: bool = False  # whether the reward is what the centre rises, not its way
    ceiling: Callable[[Lattice, Number], Array] | None = None  # of a body and the edge of its cells

    def __post_init__(self) -> None:
        """Refuse times and places that are none.

        Raises:
            InvalidSettings: naming the field, its value and what is allowed.

        """
        for name, value, is_right, allowed in (
            ("start", self.start, np.isfinite(self.start), "a finite number"),
            ("seconds", self.seconds, 0 < self.seconds < np.inf, "above 0 and finite"),
            ("settling", self.settling, 0 <= self.settling < np.inf, "0 or more and finite"),
        ):
            if not is_right:
                raise InvalidSettings(f"Task: {name} = {value}; allowed: {allowed}.")
        Terrain(jnp.asarray(self.ground))

    def terrain(self, lattice: Lattice, edge: Number) -> Terrain:
        """Ground and ceiling for a body.

        Args:
            lattice: the body.
            edge: of its cells, m.

        """
        ceiling = None if self.ceiling is None else self.ceiling(lattice, edge)
        return Terrain(jnp.array(self.ground), ceiling)


def cave(lattice: Lattice, edge: Number) -> Float[Array, "point 2"]:
    """The ceiling of `escape`, from the largest coordinates X, Y of a body.

    Both are counted from the centre of the first cell.
    """
    cells = jnp.where(lattice.used[:, None], lattice.cell, 0).max(0)
    x, y = edge * cells + edge / 2
    points = [(0.0, 1.4), (1.1, 1.4), (1.4, 1.0), (2.5, 0.7), (10.0, 0.6)]
    return jnp.stack([jnp.stack([across * x, up * y]) for across, up in points])


def hills() -> Points:
    """Sine waves, a point every 3 m, after 10 m of level ground."""
    along = np.arange(0.0, FAR, HILL_LENGTH / 10)
    up = HILL_HEIGHT * (1 - np.cos(2 * np.pi * along / HILL_LENGTH)) / 2
    waves = [(20.0 + float(x), float(y)) for x, y in zip(along, up, strict=True)]
    return ((0.0, 100.0), (10.0, 0.0), *waves)


def steps() -> Points:
    """Stairs upwards, after 10 m of level ground; risers lean by a tenth of their height."""
    stairs: list[tuple[float, float]] = []
    for number in range(int(FAR / STEP_LENGTH)):
        x, y = 30.0 + STEP_LENGTH * number, STEP_HEIGHT * number
        stairs += [(x, y), (x + STEP_HEIGHT / 10, y + STEP_HEIGHT)]
    return ((0.0, 100.0), (10.0, 0.0), *stairs)


TASKS = {
    "locomotion": Task(
        ((0.0, 100.0), (10.0, 0.0), (1990.0, 0.0), (2000.0, 100.0)), start=11.0, seconds=20.0
    ),
    "jump": Task(
        ((0.0, 100.0), (1.0, 0.0), (35.0, 0.0), (36.0, 100.0)),
        start=1.0,
        seconds=20.0,
        settling=10.0,
        rises=True,
    ),
    "escape": Task(((0.0, 100.0), (1.0, 0.0), (200.0, 0.0)), start=2.0, seconds=40.0, ceiling=cave),
    "hills": Task(hills(), start=11.0, seconds=20.0),
    "steps": Task(steps(), start=11.0, seconds=20.0),
}


def task_of(task: "str | Task") -> Task:
    """The task of a name, or the task itself.

    Raises:
        InvalidSettings: it is neither.

    """
    if isinstance(task, Task):
        return task
    if task not in TASKS:
        raise InvalidSettings(f"task = {task!r}; allowed: a Task, or one of {', '.join(TASKS)}.")
    return TASKS[task]
