"""Hand-made policies of the unknown-target game: two ways to talk, two ways to move.

Talkers (thesis, section 2.4.3): `NoCommunication` is always silent, `Optimal` has a symbol for
every association of a robot with a target.  Movers, as references for what can be reached:
`Informed` is told its own target by optimal talkers, `Uninformed` listens to nobody.

Each is a policy of one role, `(key, observation) -> weights` with the role's agents as leading
axis; `ethogram.core.wrappers.RolePolicies` makes a policy of the whole world of one per role.

Movers know offsets and no velocity.  With o the offset of a goal, per axis, they accelerate by
a = sign(o) |k o|^q, divided by max(1, |a|_1): weights of the moves, hence for `execution="soft"`.
k and q were tuned for the damped dynamics; the policies are good, not proven optimal.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Key

from ethogram.core.errors import InvalidSettings
from ethogram.core.module import Module
from ethogram.worlds.language.world import MOVES, Language


class Pull(NamedTuple):
    """How strongly an offset accelerates: |k o|^q."""

    gain: float  # k, 1 / side of the square
    power: float  # q


INFORMED = Pull(15.0, 0.85)
UNINFORMED = {1: INFORMED, 2: Pull(20.0, 2.0), 3: Pull(20.0, 1.2), 4: Pull(20.0, 1.5)}  # by n_t


class NoCommunication(Module):
    """Talkers that never speak (eq. 2.7): they need no symbol, hence `vocabulary_size=0`."""

    words: int = eqx.field(static=True)

    def __init__(self, world: Language) -> None:
        self.words = world.max_vocabulary_size + 1

    def __call__(
        self, key: Key[Array, ""], observation: Float[Array, "robot known"]
    ) -> Float[Array, "robot word"]:
        """Silence, word 0."""
        del key
        return jnp.zeros((len(observation), self.words)).at[:, 0].set(1.0)


class Optimal(Module):
    """Talkers that say what they know: robot r, target t is symbol 1 + r n_t + t (eq. 2.8).

    Raises:
        InvalidSettings: the vocabulary has fewer symbols than there are associations.

    """

    words: int = eqx.field(static=True)

    def __init__(self, world: Language) -> None:
        _require_symbols(world)
        self.words = world.max_vocabulary_size + 1

    def __call__(
        self, key: Key[Array, ""], observation: Float[Array, "robot known"]
    ) -> Float[Array, "robot word"]:
        """The one symbol for what each talker knows."""
        del key
        robots = len(observation)
        guided, target = observation[:, :robots], observation[:, robots:]
        symbol = (guided[:, :, None] * target[:, None]).reshape(robots, -1)
        return jnp.pad(symbol, ((0, 0), (1, self.words - 1 - symbol.shape[1])))


class Informed(Module):
    """Movers that go to their own target, once `Optimal` talkers have named it.

    Robot r looks, in all that was said, for one of the symbols 1 + r n_t to (r + 1) n_t; as long
    as there is none, at the first step that is, it goes to the mean of the targets.

    Raises:
        InvalidSettings: the vocabulary is too small for optimal talkers.

    """

    targets: int = eqx.field(static=True)
    words: int = eqx.field(static=True)

    def __init__(self, world: Language) -> None:
        _require_symbols(world)
        self.targets = world.targets
        self.words = world.max_vocabulary_size + 1

    def __call__(
        self, key: Key[Array, ""], observation: Float[Array, "robot seen"]
    ) -> Float[Array, "robot move"]:
        """Accelerate towards the target heard of."""
        del key
        own = self._heard_of_oneself(observation)
        told = own.sum(-1, keepdims=True)
        belief = jnp.where(told > 0, own / jnp.where(told > 0, told, 1.0), 1 / self.targets)
        goal = jnp.einsum("rt,rta->ra", belief, _offsets(observation, self.targets))
        return steer(goal, INFORMED)

    def _heard_of_oneself(
        self, observation: Float[Array, "robot seen"]
    ) -> Float[Array, "robot target"]:
        robots = len(observation)
        said = observation[0, -robots * self.words :].reshape(robots, self.words)  # all hear alike
        symbols = said.sum(0)[1 : 1 + robots * self.targets]
        return symbols.reshape(robots, self.targets)


class Uninformed(Module):
    """Movers that keep close to all targets: per axis, to the middle of their median interval."""

    targets: int = eqx.field(static=True)

    def __init__(self, world: Language) -> None:
        self.targets = world.targets

    def __call__(
        self, key: Key[Array, ""], observation: Float[Array, "robot seen"]
    ) -> Float[Array, "robot move"]:
        """Accelerate towards the median."""
        del key
        middle = jnp.median(_offsets(observation, self.targets), axis=1)
        return steer(middle, UNINFORMED[min(self.targets, max(UNINFORMED))])


def steer(offset: Float[Array, "robot 2"], pull: Pull) -> Float[Array, "robot move"]:
    """Weights of the moves, 1 together, that accelerate towards a goal at some offset."""
    push = jnp.sign(offset) * jnp.abs(pull.gain * offset) ** pull.power
    push = push / jnp.maximum(1.0, jnp.abs(push).sum(-1, keepdims=True))
    directed = jnp.maximum(0.0, push @ jnp.asarray(MOVES[1:], jnp.float32).T)
    rest = jnp.maximum(0.0, 1.0 - directed.sum(-1, keepdims=True))
    return jnp.concatenate([rest, directed], -1)


def _offsets(
    observation: Float[Array, "robot seen"], targets: int
) -> Float[Array, "robot target 2"]:
    return observation[:, : 2 * targets].reshape(-1, targets, 2)


def _require_symbols(world: Language) -> None:
    needed = world.robots * world.targets
    known = not isinstance(world.vocabulary_size, jax.core.Tracer)
    symbols = int(world.vocabulary_size) if known else world.max_vocabulary_size
    if symbols < needed:
        raise InvalidSettings(
            f"Optimal talkers of {world.robots} robots and {world.targets} targets need {needed} "
            f"symbols; the vocabulary has {symbols}."
        )
