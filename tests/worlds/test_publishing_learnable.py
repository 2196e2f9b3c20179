import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.worlds.publishing import Publishing
from ethogram.worlds.publishing.indicators import INDICATORS
from ethogram.worlds.publishing.learnable import LearnablePublishing
from ethogram.worlds.publishing.policies import Minded, Random, Scrutiny

SYSTEM = Publishing(authors=12, journals=10, initial_papers=60, years=2, steps_per_year=3)
WORLDS = {
    "author": LearnablePublishing(SYSTEM, Scrutiny(0.25), "author"),
    "editor": LearnablePublishing(SYSTEM, Random(), "editor"),
}
MOVES = np.array([[0, 1, 2, 2, 2, 2], [2, 2, 2, 0, 1, 2]])  # of even and of odd agents, by step


@pytest.fixture(scope="module", params=list(WORLDS))
def played(request):
    """A world, its states, and the outcomes and observations of an episode of fixed moves."""
    world = WORLDS[request.param]
    agents = world.roles[request.param].agents

    @eqx.filter_jit
    def run(world, key):
        state, seen = world.reset(key)

        def step(state, at):
            move, key = at
            action = jnp.where(jnp.arange(agents) % 2 == 0, move[0], move[1])
            after, outcome = world.step(key, state, {world.learns: action})
            return after, (state, outcome)

        keys = jax.random.split(key, world.horizon)
        last, (states, outcomes) = jax.lax.scan(step, state, (jnp.array(MOVES.T), keys))
        whole = jax.tree.map(lambda many, one: jnp.concatenate([many, one[None]]), states, last)
        return whole, seen, outcomes

    return world, *run(world, jax.random.key(2))


def test_levels_move_by_one_and_stay_between_1_and_n_bin(played):
    world, states, _, _ = played
    level = np.asarray(states.level)
    assert level.min() >= 0
    assert level.max() == 9
    for time in range(world.horizon):
        moves = np.where(np.arange(level.shape[1]) % 2 == 0, *MOVES[:, time]) - 1
        np.testing.assert_array_equal(level[time + 1], np.clip(level[time] + moves, 0, 9))


def test_rows_are_made_of_what_learners_know(played):
    world, states, seen, outcomes = played
    rows = np.concatenate([seen[world.learns][None], outcomes.observation[world.learns]])
    for time, row in enumerate(rows):
        state = jax.tree.map(lambda part, time=time: part[time], states)
        own = np.asarray(SYSTEM.observe(state.system)[world.learns])
        if world.learns == "author":
            first = np.clip(np.floor(10 * own[:, 0] / 15 + 1e-6), 0, 9)
            second = np.clip(own[:, 1], 0, 9)
        else:
            first = np.clip(np.floor(own[:, 0] / 2 + 1e-6), 0, 9)
            second = np.floor(10 * np.log1p(own[:, 1]) / np.log1p(SYSTEM.capacity) + 1e-6)
        np.testing.assert_array_equal(row, 100 * np.asarray(state.level) + 10 * first + second)


def test_learners_earn_what_their_indicator_gains(played):
    world, states, _, outcomes = played
    system = states.system
    level = (
        system.citation_stats.h_index if world.learns == "author" else np.nan_to_num(system.impact)
    )
    np.testing.assert_allclose(outcomes.reward[world.learns], np.diff(level, axis=0), atol=1e-6)
    paid = LearnablePublishing(SYSTEM, world.others, world.learns, reward="level")
    pay = jax.vmap(paid._pay, (0, 0))(jax.tree.map(lambda part: part[1:], system), outcomes)
    ends = (np.arange(world.horizon) + 1) % SYSTEM.steps_per_year == 0
    due = level[1:] if world.learns == "author" else level[1:] * ends[:, None]
    np.testing.assert_allclose(pay, due, atol=1e-6)


def test_the_most_ambitious_go_to_the_best_journal_and_the_most_selective_take_the_best():
    key = jax.random.key(0)
    state, _ = SYSTEM.reset(key)
    seen = SYSTEM.observe(state)
    best = int(jnp.argmax(seen["author"][0, 2:]))
    author, editor = WORLDS["author"], WORLDS["editor"]
    assert set(np.asarray(author._apply(key, jnp.full(12, 9), seen["author"])).tolist()) == {
        1 + best
    }
    shares = np.asarray(editor._apply(key, jnp.arange(10), seen["editor"]))
    np.testing.assert_allclose(shares, np.arange(10) / 10)


def test_indicators_are_those_of_the_state_by_name(played):
    _, states, *_ = played
    state = jax.tree.map(lambda part: part[-1], states).system
    found = {name: INDICATORS[name] for name in INDICATORS}
    assert set(found) >= {"h_index", "impact_factor", "acceptance_rate", "papers"}
    for each in found.values():
        assert len(each.measure(state)) == (12 if each.of == "author" else 10)
    journal = np.asarray(state.literature.journal[: state.literature.published])
    papers = np.bincount(journal, minlength=10)
    np.testing.assert_array_equal(found["papers"].measure(state), papers)
    with np.errstate(invalid="ignore"):
        rate = papers / (papers + np.asarray(state.rejected))
    np.testing.assert_allclose(found["acceptance_rate"].measure(state), rate, rtol=1e-6)
    assert np.asarray(state.rejected).sum() > 0


def test_a_default_learner_is_one_of_the_thesis():
    world = LearnablePublishing(Publishing(), Minded(15.0), "editor")
    assert world.roles["editor"].observation.n == 1000
    assert world.horizon == 200
