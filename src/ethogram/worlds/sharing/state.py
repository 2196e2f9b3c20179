"""What there is in the world of chapter 3 at one moment."""

import equinox as eqx
from jax import Array
from jaxtyping import Bool, Int


class State(eqx.Module):
    """Where the agents are, what they want, who spoke."""

    resource: Int[Array, "agent"]  # u', 0 = none
    preference: Int[Array, "agent"]  # u'', 0 = none
    spoke: Bool[Array, "agent"]  # whether the word W = (u', u'') was said
    time: Int[Array, ""]  # steps since the start
