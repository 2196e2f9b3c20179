"""What a place on a resource pays, as a function of how many share it (eqs. 3.6 to 3.8).

The printed cooperative and mixed rewards divide by n_a n_r; Table 3.2's 99.0 over 99 active
steps needs a maximum of 1 per step, hence by default rho / n_a and rho / (n_a / n_r).
`reward="literal"` keeps the printed division.  The competitive reward stands as printed.

A function of one's own takes their place: from the filling of every resource, the number of agents
and the number of resources to what each agent on each resource earns.
"""

from collections.abc import Callable
from typing import Literal

import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Int

from ethogram.core.settings import of_shape

Scenario = Literal["cooperative", "competitive", "mixed"]
Reading = Literal["scaled", "literal"]

# filling Float[resource], agents, resources -> reward Float[resource]
Reward = Callable[[Array, int, int], Array]


def cooperative(
    filling: Float[Array, "..."], agents: int, resources: int, *, literal: bool = False
) -> Float[Array, "..."]:
    """The more crowded, the better: rho / n_a (eq. 3.6)."""
    return filling / (agents * resources if literal else agents)


def competitive(
    filling: Float[Array, "..."], agents: int, resources: int, *, literal: bool = False
) -> Float[Array, "..."]:
    """The less crowded, the better: max(0, (k + 1 - rho) / k) with k = n_a / n_r (eq. 3.7)."""
    del literal  # printed as meant
    capacity = agents / resources
    return jnp.maximum(0.0, (capacity + 1 - filling) / capacity)


def mixed(
    filling: Float[Array, "..."], agents: int, resources: int, *, literal: bool = False
) -> Float[Array, "..."]:
    """Rising to capacity k = n_a / n_r, then max(0, k - rho + 1) (eq. 3.8)."""
    capacity = agents / resources
    below = filling / (agents * resources if literal else capacity)
    return jnp.where(filling <= capacity, below, jnp.maximum(0.0, capacity - filling + 1))


REWARDS = {"cooperative": cooperative, "competitive": competitive, "mixed": mixed}


def reward_of_filling(
    filling: Int[Array, "resource"],
    scenario: Int[Array, ""] | int | Reward,
    agents: int,
    resources: int,
    *,
    literal: bool = False,
) -> Float[Array, "resource"]:
    """Reward of each agent on each resource.

    Args:
        filling: agents on each.
        scenario: a place in `REWARDS`, counted from 0, or a function.
        agents: how many there are.
        resources: how many there are.
        literal: divide as printed.

    Raises:
        InvalidSettings: a function gives something else than a number for each resource.

    """
    shared = filling.astype(jnp.float32)
    if callable(scenario):
        return of_shape("scenario", scenario(shared, agents, resources), shared.shape)
    every = [reward(shared, agents, resources, literal=literal) for reward in REWARDS.values()]
    return jnp.stack(every)[scenario]
