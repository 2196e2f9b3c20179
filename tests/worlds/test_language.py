import math
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.oracles import language as oracle

from ethogram.core.errors import InvalidSettings
from ethogram.core.rollout import rollout
from ethogram.core.scene import Scene
from ethogram.core.wrappers import RolePolicies
from ethogram.worlds.language import Language
from ethogram.worlds.language.policies import (
    Informed,
    NoCommunication,
    Optimal,
    Pull,
    Uninformed,
    steer,
)
from ethogram.worlds.language.scene import record, word_names
from ethogram.worlds.language.world import MOVES, derangements

KEY = jax.random.key(0)
NONE, UP, RIGHT, DOWN, LEFT = range(5)
SILENCE, A, B, C, D = range(5)


def choices(numbers, size):
    """Pure choices as weights."""
    return jax.nn.one_hot(jnp.asarray(numbers), size)


def act(world, moves, words):
    """A joint action of pure choices."""
    return {
        "mover": choices(moves, len(MOVES)),
        "talker": choices(words, world.max_vocabulary_size + 1),
    }


def weights(world, steps, seed=0):
    """Random actions that mix choices, steps leading."""
    draw = np.random.default_rng(seed)
    used = np.asarray(world.vocabulary_mask)
    words = np.zeros((steps, world.robots, world.max_vocabulary_size + 1), np.float32)
    words[..., used] = draw.dirichlet(np.ones(used.sum()), (steps, world.robots))
    moves = draw.dirichlet(np.ones(len(MOVES)), (steps, world.robots)).astype(np.float32)
    return {"mover": jnp.asarray(moves), "talker": jnp.asarray(words)}


@eqx.filter_jit
def reset(world):
    return world.reset(KEY)


@eqx.filter_jit
def observe(world, state):
    return world.observe(state)


@eqx.filter_jit
def step(world, state, action):
    return world.step(KEY, state, action)


@eqx.filter_jit
def replay(world, state, actions):
    """The states reached and the outcomes of actions given, steps leading."""

    def step(state, action):
        state, outcome = world.step(KEY, state, action)
        return state, (state, outcome)

    return jax.lax.scan(step, state, actions)[1]


def facing(world, position, target, guides, goal):
    """A start chosen by hand."""
    return replace(
        reset(world)[0],
        position=jnp.array(position, jnp.float32),
        target=jnp.array(target, jnp.float32),
        guides=jnp.array(guides),
        goal=jnp.array(goal),
    )


def test_two_robots_by_hand():
    world = Language()
    # robot 1 must reach target 1, robot 2 target 2; each knows the other's
    state = facing(world, [(0, 0), (1, 1)], [(0.5, 0), (1, 0.25)], [1, 0], [0, 1])
    seen = observe(world, state)
    quiet = [1, 0, 0, 0, 0] * 2
    np.testing.assert_array_equal(seen["mover"][0], [0.5, 0, 1, 0.25, *quiet])
    np.testing.assert_array_equal(seen["mover"][1], [-0.5, -1, 0, -0.75, *quiet])
    np.testing.assert_array_equal(seen["talker"], [[0, 1, 0, 1], [1, 0, 1, 0]])

    # one goes right, the other down, by 0.05
    state, outcome = step(world, state, act(world, [RIGHT, DOWN], [C, A]))
    np.testing.assert_allclose(state.position, [(0.05, 0), (1, 0.95)], rtol=1e-6)
    np.testing.assert_allclose(outcome.reward["mover"], [-0.45, -0.7], rtol=1e-6)
    np.testing.assert_allclose(outcome.reward["talker"], [-0.7, -0.45], rtol=1e-6)
    heard = [0, 0, 0, 1, 0, 0, 1, 0, 0, 0]
    np.testing.assert_array_equal(outcome.observation["mover"][:, 4:], [heard, heard])

    # both let go: three quarters of the velocity are left
    state, outcome = step(world, state, act(world, [NONE, NONE], [A, D]))
    np.testing.assert_allclose(state.position, [(0.0875, 0), (1, 0.9125)], rtol=1e-6)
    np.testing.assert_allclose(outcome.reward["mover"], [-0.4125, -0.6625], rtol=1e-6)


def test_under_the_printed_law_a_robot_moves_first_and_never_slows_down():
    world = Language(dynamics="literal", delta=0.1)
    state = facing(world, [(0, 0), (0, 0)], [(1, 0), (0, 1)], [1, 0], [0, 1])
    moves = [[RIGHT, UP], [NONE, UP], [NONE, DOWN], [LEFT, DOWN]]
    actions = jax.vmap(lambda move: act(world, move, [A, A]))(jnp.array(moves))
    states, _ = replay(world, state, actions)
    np.testing.assert_allclose(states.position[:, 0, 0], [0, 0.1, 0.2, 0.3], rtol=1e-6)
    np.testing.assert_allclose(states.position[:, 1, 1], [0, 0.1, 0.3, 0.4], rtol=1e-6)


@pytest.mark.parametrize(
    "settings",
    [
        {"robots": 2, "targets": 2},
        {"robots": 3, "targets": 4, "execution": "hard", "allow_silence": True},
        {"robots": 2, "targets": 3, "vocabulary_size": 0, "dynamics": "literal", "delta": 0.02},
        {"robots": 4, "targets": 2, "dynamics": "literal", "execution": "hard"},
        {"robots": 3, "targets": 1, "vocabulary_size": 2, "observe_velocity": True},
    ],
)
def test_the_world_is_the_one_that_the_thesis_writes(settings):
    world = Language(**settings)
    start, _ = reset(world)
    slow = oracle.Game(
        positions=start.position,
        targets=start.target,
        guides=start.guides.tolist(),
        goals=start.goal.tolist(),
        words=world.max_vocabulary_size + 1,
        dynamics=world.dynamics,
        execution=world.execution,
        delta=float(world.delta),
        observe_velocity=world.observe_velocity,
    )
    actions = weights(world, world.steps)
    _, outcome = replay(world, start, actions)
    for step in range(world.steps):
        slow.step(actions["mover"][step], actions["talker"][step])
        pairs = (
            (outcome.observation["mover"], slow.mover_observations()),
            (outcome.observation["talker"], slow.talker_observations()),
            (outcome.reward["mover"], slow.mover_rewards()),
            (outcome.reward["talker"], slow.talker_rewards()),
        )
        for found, expected in pairs:
            np.testing.assert_allclose(found[step], expected, rtol=1e-5, atol=1e-6)


def test_an_episode_is_exactly_25_moves_and_25_rewards_and_ends_by_the_clock():
    world = Language()

    def policy(key, observation):
        del key, observation
        return act(world, [UP, DOWN], [A, A])

    _, played = rollout(world, policy, KEY, 60)
    np.testing.assert_array_equal(np.flatnonzero(played.episode_end), [24, 49])
    for role in world.roles:
        np.testing.assert_array_equal(played.outcome.truncated[role].all(1), played.episode_end)
        assert not played.outcome.terminated[role].any()


def test_what_is_said_is_heard_by_all_one_step_later_and_no_longer():
    world = Language(robots=3, targets=2)
    state, start = reset(world)
    heard = [start["mover"]]
    for words in ([A, B, C], [D, D, D]):
        state, outcome = step(world, state, act(world, [NONE] * 3, words))
        heard.append(outcome.observation["mover"])
    heard = np.stack(heard)[:, :, 4:].reshape(3, 3, 3, 5)  # step, listener, speaker, word
    assert (heard == heard[:, :1]).all()
    np.testing.assert_array_equal(heard[:, 0].argmax(-1), [[SILENCE] * 3, [A, B, C], [D, D, D]])


@pytest.mark.parametrize(("robots", "ways"), [(2, 1), (3, 2), (4, 9), (5, 44)])
def test_every_robot_is_guided_by_another_one_in_all_possible_ways(robots, ways):
    found = derangements(robots)  # as many as the subfactorial of their number
    assert len({tuple(way) for way in found}) == len(found) == ways
    np.testing.assert_array_equal(np.sort(found, 1), np.tile(np.arange(robots), (ways, 1)))
    assert (found != np.arange(robots)).all()


def test_starts_are_drawn_uniformly_and_independently():
    world, episodes = Language(robots=4, targets=3), 18_000
    states, _ = jax.jit(jax.vmap(world.reset))(jax.random.split(KEY, episodes))
    ways = np.unique(np.asarray(states.guides), axis=0, return_counts=True)
    np.testing.assert_array_equal(ways[0], np.unique(derangements(4), axis=0))
    goals = np.unique(np.asarray(states.goal), axis=0, return_counts=True)
    for counts, size in ((ways[1], 9), (goals[1], 3**4)):
        assert len(counts) == size
        chi_square = ((counts - episodes / size) ** 2).sum() / (episodes / size)
        assert abs(chi_square - (size - 1)) < 4 * math.sqrt(2 * (size - 1))
    drawn = np.concatenate([states.position, states.target], 1).reshape(episodes, -1)
    assert drawn.min() >= 0
    assert drawn.max() <= 1
    deciles = np.quantile(drawn, np.linspace(0.1, 0.9, 9), axis=0)
    np.testing.assert_allclose(deciles, np.tile(np.linspace(0.1, 0.9, 9), (14, 1)).T, atol=0.02)
    chosen = np.concatenate([drawn, states.goal, states.guides[:, :1]], 1)
    related = np.corrcoef(chosen.T) - np.eye(chosen.shape[1])
    assert np.abs(related).max() < 5 / math.sqrt(episodes)
    assert (states.said[..., SILENCE] == 1).all()
    assert (states.velocity == 0).all()


def test_room_for_more_symbols_changes_nothing_but_the_padding():
    tight, roomy = Language(max_vocabulary_size=4), Language(max_vocabulary_size=16)
    actions = weights(tight, 25)
    padding = ((0, 0), (0, 0), (0, 12))
    padded = actions | {"talker": jnp.pad(actions["talker"], padding)}
    (states, plain), (same, wide) = (
        replay(world, reset(world)[0], action)
        for world, action in ((tight, actions), (roomy, padded))
    )
    np.testing.assert_array_equal(states.position, same.position)
    for role in tight.roles:
        np.testing.assert_array_equal(plain.reward[role], wide.reward[role])
    used = np.asarray(roomy.roles["mover"].observation.used)
    assert not np.asarray(wide.observation["mover"])[..., ~used].any()
    allowed = np.asarray(tight.roles["mover"].observation.used)
    assert used.sum() == allowed.sum()
    np.testing.assert_array_equal(
        np.asarray(wide.observation["mover"])[..., used],
        np.asarray(plain.observation["mover"])[..., allowed],
    )


@pytest.mark.parametrize(
    ("vocabulary_size", "allow_silence", "words"),
    [
        (0, False, [SILENCE]),
        (0, True, [SILENCE]),
        (3, False, [A, B, C]),
        (3, True, [SILENCE, A, B, C]),
    ],
)
def test_a_talker_may_be_silent_only_where_it_is_allowed_or_where_there_is_no_symbol(
    vocabulary_size, allow_silence, words
):
    world = Language(
        vocabulary_size=vocabulary_size, allow_silence=allow_silence, max_vocabulary_size=5
    )
    space = world.roles["talker"].action
    np.testing.assert_array_equal(space.contains(jnp.eye(6)), np.isin(range(6), words))


def test_languages_of_all_sizes_share_one_program():
    traces = []

    @jax.jit
    @jax.vmap
    def used(vocabulary_size):
        traces.append(None)
        world = Language(vocabulary_size=vocabulary_size, max_vocabulary_size=6)
        _, observation = world.reset(KEY)
        space = world.roles["mover"].observation
        return world.vocabulary_mask.sum(), space.contains(observation["mover"]).all()

    sizes, fits = used(jnp.arange(7))
    np.testing.assert_array_equal(sizes, [1, 1, 2, 3, 4, 5, 6])
    assert fits.all()
    assert len(traces) == 1


def test_a_world_can_be_changed_inside_a_compiled_program():
    world = Language(vocabulary_size=3)
    shape = jax.jit(lambda key: replace(world, targets=5).reset(key)[0].target)(KEY).shape
    assert shape == (5, 2)


def test_an_alphabet_without_room_and_a_lone_robot_are_refused():
    with pytest.raises(
        InvalidSettings, match="vocabulary_size = 5 is more than max_vocabulary_size = 4"
    ):
        Language(vocabulary_size=5)
    with pytest.raises(InvalidSettings, match=r"robots = 1: .*greater than or equal to 2"):
        Language(robots=1)


def test_optimal_talkers_name_each_association_by_its_own_symbol_and_others_are_silent():
    world = Language(robots=3, targets=4, vocabulary_size=12, max_vocabulary_size=15)
    known = [np.concatenate([r, t]) for r in np.eye(3) for t in np.eye(4)]
    observation = jnp.array(known).reshape(4, 3, 7)  # any three at a time
    said = jax.vmap(Optimal(world), (None, 0))(KEY, observation).reshape(12, 16)
    np.testing.assert_array_equal(said, np.eye(16)[1:13])
    quiet = NoCommunication(world)(KEY, observation[0])
    np.testing.assert_array_equal(quiet, choices([SILENCE] * 3, 16))


@pytest.mark.parametrize("policy", [Optimal, Informed])
def test_optimal_talkers_need_a_symbol_for_each_association(policy):
    with pytest.raises(InvalidSettings, match=r"3 robots and 4 targets need 12 symbols.* has 11"):
        policy(Language(robots=3, targets=4, vocabulary_size=11, max_vocabulary_size=20))


def test_informed_movers_go_to_the_middle_until_they_hear_of_their_own_target():
    world = Language(robots=3, targets=2, vocabulary_size=6, max_vocabulary_size=7)
    corners = [(0.0, 0.0), (0.0, 1.0)]
    # robots in the middle between the targets; 1 guides 2, 2 guides 3, 3 guides 1
    state = facing(world, [(0.0, 0.5)] * 3, corners, [1, 2, 0], [0, 1, 1])
    policy = RolePolicies({"mover": Informed(world), "talker": Optimal(world)})
    action = policy(KEY, observe(world, state))
    np.testing.assert_allclose(action["mover"], choices([NONE] * 3, 5), atol=1e-6)
    state, outcome = step(world, state, action)
    action = policy(KEY, outcome.observation)
    np.testing.assert_allclose(action["mover"], choices([DOWN, UP, UP], 5), atol=1e-6)


def test_a_pull_accelerates_by_its_law_up_to_full_thrust():
    offset = jnp.array([(0.1, 0.0), (0.0, -0.05), (-0.04, 0.02), (3.0, -1.0), (0.0, 0.0)])
    found = steer(offset, Pull(gain=10.0, power=2.0))  # |a| = (10 o)^2 per axis
    #            none    up    right  down   left
    expected = [(0.00, 0.00, 1.00, 0.00, 0.00), (0.75, 0.00, 0.00, 0.25, 0.00)]
    expected += [(0.80, 0.04, 0.00, 0.00, 0.16), (0.00, 0.00, 0.90, 0.10, 0.00)]
    expected += [(1.00, 0.00, 0.00, 0.00, 0.00)]
    np.testing.assert_allclose(found, expected, atol=1e-6)


# published R_val per robot and its standard error, by number of targets
REFERENCE = {
    (Informed, Optimal): {2: (-6.586, 0.012), 3: (-6.648, 0.012), 4: (-6.698, 0.012)},
    (Uninformed, NoCommunication): {2: (-18.616, 0.035), 3: (-19.184, 0.035), 4: (-21.496, 0.035)},
}


@pytest.mark.parametrize("targets", [2, 3, 4])
@pytest.mark.parametrize("pair", REFERENCE)
def test_reference_controllers_earn_what_they_are_known_to_earn(pair, targets):
    symbols, episodes, side_by_side = 2 * targets, 20_000, 2_000
    world = Language(targets=targets, vocabulary_size=symbols, max_vocabulary_size=symbols)
    mover, talker = pair

    @jax.jit
    @jax.vmap
    def play(key):
        policy = RolePolicies({"mover": mover(world), "talker": talker(world)})
        reward = rollout(world, policy, key, world.steps)[1].outcome.reward
        return sum(part.sum() for part in reward.values()) / world.robots

    keys = jax.random.split(KEY, episodes).reshape(-1, side_by_side)
    earned = np.concatenate([play(some) for some in keys])
    known, error = REFERENCE[pair][targets]
    assert abs(earned.mean() - known) < 4 * math.hypot(error, earned.std() / math.sqrt(episodes))


def test_words_have_names_of_letters_and_never_run_out():
    assert word_names(0) == ("silence",)
    assert word_names(3) == ("silence", "a", "b", "c")
    names = word_names(10_000)
    assert names[26:29] == ("z", "aa", "ab")
    assert len(set(names)) == 10_001


def test_a_scene_shows_who_goes_where_says_what_and_knows_whose_target():
    world = Language(robots=3, targets=2)
    start = facing(world, [(0, 0), (0, 1), (1, 0)], [(0.5, 0), (1, 2)], [1, 2, 0], [0, 1, 0])
    actions = jax.vmap(lambda moves, words: act(world, moves, words))(
        jnp.array([[RIGHT] * 3, [LEFT] * 3]), jnp.array([[A, B, D], [SILENCE, C, C]])
    )
    states, outcome = replay(world, start, actions)
    scene = record(start, states)
    targets, robots = slice(0, 2), slice(2, 5)
    np.testing.assert_array_equal(scene.position[0], [*start.target, *start.position])
    np.testing.assert_array_equal(scene.position[1:, robots], states.position)
    np.testing.assert_array_equal(scene.tint, [[0, 1, 0, 1, 0]] * 3)  # alike: robot and target
    said = [["" if s < 0 else scene.words[s] for s in row] for row in scene.said]
    assert said == [["", "", *row] for row in (["", "", ""], ["a", "b", "d"], ["", "c", "c"])]
    assert len(scene.said[0, targets]) == 2
    guided, known = {(2, 3), (3, 4), (2, 4)}, {(2, 1), (3, 0), (4, 0)}
    assert set(scene.links) == guided | known
    np.testing.assert_allclose(scene.series["distance"][1:], -outcome.reward["mover"])
    assert scene.captions[0].startswith("start: 1 guides 2, 2 guides 3, 3 guides 1; mean")
    left, bottom, right, top = scene.bounds
    assert (scene.position >= (left, bottom)).all()
    assert (scene.position <= (right, top)).all()
    assert Scene.from_dataset(scene.to_dataset()).links == scene.links


def test_robots_that_guide_each_other_are_joined_by_one_line():
    world = Language()
    start = facing(world, [(0, 0), (0, 1)], [(0.5, 0), (1, 1)], [1, 0], [1, 1])
    states, _ = replay(world, start, weights(world, 2))
    assert sorted(record(start, states).links) == [(2, 1), (2, 3), (3, 1)]


def test_a_law_of_motion_of_ones_own_takes_the_place_of_the_damped_one():
    def jump(position, velocity, push, delta):
        return position + delta * push, jnp.zeros_like(velocity)

    world = Language(dynamics=jump, delta=0.5, steps=2)
    state, _ = reset(world)
    after, _ = step(world, state, act(world, [RIGHT, NONE], [A, A]))
    np.testing.assert_allclose(after.position - state.position, [[0.5, 0], [0, 0]], atol=1e-6)
    assert np.isinf(world.roles["mover"].observation.high).all()
