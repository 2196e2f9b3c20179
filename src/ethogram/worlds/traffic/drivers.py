"""Hand-made drivers: models of people, and simple policies as references.

A driver is a policy of one role, `(key, observation) -> actions`, made for a world.
`ethogram.core.wrappers.GivenPolicies(world, {"human": IDM(world)})` puts it among learners, and
`RolePolicies` makes a policy of the whole world of one per role.

- `IDM`, the intelligent driver model (Treiber, Hennecke, Helbing, 2000);
- `Krauss`, as SUMO has it: as fast as is safe, less some imperfection (Krauss, 1998);
- `MOBIL`, a driver of another kind that changes lanes where that helps (Kesting, Treiber, Helbing,
  2007);
- `ConstantSpeed`, which never looks; `Obedient`, which obeys the three rules; `Reckless`, which
  accelerates, and overtakes whom it can.

The models give an acceleration, any number; an action is one of three.  With `choice="random"` a
driver brakes or accelerates fully with the chance |a| / a_max, at most 1, and else keeps its speed:
its mean acceleration is the model's, as far as the car can do that.  With "nearest" it does what is
nearest.  A desired speed of 13 m/s is that from which a car stops (at a_max = 2 m/s^2) before an
obstacle that comes into its view (d_view = 50 m); the models, made for roads that can be seen to
their ends, brake in time only up to there.

Distances are between the same points of two cars; a gap is a car's length less.  At a vertex a
driver sees the nearest car on any way on, as all drivers do.
"""

from abc import abstractmethod
from typing import Annotated

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int, Key
from pydantic import Field

from ethogram.core.errors import InvalidSettings
from ethogram.core.keys import branch, random_words, unit
from ethogram.core.module import Module
from ethogram.core.settings import Fraction, Number, Positive, setting
from ethogram.worlds.traffic.driving import Body, Car, Choice, View, as_body, in_lane
from ethogram.worlds.traffic.observation import LANES

NotNegative = Annotated[float, Field(ge=0)]

RIGHT, STRAIGHT, LEFT = range(len(LANES))  # entries of what is seen
DESIRED_SPEED = 13.0  # m/s
LEAST_GAP = 0.1  # m: a model of following divides by no smaller one


class Follower(Module):
    """A driver that keeps its lane and whose acceleration depends on the car ahead of it.

    Attributes:
        body: of the world; a world is taken for it.
        choice: how an acceleration becomes an action: "random" or "nearest".

    """

    body: eqx.AbstractVar[Body]
    choice: eqx.AbstractVar[Choice]

    @abstractmethod
    def follow(self, speed: Array, ahead: Car) -> Array:
        """Acceleration, m/s^2, at a speed, m/s, behind a car."""

    def noise(self, key: Key[Array, ""], speed: Float[Array, "car"]) -> Float[Array, "car"]:
        """What chance adds to the acceleration, m/s^2."""
        del key
        return jnp.zeros_like(speed)

    def __call__(self, key: Key[Array, ""], observation: Float[Array, "car feature"]) -> Array:
        """Follow the nearest car ahead in the own lane."""
        view = self.body.view(observation)
        acceleration = self.follow(view.speed, in_lane(view.ahead, STRAIGHT))
        acceleration = acceleration + self.noise(branch(key, 0), view.speed)
        return self.body.act(branch(key, 1), acceleration, 0, self.choice)


class IDM(Follower):
    """The intelligent driver model: a (1 - (v / v0)^delta - (s* / s)^2).

    Attributes:
        body: of the world; a world is taken for it.
        desired_speed: v0, m/s.
        time_headway: T, s.
        comfortable_acceleration: a, m/s^2.
        comfortable_deceleration: b, m/s^2.
        standstill_gap: s0, m.
        exponent: delta.
        choice: how an acceleration becomes an action: "random" or "nearest".

    """

    body: Body = eqx.field(converter=as_body)
    desired_speed: Number = setting(DESIRED_SPEED, Positive)
    time_headway: Number = setting(1.6, NotNegative)
    comfortable_acceleration: Number = setting(0.73, Positive)
    comfortable_deceleration: Number = setting(1.67, Positive)
    standstill_gap: Number = setting(2.0, NotNegative)
    exponent: Number = setting(4.0, Positive)
    choice: Choice = setting("random", Choice, static=True)

    def follow(self, speed: Array, ahead: Car) -> Array:
        """Acceleration, m/s^2."""
        a, b = self.comfortable_acceleration, self.comfortable_deceleration
        approach = speed * (speed - ahead.speed) / (2 * jnp.sqrt(a * b))
        wanted = self.standstill_gap + jnp.maximum(  # 2000, eq. 4
            0.0, self.time_headway * speed + approach
        )
        ratio = wanted / jnp.maximum(ahead.gap, LEAST_GAP)
        return a * (1 - (speed / self.desired_speed) ** self.exponent - ratio**2)  # 2000, eq. 3


class Krauss(Follower):
    """As fast as is safe, less a random part (Krauss, 1998; as SUMO has it).

    Attributes:
        body: of the world; a world is taken for it.
        desired_speed: m/s.
        max_acceleration: a, m/s^2.
        deceleration: b, m/s^2.
        reaction_time: tau, s.
        imperfection: sigma, from 0 to 1: the share of a step's acceleration that may be lost.
        standstill_gap: minGap, m.
        choice: how an acceleration becomes an action: "random" or "nearest".

    """

    body: Body = eqx.field(converter=as_body)
    desired_speed: Number = setting(DESIRED_SPEED, Positive)
    max_acceleration: Number = setting(2.6, Positive)
    deceleration: Number = setting(4.5, Positive)
    reaction_time: Number = setting(1.0, Positive)
    imperfection: Number = setting(0.5, Fraction)
    standstill_gap: Number = setting(2.5, NotNegative)
    choice: Choice = setting("random", Choice, static=True)

    def safe_speed(self, speed: Array, ahead: Car) -> Array:
        """Of a driver who may have to stop behind the car ahead, m/s."""
        tau = self.reaction_time
        free = ahead.gap - self.standstill_gap - ahead.speed * tau
        time = (speed + ahead.speed) / (2 * self.deceleration) + tau
        return jnp.maximum(
            0.0, ahead.speed + free / time
        )  # 1998: v_l + (g - v_l tau) / (v/b + tau)

    def follow(self, speed: Array, ahead: Car) -> Array:
        """Acceleration without imperfection, m/s^2."""
        step = self.body.time_step
        faster = jnp.minimum(self.desired_speed, speed + self.max_acceleration * step)
        return (jnp.minimum(faster, self.safe_speed(speed, ahead)) - speed) / step

    def noise(self, key: Key[Array, ""], speed: Float[Array, "car"]) -> Float[Array, "car"]:
        """A loss of up to sigma a, m/s^2."""
        lost = unit(random_words(key, len(speed))).astype(speed.dtype)
        return -self.imperfection * self.max_acceleration * lost


class MOBIL(Module):
    """A driver that changes lanes where that makes it, and those behind it, faster.

    A lane is taken if it exists, if the new follower need not brake harder than b_safe, and if
    a~_c - a_c + p (a~_n - a_n + a~_o - a_o) is above the threshold: the gain of its own
    acceleration, and, by politeness, those of its new and its old follower (Kesting, Treiber,
    Helbing, 2007, eqs. 2 and 3).  Of two such lanes it takes the better, of equals the right one.

    Its view is privileged: it knows the cars behind it, which a `driver` does not see, so it can
    only play the role `human`.  Nobody changes lanes on a vertex.

    Attributes:
        model: of following, that of all cars as it thinks.
        politeness: p, from 0 to 0.5 as a rule.
        safe_braking: b_safe, m/s^2.
        threshold: of the gain, m/s^2.

    """

    model: Follower
    politeness: Number = setting(0.25, NotNegative)
    safe_braking: Number = setting(4.0, Positive)
    threshold: Number = setting(0.2, NotNegative)

    def __call__(self, key: Key[Array, ""], observation: Float[Array, "car feature"]) -> Array:
        """Follow the car ahead, and change lanes where that helps.

        Raises:
            InvalidSettings: the observation is that of a `driver`, which does not see behind.

        """
        body, choice = self.model.body, self.model.choice
        view = body.view(observation)
        if view.behind is None:
            raise InvalidSettings(
                "MOBIL: an observation without the cars behind; allowed: the role 'human'."
            )
        acceleration = self.model.follow(view.speed, in_lane(view.ahead, STRAIGHT))
        acceleration = acceleration + self.model.noise(branch(key, 0), view.speed)
        return body.act(branch(key, 1), acceleration, self.lane_change(view), choice)

    def lane_change(self, view: View) -> Int[Array, "car"]:
        """-1, 0 or 1, to the right, none, to the left."""
        right, left = (
            jnp.where(exists & view.on_section, self.incentive(view, lane), -jnp.inf)
            for lane, exists in ((RIGHT, view.lane > 1), (LEFT, view.lane < view.lanes))
        )
        better = jnp.where(right >= left, -1, 1)
        return jnp.where(jnp.maximum(right, left) > self.threshold, better, 0)

    def incentive(self, view: View, lane: int) -> Float[Array, "car"]:
        """The gain of a change to a lane, m/s^2; minus infinity if it is not safe."""
        assert view.behind is not None
        follow, own_length = self.model.follow, self.model.body.car_length
        me = view.speed
        ahead, new_ahead = in_lane(view.ahead, STRAIGHT), in_lane(view.ahead, lane)
        old, new = in_lane(view.behind, STRAIGHT), in_lane(view.behind, lane)
        gain = follow(me, new_ahead) - follow(me, ahead)
        others = jnp.zeros_like(gain)
        # of each follower: before and after, its leader is the car itself or the one ahead of it
        for follower, leader, sign in ((new, new_ahead, 1), (old, ahead, -1)):
            there = jnp.isfinite(follower.gap)
            beyond = Car(follower.gap + own_length + leader.gap, leader.speed)
            behind_me = follow(follower.speed, Car(follower.gap, me))
            change = sign * (behind_me - follow(follower.speed, beyond))
            others = others + jnp.where(there, change, 0.0)
        braking = follow(new.speed, Car(new.gap, me))
        safe = ~jnp.isfinite(new.gap) | (braking >= -self.safe_braking)  # 2007, eq. 2
        safe = safe & (new.gap > 0) & (new_ahead.gap > 0)
        return jnp.where(safe, gain + self.politeness * others, -jnp.inf)  # 2007, eq. 3


class ConstantSpeed(Module):
    """Reaches a speed, keeps it and its lane, and looks at nobody.

    Attributes:
        body: of the world; a world is taken for it.
        speed: m/s, kept within half of what a step can change.

    """

    body: Body = eqx.field(converter=as_body)
    speed: Number = setting(10.0, NotNegative)

    def __call__(self, key: Key[Array, ""], observation: Float[Array, "car feature"]) -> Array:
        """Accelerate to the speed, or brake."""
        view = self.body.view(observation)
        wish = (self.speed - view.speed) / self.body.time_step
        return self.body.act(key, wish, 0, "nearest")


class Obedient(Module):
    """Obeys the three rules, and is otherwise as fast as it can.

    It accelerates if it would still be allowed to be as fast a step later, whatever the car ahead
    does; else it keeps its speed if it may, or brakes.  To cross a vertex at the speed that is
    allowed it brakes early enough.  It goes to the right as soon as it sees nobody there.

    Attributes:
        body: of the world; a world is taken for it.

    """

    body: Body = eqx.field(converter=as_body)

    def __call__(self, key: Key[Array, ""], observation: Float[Array, "car feature"]) -> Array:
        """The highest speed that is allowed, in the rightmost free lane."""
        body = self.body
        view = body.view(observation)
        change = body.acceleration * body.time_step
        wish = -body.acceleration * jnp.ones_like(view.speed)
        for sign in (0, 1):
            speed = view.speed + sign * change
            wish = jnp.where(self.may(view, speed), sign * body.acceleration, wish)
        free = jnp.isinf(view.ahead.gap[:, RIGHT])
        steer = jnp.where(view.on_section & (view.lane > 1) & free, -1, 0)
        return body.act(key, wish, steer, "nearest")

    def may(self, view: View, speed: Float[Array, "car"]) -> Bool[Array, "car"]:
        """Whether a speed in the next step leaves the rules unbroken, then and later."""
        body = self.body
        limit, two = body.intersection_speed, 2 * body.acceleration
        moved = speed * body.time_step
        zone = view.stop - 2 * body.car_length - moved  # m until it is at an intersection
        slows = jnp.maximum(speed**2 - limit**2, 0.0) / two + moved
        in_time = (speed <= limit) | (view.on_section & (zone > slows))
        seen = jnp.minimum(view.ahead.gap[:, STRAIGHT], body.view_distance - body.car_length)
        # the car ahead may stand at once; and one may come into view at its very edge
        return in_time & (seen - moved - moved > speed**2 / two)


class Reckless(Module):
    """Accelerates always, and leaves its lane for the one in which it sees the furthest.

    Attributes:
        body: of the world; a world is taken for it.

    """

    body: Body = eqx.field(converter=as_body)

    def __call__(self, key: Key[Array, ""], observation: Float[Array, "car feature"]) -> Array:
        """Full acceleration, and a change of lane where somebody is ahead."""
        view = self.body.view(observation)
        right, own, left = (view.ahead.gap[:, lane] for lane in range(len(LANES)))
        right = jnp.where(view.lane > 1, right, -jnp.inf)
        left = jnp.where(view.lane < view.lanes, left, -jnp.inf)
        best = jnp.where(right > left, -1, 1)
        steer = jnp.where(view.on_section & (jnp.maximum(right, left) > own), best, 0)
        return self.body.act(key, jnp.full_like(view.speed, jnp.inf), steer, "nearest")
