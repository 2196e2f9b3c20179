"""Watch trained agents play greedily, and keep what the chapter's figures and tables need."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float, Int, Key

from ethogram.core.keys import fold_in
from ethogram.core.rollout import rollout
from ethogram.core.world import Transition
from ethogram.learners.qlearning import QLearning, QLearningState
from ethogram.worlds.sharing import Sharing, State

ACTS = ("confirm, silent", "confirm, speaking", "change, silent", "change, speaking")
TRANSITION_BYTES = 64  # about what one agent's step takes while an episode is watched


class Seen(NamedTuple):
    """What an episode shows, or the mean over episodes."""

    displacement: Float[Array, "step"]  # eq. 3.14
    communication: Float[Array, "step"]  # eq. 3.15
    reward: Float[Array, "step"]  # eq. 3.16
    acts: Float[Array, "step act"]  # share of agents that did each of `ACTS`


class Episode(NamedTuple):
    """An episode in full."""

    state: State  # states reached, steps leading
    reward: Float[Array, "step agent"]


class Watched(NamedTuple):
    """The validation of all trials."""

    return_: Float[Array, "trial episode agent"]
    mean: Seen  # over episodes; trials leading
    first: Episode  # the first episode; trials leading


@eqx.filter_jit
def watch(
    learner: QLearning,
    state: QLearningState,
    keys: Key[Array, "trial"],
    episodes: int,
    *,
    explore: bool,
) -> Watched:
    """Validate all trials side by side, one episode after the other to keep memory low."""
    world = learner.world
    assert isinstance(world, Sharing)

    def play(state: QLearningState, key: Key[Array, ""]) -> Transition:
        policy = learner.policy(state, explore=explore)
        transitions: Transition = rollout(world, policy, key, world.steps)[1]
        return transitions

    def watch_one(
        so_far: tuple[Seen, Episode], number: Int[Array, ""]
    ) -> tuple[tuple[Seen, Episode], Float[Array, "trial agent"]]:
        total, first = so_far
        played = jax.vmap(play)(state, fold_in(keys, number))
        seen = jax.vmap(lambda one: summarise(one, world))(played)
        episode = Episode(played.next_state, played.outcome.reward["agent"])
        first = jax.tree.map(lambda new, old: jnp.where(number == 0, new, old), episode, first)
        return (jax.tree.map(jnp.add, total, seen), first), episode.reward.sum(1)

    nothing = _nothing(len(keys), world)
    (total, first), returns = lax.scan(watch_one, nothing, jnp.arange(episodes))
    mean = jax.tree.map(lambda part: part / episodes, total)
    return Watched(returns.swapaxes(0, 1), mean, first)


def summarise(played: Transition, world: Sharing) -> Seen:
    """Reduce an episode (steps leading) to what is kept of it."""
    state: State = played.next_state
    before = jnp.pad(state.preference[:-1], ((1, 0), (0, 0)))
    act = 2 * (state.preference != before) + state.spoke
    even = world.agents / world.resources
    return Seen(
        displacement=jnp.abs(played.outcome.metrics["filling"] - even).sum(-1),
        communication=state.spoke.mean(1),
        reward=played.outcome.reward["agent"].mean(1),
        acts=(act[..., None] == jnp.arange(len(ACTS))).mean(1),
    )


def _nothing(trials: int, world: Sharing) -> tuple[Seen, Episode]:
    """No episode yet: zeros in the shapes of what is to come."""
    steps, agents = world.steps, world.agents
    per_step = jnp.zeros((trials, steps))
    per_agent = jnp.zeros((trials, steps, agents), jnp.int32)
    state = jax.vmap(jax.vmap(State))(
        per_agent, per_agent, per_agent > 0, jnp.zeros((trials, steps), jnp.int32)
    )
    seen = Seen(per_step, per_step, per_step, jnp.zeros((trials, steps, len(ACTS))))
    return seen, Episode(state, jnp.zeros((trials, steps, agents)))
