"""Small worlds whose every number can be checked, and whose best policy is known."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int

from ethogram.core.settings import Number
from ethogram.core.spaces import Box, Discrete, MultiDiscrete, Simplex
from ethogram.core.world import Outcome, Role, World
from ethogram.worlds.language.world import ACCELERATION, DAMPING, MOVES

TARGETS = 3
WORDS = 3  # of the listener's world


class Stand(eqx.Module):
    """A market stand."""

    stock: Float[Array, "seller"]
    mood: Int[Array, ""]  # of the buyer, 0 to 2
    raining: Bool[Array, ""]
    time: Int[Array, ""]


class Market(World):
    """Two sellers and a buyer: roles, spaces and state of every kind, padding, and chance.

    It has no meaning beyond that all it holds depends on all that is done.  Rain on an angry
    buyer ends an episode for good; else it is cut after `steps`.
    """

    steps: int = eqx.field(static=True, default=6)

    @property
    def horizon(self):
        return self.steps

    @property
    def roles(self):  # not in alphabetical order, on purpose
        used = jnp.array([True, False, True])
        return {
            "seller": Role(2, Box(-50.0, 50.0, (3,), used), Simplex(3, used)),
            "buyer": Role(1, MultiDiscrete((2, 3)), Discrete(4)),
        }

    def reset(self, key):
        stock, mood = jax.random.normal(key, (2,)), jax.random.randint(key, (), 0, 3)
        stand = Stand(stock, mood, jnp.bool_(False), jnp.int32(0))
        return stand, self.observe(stand)

    def observe(self, state):
        other = state.stock[::-1]
        return {
            "seller": jnp.stack([state.stock, jnp.zeros(2), other * state.mood], -1),
            "buyer": jnp.stack([state.raining.astype(jnp.int32), state.mood])[None],
        }

    def step(self, key, state, action):
        for_stock, for_mood, for_rain = jax.random.split(key, 3)
        offered, (asked,) = action["seller"], action["buyer"]
        drift = offered[:, 0] - offered[:, 2] + 0.2 * jax.random.normal(for_stock, (2,))
        after = Stand(
            0.5 * state.stock + drift * (1 + asked),
            (state.mood + asked + jax.random.randint(for_mood, (), 0, 2)) % 3,
            jax.random.bernoulli(for_rain, 0.3),
            state.time + 1,
        )
        over = after.raining & (after.mood == 2)
        late = ~over & (after.time >= self.steps)
        earned = after.stock[0] - after.stock[1] + state.mood
        return after, Outcome(
            observation=self.observe(after),
            reward={"seller": after.stock * (1 + after.mood), "buyer": earned[None]},
            terminated={"seller": jnp.tile(over, 2), "buyer": over[None]},
            truncated={"seller": jnp.tile(late, 2), "buyer": late[None]},
        )


class Spot(eqx.Module):
    """Where a hand and its target are."""

    hand: Float[Array, "2"]
    target: Float[Array, "2"]
    time: Int[Array, ""]


class Reach(World):
    """A hand in a square of side 2 moves by up to `pace` an axis, and earns minus its distance.

    It terminates within 0.1 of the target, and is cut after 10 steps.
    """

    pace: Number = eqx.field(default=0.5, converter=jnp.asarray)

    @property
    def horizon(self):
        return 10

    @property
    def roles(self):
        return {"hand": Role(1, Box(-1.0, 3.0, (2, 2)), Box(-self.pace, 2 * self.pace, (2,)))}

    def reset(self, key):
        spot = Spot(jnp.zeros(2), jax.random.uniform(key, (2,), minval=-1.0), jnp.int32(0))
        return spot, self.observe(spot)

    def observe(self, state):
        return {"hand": jnp.stack([state.hand, state.target])[None]}

    def step(self, key, state, action):
        del key  # it moves as it is told
        hand = jnp.clip(state.hand + action["hand"][0], -1.0, 1.0)
        after = Spot(hand, state.target, state.time + 1)
        distance = jnp.abs(hand - state.target).sum()
        return after, Outcome(
            observation=self.observe(after),
            reward={"hand": -distance[None]},
            terminated={"hand": (distance < 0.1)[None]},
            truncated={"hand": ((distance >= 0.1) & (after.time >= 10))[None]},
        )


class Duet(World):
    """A singer and a pianist see the same key; both earn `pay` if both are in it.  One step."""

    pay: Number = eqx.field(default=1.0, converter=jnp.asarray)
    keys: int = eqx.field(static=True, default=3)

    @property
    def horizon(self):
        return 1

    @property
    def roles(self):
        musician = Role(1, Discrete(self.keys), Discrete(self.keys))
        return {"singer": musician, "pianist": musician}

    def reset(self, key):
        tune = jax.random.randint(key, (), 0, self.keys)
        return tune, self.observe(tune)

    def observe(self, state):
        return {"singer": state[None], "pianist": state[None]}

    def step(self, key, state, action):
        del key  # the score is fixed
        together = (action["singer"] == state) & (action["pianist"] == state)
        return state, Outcome(
            observation=self.observe(state),
            reward=dict.fromkeys(self.roles, self.pay * together),
            terminated=dict.fromkeys(self.roles, jnp.zeros(1, bool)),
            truncated=dict.fromkeys(self.roles, jnp.ones(1, bool)),
        )


class Choir(World):
    """Singers on two steps sing one of two notes; each earns what is hers, whatever the note.

    One step, and it is over for good.
    """

    stand: tuple[int, ...] = eqx.field(static=True, default=(0, 0, 0, 1))
    pay: Float[Array, "singer"] = eqx.field(default=(1.0, 2.0, 6.0, 8.0), converter=jnp.asarray)

    @property
    def horizon(self):
        return 1

    @property
    def roles(self):
        return {"singer": Role(len(self.stand), Discrete(2), Discrete(2))}

    def reset(self, key):
        del key  # they always stand alike
        return jnp.int32(0), self.observe(jnp.int32(0))

    def observe(self, state):
        del state
        return {"singer": jnp.array(self.stand)}

    def step(self, key, state, action):
        del key, action
        nobody = jnp.zeros(len(self.stand), bool)
        return state, Outcome(
            observation=self.observe(state),
            reward={"singer": self.pay},
            terminated={"singer": ~nobody},
            truncated={"singer": nobody},
        )


class Recital(World):
    """A singer earns `pay` whenever the pianist plays the chord (2, 1).  One step.

    The step is the end for good if `final`, else a time limit.
    """

    pay: Number = eqx.field(default=1.0, converter=jnp.asarray)
    final: Bool[Array, ""] | bool = eqx.field(default=False, converter=jnp.asarray)

    @property
    def horizon(self):
        return 1

    @property
    def roles(self):
        return {
            "singer": Role(1, Discrete(2), Discrete(2)),
            "pianist": Role(1, Discrete(2), MultiDiscrete((3, 3))),
        }

    def reset(self, key):
        del key  # every recital starts alike
        return jnp.int32(0), self.observe(jnp.int32(0))

    def observe(self, state):
        return {"singer": state[None], "pianist": state[None]}

    def step(self, key, state, action):
        del key  # nothing is left to chance
        right = (action["pianist"] == jnp.array([2, 1])).all(-1)
        return state + 1, Outcome(
            observation=self.observe(state + 1),
            reward=dict.fromkeys(self.roles, self.pay * right),
            terminated=dict.fromkeys(self.roles, self.final[None]),
            truncated=dict.fromkeys(self.roles, ~self.final[None]),
        )


class Place(eqx.Module):
    """Where the mover is, and what it was told."""

    position: Float[Array, "2"]
    velocity: Float[Array, "2"]
    target: Float[Array, "target 2"]
    goal: Int[Array, ""]  # the target that counts
    said: Float[Array, "word"]  # a step ago
    time: Int[Array, ""]


class Listener(World):
    """The speaker and the listener of Lowe et al. (NeurIPS 2017), with three targets.

    The talker sees which target counts; a mover sees all targets and hears the talker.

    Both earn minus the mover's Manhattan distance from the target that counts.  The mover moves
    as in the language world and sees its velocity.  With `channel` 0 it hears nothing.
    """

    channel: Number = eqx.field(default=1.0, converter=jnp.asarray)
    steps: int = eqx.field(static=True, default=25)

    @property
    def horizon(self):
        return self.steps

    @property
    def roles(self):
        seen = Box(-5.0, 5.0, (2 * TARGETS + 2 + WORDS,))
        return {
            "mover": Role(1, seen, Simplex(len(MOVES))),
            "talker": Role(1, Discrete(TARGETS), Simplex(WORDS)),
        }

    def reset(self, key):
        for_places, for_goal = jax.random.split(key)
        position, *target = jax.random.uniform(for_places, (1 + TARGETS, 2))
        goal = jax.random.randint(for_goal, (), 0, TARGETS)
        nothing = jnp.zeros(WORDS)
        place = Place(position, jnp.zeros(2), jnp.stack(target), goal, nothing, jnp.int32(0))
        return place, self.observe(place)

    def observe(self, state):
        offsets = (state.target - state.position).reshape(-1)
        heard = self.channel * state.said
        return {
            "mover": jnp.concatenate([offsets, state.velocity, heard])[None],
            "talker": state.goal[None],
        }

    def step(self, key, state, action):
        del key  # only the start is random
        push = action["mover"][0] @ jnp.asarray(MOVES, jnp.float32)
        velocity = DAMPING * state.velocity + ACCELERATION * push
        after = Place(
            state.position + velocity,
            velocity,
            state.target,
            state.goal,
            action["talker"][0],
            state.time + 1,
        )
        distance = jnp.abs(after.target[after.goal] - after.position).sum()
        everyone = dict.fromkeys(self.roles, jnp.ones(1, bool))
        return after, Outcome(
            observation=self.observe(after),
            reward=dict.fromkeys(self.roles, -distance[None]),
            terminated={role: ~one for role, one in everyone.items()},
            truncated={role: one & (after.time >= self.steps) for role, one in everyone.items()},
        )


class Shift(eqx.Module):
    """A shift at work."""

    luck: Float[Array, "worker"]
    time: Int[Array, ""]


class Rota(World):
    """Three workers on a rota of four steps, who earn by their luck and by what they do.

    The first ends for good after two steps, and then is out.  The second is out for two steps in
    the middle, and its time is up in the end.  The third never acts, and ends for good with the
    episode.
    """

    @property
    def horizon(self):
        return 6  # an episode and the beginning of the next

    @property
    def roles(self):
        return {"worker": Role(3, Box(-5.0, 5.0, (2,)), MultiDiscrete((2, 3)))}

    def reset(self, key):
        shift = Shift(jax.random.normal(key, (3,)), jnp.int32(0))
        return shift, self.observe(shift)

    def observe(self, state):
        return {"worker": jnp.stack([state.luck, jnp.full(3, state.time / 4)], -1)}

    def step(self, key, state, action):
        did = action["worker"]
        after = Shift(0.5 * state.luck + jax.random.normal(key, (3,)), state.time + 1)
        last, time = after.time == 4, state.time
        acting = jnp.array([[1, 1, 0], [1, 0, 0], [0, 0, 0], [0, 1, 0]], bool)
        return after, Outcome(
            observation=self.observe(after),
            reward={"worker": state.luck * did[:, 0] + did[:, 1] * after.luck},
            terminated={"worker": jnp.array([after.time >= 2, False, last])},
            truncated={"worker": jnp.array([False, last, False])},
            acting={"worker": acting[time]},
        )
