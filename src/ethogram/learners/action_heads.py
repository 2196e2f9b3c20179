"""Actions from the outputs of a network, differentiable in them.

Outputs for a `Discrete` or `Simplex` space are the logits of choices, which the Gumbel-softmax
(`ethogram.learners.distributions`) turns into weights.  Those for a `Box` with finite bounds are
squashed into it, low + (high - low) (1 + tanh z) / 2; exploration adds Gaussian noise.

An action is encoded as critics read it (`ethogram.learners.networks.features`): weights of choices,
or the numbers of a box in a row.
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Key

from ethogram.core.errors import EthogramError
from ethogram.core.settings import Number
from ethogram.core.spaces import Box, Discrete, Simplex, Space
from ethogram.learners.distributions import gumbel_softmax
from ethogram.learners.networks import MLP, used_features

HEADS = (Discrete, Simplex, Box)
OUT_OF_REACH = -1e9  # a logit that no noise lifts


def require_head(owner: str, role: str, space: Space) -> None:
    """Refuse a space of actions that no head acts in.

    Raises:
        EthogramError: the space is neither `Discrete` nor `Simplex` nor a bounded `Box`.

    """
    if not isinstance(space, HEADS):
        raise EthogramError(
            f"{owner} needs actions that are Discrete, Simplex or Box; those of {role!r} are "
            f"{type(space).__name__}."
        )
    if isinstance(space, Box) and not space.is_bounded:
        raise EthogramError(
            f"{owner} needs boxes of actions with finite bounds; that of {role!r} is {space}."
        )


def reachable(
    space: Space, outputs: Float[Array, "*batch output"]
) -> Float[Array, "*batch output"]:
    """Outputs in which choices that there are not are out of reach."""
    if isinstance(space, Box):
        return outputs
    return jnp.where(used_features(space), outputs, OUT_OF_REACH)


def outputs_of_actors(
    space: Space, actors: Sequence[MLP], encoded: Float[Array, "*batch agent feature"]
) -> Float[Array, "*batch agent output"]:
    """The outputs of a role's actors, each of what its own agent observes."""
    outputs = jnp.stack([actor(encoded[..., i, :]) for i, actor in enumerate(actors)], -2)
    return reachable(space, outputs)


def encoded_action(
    space: Space,
    key: Key[Array, ""] | None,
    outputs: Float[Array, "*batch output"],
    temperature: Number,
    *,
    straight_through: bool = False,
) -> Float[Array, "*batch feature"]:
    """The action as critics read it; a choice is drawn, unless there is no key."""
    if isinstance(space, Box):
        return squash(space, outputs)
    hard = straight_through or isinstance(space, Discrete)
    return gumbel_softmax(key, outputs, temperature, straight_through=hard)


def decoded_action(space: Space, encoded: Float[Array, "*batch feature"]) -> Array:
    """The action as the world takes it."""
    if isinstance(space, Discrete):
        return encoded.argmax(-1)
    return encoded.reshape(*encoded.shape[:-1], *space.shape)


def action_shares(
    space: Space, encoded: Float[Array, "*batch feature"]
) -> Float[Array, "*batch feature"]:
    """An encoded action as numbers from 0 to 1: weights of choices, or where in the box it is."""
    if not isinstance(space, Box):
        return encoded
    low, high = _bounds(space)
    return jnp.where(high > low, (encoded - low) / jnp.where(high > low, high - low, 1.0), 0.0)


def squash(space: Box, outputs: Float[Array, "*batch output"]) -> Float[Array, "*batch output"]:
    """Outputs as numbers within the bounds of a box; padding is 0."""
    low, high = _bounds(space)
    inside = low + (high - low) * (1 + jnp.tanh(outputs)) / 2
    return jnp.where(used_features(space), inside, 0.0)


def with_noise(
    space: Box, key: Key[Array, ""], encoded: Float[Array, "*batch feature"], scale: Number
) -> Float[Array, "*batch feature"]:
    """Gaussian noise added within the bounds, its deviation a share of half their distance."""
    low, high = _bounds(space)
    noise = scale * (high - low) / 2 * jax.random.normal(key, encoded.shape)
    return jnp.where(used_features(space), jnp.clip(encoded + noise, low, high), 0.0)


def _bounds(space: Box) -> tuple[Float[Array, "feature"], Float[Array, "feature"]]:
    low, high = (
        jnp.broadcast_to(jnp.asarray(bound, jnp.float32), space.shape).reshape(-1)
        for bound in (space.low, space.high)
    )
    return low, high
