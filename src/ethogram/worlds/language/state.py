"""What there is in the world of chapter 2 at one moment."""

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Int


class State(eqx.Module):
    """Robots, targets, who knows what, and what was said."""

    position: Float[Array, "robot 2"]
    velocity: Float[Array, "robot 2"]
    target: Float[Array, "target 2"]
    guides: Int[Array, "robot"]  # the robot whose target this robot knows
    goal: Int[Array, "robot"]  # this robot's own target, which it does not know
    said: Float[Array, "robot word"]  # by each robot a step ago; word 0 is silence
    time: Int[Array, ""]  # steps since the start


def distances(state: State) -> Float[Array, "robot"]:
    """Manhattan distance of each robot from its own target."""
    return jnp.abs(state.target[state.goal] - state.position).sum(-1)
