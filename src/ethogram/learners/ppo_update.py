"""How proximal policy optimisation improves a policy by steps that were played with it."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float, Int, Key

from ethogram.core.settings import Number
from ethogram.core.spaces import Space
from ethogram.learners.action_distributions import action_distribution
from ethogram.learners.losses import clipped_surrogate, clipped_value_error, masked_mean
from ethogram.learners.optimisation import Moments, clip_global_norm, descend
from ethogram.learners.policy_network import PolicyNetwork

SMALLEST_DEVIATION = 1e-8  # of advantages

Diagnostics = dict[str, Array]  # by name


class Minibatch(eqx.Module):
    """Steps as a policy learns from them."""

    observation: Float[Array, "batch feature"]
    judged: Float[Array, "batch input"]  # what the critic reads
    drawn: Array  # what became the action (`ethogram.learners.action_distributions`)
    outputs: Float[Array, "batch output"]  # of the actor that drew it
    value: Float[Array, "batch"]  # what the critic said then
    advantage: Float[Array, "batch"]
    target: Float[Array, "batch"]  # of the value
    counted: Bool[Array, "batch"]


class Objective(NamedTuple):
    """The coefficients of what is minimised."""

    clip: Number  # epsilon
    value_clip: Number  # 0 for none
    value_coefficient: Number  # c1
    entropy_coefficient: Number  # c2
    kl_coefficient: Number  # beta


def ppo_loss(
    network: PolicyNetwork,
    batch: Minibatch,
    old_log_std: Float[Array, "number"],
    space: Space,
    objective: Objective,
) -> tuple[Float[Array, ""], Diagnostics]:
    """The loss of proximal policy optimisation, differentiable in the network.

    Args:
        network: actor and critic.
        batch: steps.
        old_log_std: the logarithms of the deviations by which these actions were drawn.
        space: of the actions.
        objective: coefficients.

    Returns:
        The loss, and `policy_loss`, `value_loss`, `entropy`, `kl` and `clip_fraction`.

    """
    outputs, value = network(batch.observation, batch.judged)
    old = action_distribution(space, batch.outputs, old_log_std)
    new = action_distribution(space, outputs, network.log_std)
    ratio = jnp.exp(new.log_prob(batch.drawn) - old.log_prob(batch.drawn))
    surrogate = clipped_surrogate(ratio, batch.advantage, objective.clip)
    error = clipped_value_error(value, batch.value, batch.target, objective.value_clip)
    found = {
        "policy_loss": -surrogate,
        "value_loss": error,
        "entropy": new.entropy(),
        "kl": old.kl(new),
        "clip_fraction": (jnp.abs(ratio - 1) > objective.clip).astype(jnp.float32),
    }
    found = {name: masked_mean(values, batch.counted) for name, values in found.items()}
    loss = (  # Schulman et al. (2017), minus eq. 9, and the penalty of eq. 8
        found["policy_loss"]
        + objective.value_coefficient * found["value_loss"]
        - objective.entropy_coefficient * found["entropy"]
        + objective.kl_coefficient * found["kl"]
    )
    return loss, found


class Descent(NamedTuple):
    """How an update goes through its samples."""

    minibatch_size: int
    epochs: int
    learning_rate: Number
    max_gradient_norm: Number  # of the gradient as a whole; 0 for no limit


def learn(
    key: Key[Array, ""],
    network: PolicyNetwork,
    moments: Moments,
    gather: Callable[[Int[Array, "batch"], Bool[Array, "batch"]], Minibatch],
    samples: int,
    space: Space,
    objective: Objective,
    descent: Descent,
) -> tuple[PolicyNetwork, Moments, Diagnostics]:
    """Descend on the loss, epoch after epoch, minibatch by minibatch.

    Args:
        key: consumed; draws the minibatches.
        network: that played.
        moments: of Adam.
        gather: from numbers of samples, and which of these are any, to a minibatch.
        samples: how many there are.
        space: of the actions.
        objective: coefficients of the loss.
        descent: in which steps.

    Returns:
        The network and the moments after, and means of each epoch's diagnostics (`ppo_loss`).

    """
    old_log_std = network.log_std
    gradient_of = jax.value_and_grad(ppo_loss, has_aux=True)
    limit = jnp.asarray(descent.max_gradient_norm)
    largest = jnp.where(limit > 0, limit, jnp.inf)

    def step(at: tuple[Any, Any], drawn: tuple[Array, Array]) -> tuple[tuple[Any, Any], Any]:
        batch = gather(*drawn)
        (_, found), gradient = gradient_of(at[0], batch, old_log_std, space, objective)
        clipped = clip_global_norm(gradient, largest)
        after = descend(at[0], clipped, at[1], descent.learning_rate)
        learns = batch.counted.any()
        return jax.tree.map(lambda new, old: jnp.where(learns, new, old), after, at), found

    def epoch(at: tuple[Any, Any], key: Key[Array, ""]) -> tuple[tuple[Any, Any], Any]:
        at, found = lax.scan(step, at, shuffled(key, samples, descent.minibatch_size))
        return at, jax.tree.map(lambda values: values.mean(0), found)

    keys = jax.random.split(key, descent.epochs)
    (network, moments), found = lax.scan(epoch, (network, moments), keys)
    return network, moments, found


def shuffled(
    key: Key[Array, ""], samples: int, minibatch_size: int
) -> tuple[Int[Array, "minibatch sample"], Bool[Array, "minibatch sample"]]:
    """The numbers of all samples in random order, in minibatches; and which of them are any.

    The last minibatch is filled up with what is none.
    """
    size = min(minibatch_size, samples)
    count = -(-samples // size)
    order = jax.random.permutation(key, samples)
    order = jnp.zeros(count * size, order.dtype).at[:samples].set(order)
    return order.reshape(count, size), (jnp.arange(count * size) < samples).reshape(count, size)


def standardized(
    advantage: Float[Array, "*batch"], counted: Bool[Array, "*batch"]
) -> Float[Array, "*batch"]:
    """Advantages less their mean, over their deviation, of those that count."""
    centred = advantage - masked_mean(advantage, counted)
    variance = masked_mean(jnp.square(centred), counted)
    return centred / (jnp.sqrt(variance) + SMALLEST_DEVIATION)
