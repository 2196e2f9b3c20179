"""Watch trained agents play, with the channel and without, and ask what their words mean."""

from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float, Int, Key

from ethogram.core.rollout import Policy, rollout
from ethogram.core.settings import Number
from ethogram.core.specs import role_specs
from ethogram.core.world import PerRole, Transition
from ethogram.core.wrappers import completed, unwrapped
from ethogram.learners.maddpg import MADDPG, MADDPGState
from ethogram.learners.returns import discounted_return
from ethogram.studies.language.metrics import causal_influence
from ethogram.worlds.language import Language, State
from ethogram.worlds.language.state import distances

LISTENED = 20  # episodes in whose states talkers are made to say every word in turn
_EPISODES = "episodes"  # the axis of episodes played side by side


def watched_bytes(learner: MADDPG, episodes: int) -> int:
    """Memory that `watch` needs: all that is seen in all episodes, and every word tried."""
    roles, steps = role_specs(unwrapped(learner.world)), learner.world.horizon
    mover, talker = roles["mover"], roles["talker"]
    words = talker.action.shape[0]
    seen = mover.agents * (mover.observation.shape[0] + 4 * words)
    tried = LISTENED * words * mover.agents * (mover.observation.shape[0] + learner.hidden_size)
    return 4 * steps * (4 * episodes * seen + 2 * tried)


class Watched(NamedTuple):
    """What a trial's validation shows; returns are sums over all agents and steps."""

    validation: Float[Array, "episode"]
    noise_free: Float[Array, "episode"]
    discounted: Float[Array, "episode"]  # eq. 2.1
    silenced: Float[Array, "episode"]
    scrambled: Float[Array, "episode"]
    meaning: Float[Array, "talker guided target word"]
    influence: Float[Array, "talker listener"]  # bits
    start: State  # of the first episode
    states: State  # that it reached, steps leading


class Mode(NamedTuple):
    """A way to play: with noise or without, heard, not heard, or heard by others."""

    noise: bool = True
    silenced: bool = False
    scrambled: bool = False  # heard is what was said at the same step of another episode


MODES = {
    "validation": Mode(),
    "noise_free": Mode(noise=False),
    "silenced": Mode(silenced=True),
    "scrambled": Mode(scrambled=True),
}


@eqx.filter_jit
def watch(learner: MADDPG, state: MADDPGState, key: Key[Array, ""], episodes: int) -> Watched:
    """Validate a trial: the same starts in every mode, side by side."""
    world = unwrapped(learner.world)
    assert isinstance(world, Language)
    keys = jax.random.split(key, episodes)

    def play(mode: Mode, key: Key[Array, ""]) -> Transition:
        policy = _in_mode(mode, learner, state, episodes)
        transitions: Transition = rollout(world, policy, key, world.horizon)[1]
        return transitions

    over_episodes = jax.vmap(play, (None, 0), axis_name=_EPISODES)
    modes = jax.tree.map(lambda *flags: jnp.array(flags), *MODES.values())
    played = jax.vmap(over_episodes, (0, None))(modes, keys)
    returns = dict(zip(MODES, overall(played).sum(-1), strict=True))
    normal = jax.tree.map(lambda part: part[list(MODES).index("validation")], played)
    return Watched(
        **returns,
        discounted=overall_discounted(normal, learner.discount),
        meaning=meaning(learner, state),
        influence=influence(learner, state, normal.state),
        start=jax.tree.map(lambda part: part[0, 0], normal.state),
        states=jax.tree.map(lambda part: part[0], normal.next_state),
    )


def overall(played: Transition) -> Float[Array, "*batch step"]:
    """Reward of all agents together."""
    return jnp.concatenate([*played.outcome.reward.values()], -1).sum(-1)


def overall_discounted(played: Transition, discount: Number) -> Float[Array, "episode"]:
    """Equation 2.1 from the start: the reward of the initial state, and of the steps after it.

    Every robot counts twice, once for its mover and once for the talker that guides it.
    """
    start = jax.tree.map(lambda part: part[:, 0], played.state)
    first = -2.0 * jax.vmap(distances)(start).sum(-1)
    return discounted_return(jnp.concatenate([first[:, None], overall(played)], 1).T, discount)


def _in_mode(mode: Mode, learner: MADDPG, state: MADDPGState, episodes: int) -> Policy:
    noisy, noise_free = (
        completed(learner.world, learner.policy(state, explore=explore))
        for explore in (True, False)
    )
    to_the_next = [(episode, (episode + 1) % episodes) for episode in range(episodes)]

    def act(key: Key[Array, ""], observation: PerRole) -> PerRole:
        with_noise, without = noisy(key, observation), noise_free(key, observation)
        action = jax.tree.map(partial(jnp.where, mode.noise), with_noise, without)
        said = action["talker"]
        elsewhere = lax.ppermute(said, _EPISODES, to_the_next)  # type: ignore[no-untyped-call]
        silence = jnp.zeros_like(said).at[:, 0].set(1.0)
        heard = jnp.where(mode.scrambled, elsewhere, jnp.where(mode.silenced, silence, said))
        return action | {"talker": heard}

    return act


def meaning(learner: MADDPG, state: MADDPGState) -> Float[Array, "talker guided target word"]:
    """The chance of each word for each association; NaN where a robot would guide itself.

    Padding is cut off by the caller, who knows the alphabet's size.
    """
    world = unwrapped(learner.world)
    assert isinstance(world, Language)
    start, _ = world.reset(jax.random.key(0))

    def speak(guided: Int[Array, ""], target: Int[Array, ""]) -> Float[Array, "talker word"]:
        known = eqx.tree_at(
            lambda at: (at.guides, at.goal),
            start,
            (jnp.full_like(start.guides, guided), jnp.full_like(start.goal, target)),
        )
        return _chances("talker", learner, state, known)

    robots = jnp.arange(world.robots)
    over_targets = jax.vmap(speak, (None, 0))
    spoken = jax.vmap(over_targets, (0, None))(robots, jnp.arange(world.targets))
    itself = (robots[:, None] == robots)[:, :, None, None]
    return jnp.where(itself, jnp.nan, jnp.moveaxis(spoken, 2, 0))


def influence(
    learner: MADDPG, state: MADDPGState, states: State
) -> Float[Array, "talker listener"]:
    """How much each talker's word changes each robot's choice of a move, in bits.

    Args:
        learner: the learner.
        state: of the learner.
        states: those met, with leading axes of episodes and steps; the first few are used.

    """
    world = unwrapped(learner.world)
    assert isinstance(world, Language)
    met = jax.tree.map(lambda part: part[:LISTENED].reshape(-1, *part.shape[2:]), states)
    words = jnp.eye(world.max_vocabulary_size + 1)

    def listen(
        met: State, talker: Int[Array, ""], word: Float[Array, "word"]
    ) -> Float[Array, "listener move"]:
        heard = eqx.tree_at(lambda at: at.said, met, met.said.at[talker].set(word))
        return _chances("mover", learner, state, heard)

    def influence_of(talker: Int[Array, ""]) -> Float[Array, "listener"]:
        over_words = jax.vmap(listen, (None, None, 0))
        moves = jax.vmap(over_words, (0, None, None))(met, talker, words)
        prior = world.vocabulary_mask / world.vocabulary_mask.sum()
        return jax.vmap(causal_influence, (2, None))(moves, prior)

    return lax.map(influence_of, jnp.arange(world.robots))


def _chances(
    role: str, learner: MADDPG, state: MADDPGState, at: State
) -> Float[Array, "agent choice"]:
    """How likely each choice of each agent is: what is drawn from, or what a given policy says."""
    observation = unwrapped(learner.world).observe(at)
    if role not in learner.world.roles:
        policy = completed(learner.world, learner.policy(state))
        return policy(jax.random.key(0), observation)[role]
    return jax.nn.softmax(learner.actor_outputs(state, observation)[role])
