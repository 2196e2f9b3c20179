"""Two tasks of classical control as worlds, with the equations of Gymnasium 1.

CartPole: Barto, Sutton & Anderson (1983), with frictionless joints, Euler's method in steps of
0.02 s; `CartPole-v1` starts uniformly within 0.05, ends beyond 2.4 m or 12 degrees, and is cut
after 500 steps.  Pendulum: `Pendulum-v1`, semi-implicit steps of 0.05 s, cut after 200.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Int

from ethogram.core.spaces import Box, Discrete
from ethogram.core.world import Outcome, Role, World

GRAVITY, FORCE, STEP = 9.8, 10.0, 0.02  # m/s2, N, s
CART, POLE, HALF_LENGTH = 1.0, 0.1, 0.5  # kg, kg, m
MOST_SWAY, MOST_TILT = 2.4, 12 * jnp.pi / 180  # m, rad


class Motion(eqx.Module):
    """What moves, and for how many steps it has."""

    at: Float[Array, "number"]
    time: Int[Array, ""]


class CartPole(World):
    """A cart that is pushed left or right, and should keep its pole upright."""

    @property
    def horizon(self):
        return 500

    @property
    def roles(self):
        return {"cart": Role(1, Box(-jnp.inf, jnp.inf, (4,)), Discrete(2))}

    def reset(self, key):
        at = jax.random.uniform(key, (4,), minval=-0.05, maxval=0.05)
        return Motion(at, jnp.int32(0)), {"cart": at[None]}

    def observe(self, state):
        return {"cart": state.at[None]}

    def step(self, key, state, action):
        del key  # nothing is left to chance
        _, v, angle, spin = state.at
        force = jnp.where(action["cart"][0] == 1, FORCE, -FORCE)
        sine, cosine, mass = jnp.sin(angle), jnp.cos(angle), CART + POLE
        pull = (force + POLE * HALF_LENGTH * spin**2 * sine) / mass
        inertia = HALF_LENGTH * (4 / 3 - POLE * cosine**2 / mass)
        turn = (GRAVITY * sine - cosine * pull) / inertia
        push = pull - POLE * HALF_LENGTH * turn * cosine / mass
        at = state.at + STEP * jnp.stack([v, push, spin, turn])
        after = Motion(at, state.time + 1)
        fallen = (jnp.abs(at[0]) > MOST_SWAY) | (jnp.abs(at[2]) > MOST_TILT)
        return after, Outcome(
            observation=self.observe(after),
            reward={"cart": jnp.ones(1)},
            terminated={"cart": fallen[None]},
            truncated={"cart": (~fallen & (after.time >= 500))[None]},
        )


class Pendulum(World):
    """A pendulum that should swing up and stand, with a torque that is too weak to lift it."""

    @property
    def horizon(self):
        return 200

    @property
    def roles(self):
        return {"joint": Role(1, Box(-8.0, 8.0, (3,)), Box(-2.0, 2.0, (1,)))}

    def reset(self, key):
        reach = jnp.array([jnp.pi, 1.0])
        state = Motion(jax.random.uniform(key, (2,), minval=-reach, maxval=reach), jnp.int32(0))
        return state, self.observe(state)

    def observe(self, state):
        angle, spin = state.at
        return {"joint": jnp.stack([jnp.cos(angle), jnp.sin(angle), spin])[None]}

    def step(self, key, state, action):
        del key  # nothing is left to chance
        (angle, spin), (torque,) = state.at, action["joint"][0]
        off = (angle + jnp.pi) % (2 * jnp.pi) - jnp.pi
        cost = off**2 + 0.1 * spin**2 + 0.001 * torque**2
        spin = jnp.clip(spin + 0.05 * (15.0 * jnp.sin(angle) + 3.0 * torque), -8.0, 8.0)
        after = Motion(jnp.stack([angle + 0.05 * spin, spin]), state.time + 1)
        return after, Outcome(
            observation=self.observe(after),
            reward={"joint": -cost[None]},
            terminated={"joint": jnp.zeros(1, bool)},
            truncated={"joint": (after.time >= 200)[None]},
        )
