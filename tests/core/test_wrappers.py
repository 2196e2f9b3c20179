"""What each wrapper changes; that it is a world is among the contracts of worlds."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.learners.toys import Choir, Duet, Market, Reach, Recital

from ethogram.core.errors import EthogramError, InvalidSettings, TooLarge, UnknownName
from ethogram.core.rollout import rollout, watch
from ethogram.core.spaces import Box, Discrete
from ethogram.core.world import Outcome, Role, World
from ethogram.core.wrappers import (
    DiscretizeAction,
    DiscretizeObservation,
    GivenPolicies,
    RepeatAction,
    RescaleAction,
    RescaleObservation,
    RolePolicies,
    TimeLimit,
    completed,
    unwrapped,
)
from ethogram.core.wrappers.discretize import decode_mixed_radix, encode_mixed_radix
from ethogram.worlds.language import Language
from ethogram.worlds.publishing import Publishing

KEY = jax.random.key(0)


def test_numbers_in_mixed_radix_count_all_that_there_is_once():
    sizes = (2, 3, 4)
    digits = decode_mixed_radix(jnp.arange(24), sizes)
    assert len({*map(tuple, digits.tolist())}) == 24
    assert (digits < jnp.array(sizes)).all()
    np.testing.assert_array_equal(encode_mixed_radix(digits, sizes), jnp.arange(24))
    np.testing.assert_array_equal(encode_mixed_radix(jnp.array([1, 2, 3]), sizes), 23)


def test_observations_fall_in_bins_of_equal_width_and_what_is_beyond_in_the_outermost():
    world = DiscretizeObservation(Reach(), bins=4)  # of width 1 from -1 to 3
    assert world.roles["hand"].observation == Discrete(4**4)
    state, _ = world.reset(KEY)
    for hand, target, digits in [
        ((-1.0, -0.5), (0.0, 0.99), (0, 0, 1, 1)),
        ((3.0, -9.0), (9.0, 1.0), (3, 0, 3, 2)),
    ]:
        at = eqx.tree_at(lambda s: (s.hand, s.target), state, (jnp.array(hand), jnp.array(target)))
        (number,) = world.observe(at)["hand"].tolist()
        assert number == int(encode_mixed_radix(jnp.array(digits), (4,) * 4))
    market = DiscretizeObservation(Market(), bins=3).roles
    assert market["seller"].observation == Discrete(3**3)
    assert market["buyer"].observation == Discrete(2 * 3)


def test_choices_are_pure_and_those_that_there_are_not_count_as_the_first_that_there_is():
    world = DiscretizeAction(Language(vocabulary_size=2, max_vocabulary_size=4))
    assert world.roles["talker"].action == Discrete(5)
    state, _ = world.reset(KEY)
    said = []
    for word in range(5):
        action = {"mover": jnp.zeros(2, int), "talker": jnp.full(2, word)}
        after, _ = world.step(KEY, state, action)
        said.append(after.said.argmax(-1).tolist())
        assert unwrapped(world).roles["talker"].action.contains(after.said).all()
    assert said == [[1, 1], [1, 1], [2, 2], [1, 1], [1, 1]]  # silence is not allowed, nor 3 and 4


def test_a_box_of_actions_is_a_grid_from_bound_to_bound():
    world = DiscretizeAction(Reach(), bins=3)
    assert world.roles["hand"].action == Discrete(9)
    state, _ = world.reset(KEY)
    hands = [
        world.step(KEY, state, {"hand": jnp.array([number])})[0].hand.tolist()
        for number in range(9)
    ]
    grid = [-0.5, 0.25, 1.0]
    np.testing.assert_allclose(hands, [[x, y] for x in grid for y in grid], atol=1e-6)
    assert DiscretizeAction(Recital()).roles["pianist"].action == Discrete(9)


def test_boxes_reach_from_minus_one_to_one_and_mean_the_same():
    world, plain = RescaleAction(RescaleObservation(Reach())), Reach()
    (role,) = world.roles.values()
    assert (role.observation, role.action) == (Box(-1.0, 1.0, (2, 2)), Box(-1.0, 1.0, (2,)))
    state, seen = world.reset(KEY)
    np.testing.assert_allclose(seen["hand"], plain.observe(state)["hand"] / 2 - 0.5, atol=1e-6)
    for unit, move in ((-1.0, -0.5), (1.0, 1.0), (0.0, 0.25)):
        found, _ = world.step(KEY, state, {"hand": jnp.full((1, 2), unit)})
        expected, _ = plain.step(KEY, state, {"hand": jnp.full((1, 2), move)})
        np.testing.assert_allclose(found.hand, expected.hand, atol=1e-6)


def test_padding_of_a_box_stays_zero():
    (seller, _) = RescaleObservation(Market()).reset(KEY)[1].values()
    assert (seller[:, 1] == 0).all()


@pytest.mark.parametrize("wrapper", [RescaleObservation, DiscretizeObservation])
def test_boxes_without_end_are_refused_by_name(wrapper):
    with pytest.raises(EthogramError, match=rf"{wrapper.__name__} needs .*finite.*'author' is Box"):
        wrapper(Publishing())
    reach = Reach(pace=jnp.inf)
    for refuses in (RescaleAction, DiscretizeAction):
        with pytest.raises(EthogramError, match=rf"{refuses.__name__} needs .*finite.*'hand' is B"):
            refuses(reach)


class Flat(Reach):
    """A hand that sees nothing: all its numbers are 1."""

    @property
    def roles(self):
        (hand,) = super().roles.values()
        return {"hand": dataclasses.replace(hand, observation=Box(1.0, 1.0, (2, 2)))}


@pytest.mark.parametrize("wrapper", [RescaleObservation, DiscretizeObservation])
def test_boxes_without_width_are_refused_by_name(wrapper):
    with pytest.raises(
        EthogramError, match=rf"{wrapper.__name__}: low = 1.0, high = 1.0 of 'hand'"
    ):
        wrapper(Flat())
    assert RescaleObservation(Market()).roles  # padding may be


@pytest.mark.parametrize(("low", "high"), [(2.0, 1.0), (1.0, 1.0)])
def test_given_bounds_that_hold_nothing_are_refused(low, high):
    with pytest.raises(
        EthogramError, match=f"low = {low}, high = {high} of 'hand'; .* low below h"
    ):
        DiscretizeObservation(Reach(), low=low, high=high)


def test_bounds_can_be_given_and_too_many_bins_are_refused_with_their_number():
    world = Publishing(authors=4, journals=3, initial_papers=20)
    fine = DiscretizeObservation(world, bins=3, low=0.0, high=10.0)
    assert fine.roles["author"].observation == Discrete(3**5)
    with pytest.raises(TooLarge, match=r"bins = 100 tells 10,000,000,000 values apart in the Box"):
        DiscretizeObservation(world, bins=100, low=0.0, high=10.0)
    with pytest.raises(InvalidSettings, match="bins = 1"):
        DiscretizeObservation(world, bins=1, low=0.0, high=10.0)


def test_repeated_actions_add_up_what_is_earned_until_the_episode_ends():
    world = RepeatAction(Reach(), times=4)
    assert world.horizon == 3
    state, _ = Reach().reset(KEY)
    state = eqx.tree_at(lambda at: at.target, state, jnp.array([0.9, 0.0]))
    step = eqx.filter_jit(world.step)
    action = {"hand": jnp.array([[0.3, 0.0]])}
    after, outcome = step(KEY, state, action)
    # 0.6 and 0.3 are missing, then it is there, and stays
    np.testing.assert_allclose(outcome.reward["hand"], [-0.9], atol=1e-5)
    assert outcome.terminated["hand"].all()
    np.testing.assert_allclose(after.hand, [0.9, 0.0], atol=1e-6)
    assert after.time == 3
    slow = {"hand": jnp.array([[0.1, 0.0]])}
    after, outcome = step(KEY, state, slow)
    np.testing.assert_allclose(outcome.reward["hand"], [-(0.8 + 0.7 + 0.6 + 0.5)], atol=1e-5)
    assert not outcome.terminated["hand"].any()
    assert after.time == 4
    _, played = rollout(world, lambda *_: {"hand": jnp.zeros((1, 2))}, KEY, 3)
    assert played.outcome.truncated["hand"][:, 0].tolist() == [False, False, True]  # after 10


class Relay(World):
    """Two runners who earn 1 a step; the first ends after one step, the other after three."""

    horizon = 3

    @property
    def roles(self):
        return {"runner": Role(2, Discrete(1), Discrete(1))}

    def reset(self, key):
        del key
        return jnp.int32(0), self.observe(0)

    def observe(self, state):
        del state
        return {"runner": jnp.zeros(2, int)}

    def step(self, key, state, action):
        del key, action
        ended = {"runner": state + 1 >= jnp.array([1, 3])}
        never = {"runner": jnp.zeros(2, bool)}
        return state + 1, Outcome(self.observe(state), {"runner": jnp.ones(2)}, ended, never)


def test_in_repeated_actions_who_has_ended_earns_no_more_while_others_go_on():
    world = RepeatAction(Relay(), times=2)
    state, _ = world.reset(KEY)
    action = {"runner": jnp.zeros(2, int)}
    state, outcome = eqx.filter_jit(world.step)(KEY, state, action)
    np.testing.assert_array_equal(outcome.reward["runner"], [1, 2])
    np.testing.assert_array_equal(outcome.terminated["runner"], [True, False])


def test_time_is_up_after_the_limit_and_a_termination_is_none():
    world = TimeLimit(Reach(), steps=3)
    assert world.horizon == 3
    assert TimeLimit(Reach(), steps=30).horizon == 10
    _, played = rollout(world, lambda *_: {"hand": jnp.zeros((1, 2))}, KEY, 6)
    cut = played.outcome.truncated["hand"][:, 0] | played.outcome.terminated["hand"][:, 0]
    assert cut.tolist() == [False, False, True] * 2
    choir = TimeLimit(Choir(), steps=1)
    _, outcome = choir.step(KEY, choir.reset(KEY)[0], {"singer": jnp.zeros(4, int)})
    assert outcome.terminated["singer"].all()
    assert not outcome.truncated["singer"].any()


def echo(key, observation):
    del key
    return observation


def test_given_roles_act_by_their_policies_and_nobody_else_is_told():
    world = GivenPolicies(Duet(), {"pianist": echo})  # plays the key that it sees
    assert set(world.roles) == {"singer"}

    def in_key(key, observation):
        del key
        return {"singer": observation["singer"]}

    _, played = rollout(world, in_key, KEY, 5)
    assert set(played.observation) == set(played.outcome.reward) == {"singer"}
    assert set(played.outcome.acting) == {"singer"}
    np.testing.assert_array_equal(played.outcome.reward["singer"], 1.0)  # both are in key
    policy = completed(world, in_key)
    _, whole = rollout(Duet(), policy, KEY, 5)
    assert set(whole.action) == {"singer", "pianist"}
    np.testing.assert_array_equal(whole.outcome.reward["pianist"], 1.0)
    assert completed(Duet(), policy) is policy


def test_given_policies_of_roles_that_there_are_not_or_of_all_are_refused():
    with pytest.raises(UnknownName, match=r"Unknown role 'pianst'\. Did you mean 'pianist'\?"):
        GivenPolicies(Duet(), {"pianst": echo})
    with pytest.raises(EthogramError, match="all roles of Duet have a policy"):
        GivenPolicies(Duet(), {"pianist": echo, "singer": echo})


def test_policies_of_roles_have_keys_of_their_own_whatever_the_order_they_are_given_in():
    def chance(key, observation):
        return jax.random.uniform(key, observation.shape)

    seen = {"singer": jnp.zeros(1), "pianist": jnp.zeros(1)}
    one = RolePolicies({"singer": chance, "pianist": chance})(KEY, seen)
    other = RolePolicies({"pianist": chance, "singer": chance})(KEY, seen)
    assert one == other
    assert one["singer"] != one["pianist"]


def test_a_world_is_shown_through_its_wrappers():
    plain = Language(steps=4)
    world = TimeLimit(DiscretizeAction(plain), steps=3)

    def still(key, observation):
        del key, observation
        return {"mover": jnp.zeros(2, int), "talker": jnp.ones(2, int)}

    scene = watch(world, still, KEY)
    assert len(scene.position) == 4  # the start and three steps
    assert unwrapped(world) is plain
