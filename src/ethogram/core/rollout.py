"""Run a policy through a world, episode after episode.

A world never resets itself; `rollout` does, once every agent's episode has ended, and keeps the
observation that the ended episode reached.  For a batch, `vmap` over keys.  `watch` plays one
episode and shows it.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Bool, Key

from ethogram.core.batching import in_any_copy
from ethogram.core.errors import EthogramError, require_count, shown
from ethogram.core.keys import require_key
from ethogram.core.memory import require_memory
from ethogram.core.scene import Scene
from ethogram.core.specs import state_spec
from ethogram.core.world import Outcome, PerRole, Transition, World

Policy = Callable[[Key[Array, ""], PerRole], PerRole]  # (key, observation) -> action
PolicyWithExtras = Callable[[Key[Array, ""], PerRole], tuple[PerRole, Any]]  # -> action, extras


class Position(eqx.Module):
    """Where a rollout stands: enough to go on with it."""

    state: Any
    observation: PerRole


def rollout(
    world: World,
    policy: Policy | PolicyWithExtras,
    key: Key[Array, ""],
    steps: int,
    start: Position | None = None,
    *,
    keep: Callable[[Transition], Any] = lambda transition: transition,
) -> tuple[Position, Any]:
    """Take `steps` steps, from a fresh episode or from where an earlier rollout stopped.

    Args:
        world: any world.
        policy: `policy(key, observation) -> action`, per role; or `-> (action, extras)`, whose
            second part the transitions hold as `extras`.
        key: consumed; draws the resets, the policy's choices and the world's chance.
        steps: how many steps, over as many episodes as they hold.
        start: the position returned by an earlier call; None resets the world.
        keep: what of each `Transition` is stored; all of it, unless a function says what.

    Returns:
        The position reached, and what was kept of the transitions with a leading axis of `steps`.

    Raises:
        EthogramError: the policy is no function, the key no random key, or there are fewer than 0
            steps.

    """
    require_policy("rollout", policy)
    require_key("rollout", key)
    require_count("rollout", "steps", steps)
    first, key = jax.random.split(key)
    if start is None:
        start = Position(*world.reset(first))

    def advance(at: Position, key: Key[Array, ""]) -> tuple[Position, Any]:
        for_policy, for_world, for_reset = jax.random.split(key, 3)
        chosen = policy(for_policy, at.observation)
        action, extras = chosen if isinstance(chosen, tuple) else (chosen, None)
        state, outcome = world.step(for_world, at.state, action)
        episode_end = episode_ended(outcome)
        reached = Position(state, outcome.observation)

        def renewed() -> Position:
            fresh = Position(*world.reset(for_reset))
            return jax.tree.map(lambda new, old: jnp.where(episode_end, new, old), fresh, reached)

        after = lax.cond(in_any_copy(episode_end), renewed, lambda: reached)
        transition = Transition(
            for_world, at.state, at.observation, action, outcome, state, episode_end, extras
        )
        return after, keep(transition)

    return lax.scan(advance, start, jax.random.split(key, steps))


def watch(world: World, policy: Policy, key: Key[Array, ""]) -> Scene:
    """Play one episode and record what it looked like; at the end of a notebook's cell, a replay.

    `watch(world, policy, key).save("episode.html")`, or .gif, .webp, .mp4, writes it to a file.

    Args:
        world: one that draws scenes.
        policy: `policy(key, observation) -> action`, per role.
        key: consumed, as by `rollout`; the same key shows the same episode.

    Raises:
        TooLarge: the states of an episode would not fit in memory; the message names the size.
        EthogramError: the world draws no scenes.

    """
    start = jax.tree.leaves(jax.eval_shape(world.reset, key))
    each = sum(part.size * part.dtype.itemsize for part in start)
    # of every step two states are kept, the one left and the one reached
    require_memory(f"An episode of {world.horizon} steps", 2 * world.horizon * each)
    return world.scene(_episode(world, policy, key))


@eqx.filter_jit
def _episode(world: World, policy: Policy, key: Key[Array, ""]) -> Transition:
    transitions: Transition = rollout(world, policy, key, world.horizon)[1]
    return transitions


def require_policy(what: str, policy: Any) -> None:
    """Refuse what is no policy, of a world or of a role.

    Raises:
        EthogramError: it is no function.

    """
    if not callable(policy):
        raise EthogramError(
            f"{what}: policy = {shown(policy)}; allowed: a function (key, observation) -> action."
        )


def first_episode(world: World, trajectory: Transition) -> Transition:
    """The steps of a trajectory up to and with the first that ended an episode, or else all.

    Args:
        world: whose scene is to be drawn.
        trajectory: transitions with the steps as leading axis.

    Raises:
        EthogramError: the trajectory is none, or that of another world, a batch of them or a single
            step, or has no steps.

    """
    if not isinstance(trajectory, Transition):
        raise EthogramError(
            f"{type(world).__name__}.scene: {shown(trajectory)} is no trajectory; allowed: the "
            "transitions that rollout(world, ...) returns."
        )
    axes = trajectory.episode_end.shape
    if len(axes) != 1 or not axes[0]:
        raise EthogramError(
            "A scene shows one trajectory, whose arrays have its steps as their first axis; here "
            f"the leading axes are {axes}. Of a batch take one: "
            "jax.tree.map(lambda part: part[0], trajectory)."
        )
    found = jax.tree.map(lambda part: part.shape[1:], trajectory.state)
    if not eqx.tree_equal(found, jax.tree.map(lambda part: part.shape, state_spec(world))):
        raise EthogramError(
            f"{type(world).__name__}.scene: the trajectory's states are not those of "
            f"{shown(world)}; allowed: transitions of the same world."
        )
    ended = np.flatnonzero(trajectory.episode_end)
    steps = int(ended[0]) + 1 if ended.size else axes[0]
    return jax.tree.map(lambda part: part[:steps], trajectory)


def episode_ended(outcome: Outcome) -> Bool[Array, ""]:
    """Whether the episode of every agent of every role has ended."""
    ended = [
        (outcome.terminated[role] | outcome.truncated[role]).all() for role in outcome.terminated
    ]
    return jnp.stack(ended).all()
