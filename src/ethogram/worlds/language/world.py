"""The Cooperative Unknown Target game: robots that must tell each other where to go.

Each of n_r robots has one of n_t targets as its own, and does not know which; exactly one other
robot does.  A robot is two agents: a mover, which accelerates it, and a talker, which says one
symbol a step for all to hear (thesis, section 2.4).

A mover observes the offsets of its robot from every target and what every robot said a step ago
(eq. 2.2); a talker, which robot it guides and to which target (eq. 2.3).  Both are rewarded with
minus the Manhattan distance of a robot from its target: the mover's own (eq. 2.4), the talker's
guided one (eq. 2.6), in the state after the move.

Actions are weights over choices (a one-hot vector is a pure choice): for a mover (none, up,
right, down, left), for a talker (silence, symbol 1, symbol 2...).  There are `vocabulary_size`
symbols, and room for `max_vocabulary_size`: languages of any size share one compiled program.

Units: the side of the square the targets lie in is 1; velocity is displacement per step.

Deviations from the print, each for the reason given.  `dynamics="damped"` moves like the
multi-agent particle environments, v <- 0.75 v + 0.05 a, then x <- x + v: under the printed law
(`dynamics="literal"`: x <- x + v, v <- v + delta a) a robot that neither remembers nor sees its
velocity can only oscillate.  Another function of position, velocity, push and delta may take their
place.  A talker may be silent only if `allow_silence` or if there is no symbol, since silence is a
word too (the unused entries of its action and of what is heard are padding, 0).
`execution="soft"` lets weights move robots and be heard as they are; `"hard"` turns them into the
choice of the largest.  `observe_velocity` is off, as in the thesis.  The end is a time limit, hence
a truncation.
"""

from collections.abc import Callable
from functools import cache
from itertools import permutations
from typing import Annotated, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float, Int, Key
from pydantic import Field

from ethogram.core.errors import InvalidSettings, shown
from ethogram.core.rollout import first_episode
from ethogram.core.scene import Scene
from ethogram.core.settings import Number, function_of, named, of_shape, setting
from ethogram.core.spaces import Box, Simplex
from ethogram.core.world import Outcome, PerRole, Role, Transition, World
from ethogram.worlds.language.scene import record
from ethogram.worlds.language.state import State, distances

# position Float[robot, 2], velocity Float[robot, 2], push Float[robot, 2], delta -> the first two
Dynamics = Callable[[Array, Array, Array, Number], tuple[Array, Array]]
Execution = Literal["soft", "hard"]

DAMPING, ACCELERATION = 0.75, 0.05  # of the particle environments, per step
#        none   up      right   down     left
MOVES = ((0, 0), (0, 1), (1, 0), (0, -1), (-1, 0))


def damped(
    position: Float[Array, "robot 2"],
    velocity: Float[Array, "robot 2"],
    push: Float[Array, "robot 2"],
    delta: Number,
) -> tuple[Float[Array, "robot 2"], Float[Array, "robot 2"]]:
    """The multi-agent particle environments: v <- 0.75 v + 0.05 a, then x <- x + v."""
    del delta
    velocity = DAMPING * velocity + ACCELERATION * push
    return position + velocity, velocity


def literal(
    position: Float[Array, "robot 2"],
    velocity: Float[Array, "robot 2"],
    push: Float[Array, "robot 2"],
    delta: Number,
) -> tuple[Float[Array, "robot 2"], Float[Array, "robot 2"]]:
    """The law as printed: x <- x + v, v <- v + delta a."""
    return position + velocity, velocity + delta * push


DYNAMICS: dict[str, Dynamics] = {"damped": damped, "literal": literal}


class Language(World):
    """Robots that see the targets and must be told which one is theirs.

    A robot is two agents, one of the role `mover` and one of the role `talker`.  Actions are
    weights of choices, none negative, 1 together: of a mover those of (none, up, right, down,
    left), of a talker those of (silence, symbol 1, symbol 2, ...).  Observation of a mover, entry
    by entry:

    - of each target, its offset from the robot (x, y), in sides of the square;
    - the robot's velocity (x, y) in sides per step, if `observe_velocity`;
    - of each robot, what it said a step ago, as weights in the order of a talker's actions.

    Of a talker: one-hot, the robot that it guides; one-hot, the target of that robot.

    Attributes:
        vocabulary_size: |W|, symbols, from 0 to `max_vocabulary_size`.
        delta: how much a push changes the velocity, sides per step; above 0, for "literal" alone.
        robots: n_r, from 2 to 7.
        targets: n_t, from 1 to 1000.
        max_vocabulary_size: for how many symbols there is room, from 0 to 10 000; languages of
            all sizes within it share one compiled program.
        steps: of an episode, from 1 to 1 000 000.
        dynamics: "damped", "literal", or a function of positions, velocities, pushes and `delta`
            to the next positions and velocities.
        execution: "soft" takes weights as they are, "hard" as the choice of the largest.
        allow_silence: whether talkers that have symbols may also be silent.
        observe_velocity: whether movers observe their robot's velocity.

    """

    vocabulary_size: int | Int[Array, ""] = setting(4, Annotated[int, Field(ge=0, le=10_000)])
    delta: Number = setting(0.05, Annotated[float, Field(gt=0)])
    robots: int = setting(2, Annotated[int, Field(ge=2, le=7)], static=True)
    targets: int = setting(2, Annotated[int, Field(ge=1, le=1000)], static=True)
    max_vocabulary_size: int = setting(4, Annotated[int, Field(ge=0, le=10_000)], static=True)
    steps: int = setting(25, Annotated[int, Field(ge=1, le=1_000_000)], static=True)
    dynamics: str | Dynamics = named("damped", DYNAMICS)
    execution: Execution = setting("soft", Execution, static=True)
    allow_silence: bool = setting(False, bool, static=True)
    observe_velocity: bool = setting(False, bool, static=True)

    def __check_init__(self) -> None:
        """Refuse an alphabet that there is no room for.

        Raises:
            InvalidSettings: `vocabulary_size` is more than `max_vocabulary_size`.

        """
        if isinstance(self.vocabulary_size, jax.core.Tracer):
            return
        largest = np.asarray(
            self.vocabulary_size
        ).max()  # NumPy: under jit JAX would trace this, too
        if largest > self.max_vocabulary_size:
            raise InvalidSettings(
                f"Language: vocabulary_size = {largest} is more than max_vocabulary_size = "
                f"{self.max_vocabulary_size}."
            )

    @property
    def horizon(self) -> int:
        """Every episode lasts `steps` steps."""
        return self.steps

    @property
    def roles(self) -> dict[str, Role]:
        """`mover` and `talker`, one of each per robot."""
        symbols = self.max_vocabulary_size + 1  # and silence
        seen = 2 * self.targets + 2 * self.observe_velocity
        heard = jnp.tile(
            self.vocabulary_mask.at[0].set(True), self.robots
        )  # all are silent at first
        used = jnp.concatenate([jnp.ones(seen, bool), heard])
        offsets = Box(-self._reach, self._reach, used.shape, used)
        known = Box(0.0, 1.0, (self.robots + self.targets,))
        return {
            "mover": Role(self.robots, offsets, Simplex(len(MOVES))),
            "talker": Role(self.robots, known, Simplex(symbols, self.vocabulary_mask)),
        }

    @property
    def _reach(self) -> float:
        """The largest offset: that of a robot at full speed all the way, if it has any."""
        if function_of(DYNAMICS, self.dynamics) is damped:
            return 1.0 + self.steps * ACCELERATION / (1 - DAMPING)
        return float("inf")

    @property
    def vocabulary_mask(self) -> Bool[Array, "word"]:
        """Which entries of a talker's action it may use."""
        word = jnp.arange(self.max_vocabulary_size + 1)
        mute = jnp.logical_or(self.vocabulary_size == 0, self.allow_silence)
        return jnp.where(word == 0, mute, word <= self.vocabulary_size)

    def reset(self, key: Key[Array, ""]) -> tuple[State, PerRole]:
        """Robots and targets uniform in the square, goals uniform, guides a random derangement.

        One draw serves all, since a rollout resets at every step.
        """
        ways = jnp.asarray(derangements(self.robots))
        sizes = (2 * self.robots, 2 * self.targets, self.robots)
        chance = jax.random.uniform(key, (sum(sizes) + 1,))
        robots, targets, goals, way = jnp.split(chance, np.cumsum(sizes))
        state = State(
            position=robots.reshape(-1, 2),
            velocity=jnp.zeros((self.robots, 2)),
            target=targets.reshape(-1, 2),
            guides=ways[(way[0] * len(ways)).astype(jnp.int32)],
            goal=(goals * self.targets).astype(jnp.int32),
            said=jnp.zeros((self.robots, self.max_vocabulary_size + 1)).at[:, 0].set(1.0),
            time=jnp.int32(0),
        )
        return state, self.observe(state)

    def step(self, key: Key[Array, ""], state: State, action: PerRole) -> tuple[State, Outcome]:
        """Move, speak; then observe and be rewarded in the state reached."""
        del key  # only the start is random
        after = self._move(state, self._executed(action))
        over = jnp.broadcast_to(after.time >= self.steps, self.robots)
        never = jnp.zeros(self.robots, bool)
        distance = distances(after)
        return after, Outcome(
            observation=self.observe(after),
            reward={"mover": -distance, "talker": -distance[after.guides]},
            terminated={"mover": never, "talker": never},
            truncated={"mover": over, "talker": over},
        )

    def observe(self, state: State) -> PerRole:
        """Offsets to the targets and all that was said (eq. 2.2); what a talker knows (eq. 2.3)."""
        offset = (state.target - state.position[:, None]).reshape(self.robots, -1)
        velocity = state.velocity[:, : 2 * self.observe_velocity]
        heard = jnp.broadcast_to(state.said.reshape(-1), (self.robots, state.said.size))
        known = jax.nn.one_hot(state.guides, self.robots)
        goal = jax.nn.one_hot(state.goal[state.guides], self.targets)
        return {
            "mover": jnp.concatenate([offset, velocity, heard], -1),
            "talker": jnp.concatenate([known, goal], -1),
        }

    def scene(self, trajectory: Transition) -> Scene:
        """The first episode: its start, and the state reached in each step."""
        episode = first_episode(self, trajectory)
        return record(jax.tree.map(lambda part: part[0], episode.state), episode.next_state)

    def _executed(self, action: PerRole) -> PerRole:
        if self.execution == "soft":
            return action
        return {
            role: jax.nn.one_hot(weights.argmax(-1), weights.shape[-1])
            for role, weights in action.items()
        }

    def _move(self, state: State, action: PerRole) -> State:
        push = action["mover"] @ jnp.asarray(MOVES, jnp.float32)
        advance = function_of(DYNAMICS, self.dynamics)
        moved = advance(state.position, state.velocity, push, self.delta)
        if not (isinstance(moved, tuple) and len(moved) == 2):
            raise InvalidSettings(
                f"The function dynamics gives {shown(moved)}; allowed: positions and velocities."
            )
        position, velocity = (
            of_shape("dynamics", each, push.shape).astype(push.dtype) for each in moved
        )
        return State(
            position,
            velocity,
            state.target,
            state.guides,
            state.goal,
            action["talker"],
            state.time + 1,
        )


@cache
def derangements(count: int) -> np.ndarray:
    """Every way in which each of some robots guides another one: Int[way, robot]."""
    everyone = range(count)
    ways = [
        way
        for way in permutations(everyone)
        if all(guided != robot for robot, guided in zip(everyone, way, strict=True))
    ]
    return np.array(ways, np.int32)
