import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ethogram.core.errors import InvalidSettings, TooLarge
from ethogram.core.keys import branch
from ethogram.core.wrappers import RolePolicies
from ethogram.worlds.publishing import Publishing
from ethogram.worlds.publishing.citations import cite, rise
from ethogram.worlds.publishing.initial import distance, initial_references
from ethogram.worlds.publishing.literature import LEVELS, distinct, draw, first_beyond
from ethogram.worlds.publishing.policies import (
    Minded,
    Random,
    Ranking,
    Scrutiny,
    ranking_of,
    static,
)
from ethogram.worlds.publishing.quality import linear, power_law

SMALL = Publishing(authors=12, journals=10, initial_papers=60, years=5, steps_per_year=4)


reset = eqx.filter_jit(Publishing.reset)


def play(world, author, editor, seed=0, look=lambda state: state):
    """Every state of an episode, from the first, and all outcomes; arrays have time first."""
    if isinstance(editor, str):
        policy = static(world, author, editor)
    else:  # the share that editors turn away
        policy = RolePolicies({"author": Random(), "editor": Scrutiny(editor)})

    @jax.jit
    def run(key):
        for_start, for_steps = jax.random.split(key)
        start = world.reset(for_start)

        def step(at, key):
            state, seen = at
            for_choice, for_world = jax.random.split(key)
            action = policy(for_choice, seen)
            after, outcome = world.step(for_world, state, action)
            return (after, outcome.observation), (look(state), action, outcome)

        (last, _), (states, actions, outcomes) = jax.lax.scan(
            step, start, jax.random.split(for_steps, world.horizon)
        )
        return states, last, actions, outcomes

    states, last, actions, outcomes = run(jax.random.key(seed))
    whole = jax.tree.map(lambda many, one: np.concatenate([many, one[None]]), states, look(last))
    return whole, jax.tree.map(np.asarray, actions), outcomes


def at(states, time):
    return jax.tree.map(lambda leaf: leaf[time], states)


@pytest.fixture(scope="module", params=["synchronous", "sequential"])
def played(request):
    world = Publishing(
        authors=12, journals=10, initial_papers=60, years=5, steps_per_year=4, update=request.param
    )
    return world, *play(world, "random", "mild_scrutiny")


@pytest.fixture(scope="module")
def busy():
    """Every state of a small world in which everything is accepted."""
    return play(SMALL, "random", "accept_everything")[0]


def told(world, states):
    """Every paper as (block, author, journal, level, what it cites), from drafts that came out."""
    first = at(states, 0).literature
    papers = [
        (block, -1, int(first.journal[p]), int(first.level[p]), [])
        for block in range(3)
        for p in range(first.start[block], first.start[block + 1])
    ]
    for time in range(world.horizon):
        before, after = at(states, time), at(states, time + 1)
        new = slice(int(before.literature.published), int(after.literature.published))
        for number in range(new.start, new.stop):
            author = int(after.literature.author[number])
            cited = [p for p in before.drafts.cited[author].tolist() if p >= 0]
            level, journal = int(before.drafts.level[author]), after.literature.journal[number]
            papers.append((3 + time, author, int(journal), level, cited))
    return papers


def test_papers_come_out_as_they_were_drafted(played):
    world, states, *_ = played
    papers = told(world, states)
    last = at(states, -1).literature
    assert len(papers) == last.published > world.initial_papers + 20
    for number, (block, _, _, level, cited) in enumerate(papers):
        assert last.level[number] == level
        assert last.start[block] <= number < last.start[block + 1]
        assert len(set(cited)) == len(cited)
        assert all(papers[p][0] < block for p in cited), "only what was published before"


def test_h_indices_are_those_of_counting_anew(played):
    world, states, *_ = played
    papers, initial = told(world, states), at(states, 0).literature.citations
    for time in range(0, world.horizon + 1):
        state = at(states, time)
        citations = initial.copy()
        for *_, cited in papers[world.initial_papers : state.literature.published]:
            citations[cited] += 1
        np.testing.assert_array_equal(state.literature.citations, citations)
        for author in range(world.authors):
            own = sorted(
                (citations[p] for p in range(state.literature.published) if papers[p][1] == author),
                reverse=True,
            )
            expected = max((min(i, c) for i, c in enumerate(own, 1)), default=0)
            assert state.citation_stats.h_index[author] == expected
    assert at(states, -1).citation_stats.h_index.max() >= 2


CITING = Publishing(authors=20, journals=10, initial_papers=100, years=4, steps_per_year=10)
jitted_cite, jitted_rise = eqx.filter_jit(cite), eqx.filter_jit(rise)
graphs = st.lists(
    arrays(np.int32, (5, CITING.references), elements=st.integers(-1, 99)), min_size=1, max_size=12
)


@given(owner=arrays(np.int32, 100, elements=st.integers(-1, 19)), graph=graphs)
def test_h_indices_of_any_citation_graph_are_those_of_counting(owner, graph):
    """A hundred papers of twenty authors or of none, cited in rounds of five papers."""
    state, _ = reset(CITING, jax.random.key(0))
    size = len(state.literature.author)
    author = jnp.full(size, -1).at[:100].set(owner)
    own = jnp.asarray(np.bincount(owner[owner >= 0], minlength=20))
    papers, stats = eqx.tree_at(
        lambda at: (at[0].author, at[0].citations, at[1].tally),
        (state.literature, state.citation_stats),
        (author, jnp.zeros(size, int), state.citation_stats.tally.at[:, 0].set(own)),
    )
    counts = np.zeros(100, int)
    for cited in graph:
        stats, papers = jitted_cite(papers, stats, jnp.asarray(cited))
        stats = jitted_rise(stats)
        np.add.at(counts, cited[cited >= 0], 1)
        np.testing.assert_array_equal(papers.citations[:100], counts)
        for one in range(20):
            ranked = np.sort(counts[owner == one])[::-1]
            expected = (ranked >= np.arange(1, len(ranked) + 1)).sum()
            assert stats.h_index[one] == expected


def test_impact_factors_are_those_of_equation_7_3(played):
    world, states, *_ = played
    papers = told(world, states)

    def year(paper):
        block = papers[paper][0]
        return block - 2 if block < 3 else 1 + (block - 3) // world.steps_per_year

    for ended in range(1, world.years + 1):
        state = at(states, ended * world.steps_per_year)
        for journal in range(world.journals):
            window = {
                p
                for p in range(state.literature.published)
                if papers[p][2] == journal and year(p) in (ended - 1, ended - 2)
            }
            citing = [p for p in range(state.literature.published) if year(p) == ended]
            got = sum(c in window for p in citing for c in papers[p][4])
            if window:
                np.testing.assert_allclose(state.impact[journal], got / len(window), rtol=1e-6)
            else:
                assert np.isnan(state.impact[journal])


@pytest.mark.parametrize("played", ["synchronous"], indirect=True)  # else thresholds move
def test_editors_accept_what_is_at_least_their_quartile(played):
    world, states, actions, _ = played
    for time in range(world.horizon):
        before, after = at(states, time), at(states, time + 1)
        papers = before.literature
        for author in range(world.authors):
            choice = actions["author"][time, author]
            new = after.literature.author[papers.published : after.literature.published]
            if choice == 0:
                assert author not in new
                assert after.drafts.rejections[author] == 0
                continue
            own = papers.level[: papers.published][papers.journal[: papers.published] == choice - 1]
            threshold = np.quantile(own, 0.25) if len(own) else -1
            accepted = before.drafts.level[author] >= threshold - 1e-3
            assert (author in new) == accepted
            expected = 0 if accepted else before.drafts.rejections[author] + 1
            assert after.drafts.rejections[author] == expected


def test_rewards_are_changes_of_h_index_and_at_the_years_end_of_impact_factor(played):
    world, states, _, outcomes = played
    np.testing.assert_array_equal(
        outcomes.reward["author"].sum(0), at(states, -1).citation_stats.h_index
    )
    change = np.nan_to_num(states.impact[1:]) - np.nan_to_num(states.impact[:-1])
    np.testing.assert_allclose(outcomes.reward["editor"], change, atol=1e-6)
    quiet = (np.arange(world.horizon) + 1) % world.steps_per_year != 0
    assert not np.asarray(outcomes.reward["editor"])[quiet].any()
    assert np.asarray(outcomes.truncated["author"]).all(1).tolist() == [False] * 19 + [True]


def test_under_improve_only_thresholds_never_fall():
    states, *_ = play(SMALL, "random", "improve_only")
    halves = jnp.full(SMALL.journals, 0.5)
    medians = jax.jit(jax.vmap(lambda q: q.quantile(halves)))(states.qualities)
    there = np.asarray(jax.vmap(lambda q: q.papers)(states.qualities)) > 0
    rises = np.diff(medians, axis=0)[there[:-1]]
    assert (rises >= -1e-3).all()
    assert (rises > 1).any()


def test_quantiles_are_numpys(busy):
    papers = jax.tree.map(jnp.asarray, at(busy, -1))
    shares = jnp.linspace(0, 1, SMALL.journals)
    found = papers.qualities.quantile(shares)
    written = papers.literature.level[: papers.literature.published]
    where = papers.literature.journal[: papers.literature.published]
    expected = [np.quantile(written[where == j], shares[j]) for j in range(SMALL.journals)]
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-2)


def test_three_authors_and_two_journals_worked_by_hand():
    """Two years of two steps; qualities 12, 6 and 3, without spread; each paper cites one.

    Nothing has been published: the initial paper is taken away.
    """
    world = Publishing(
        authors=3, journals=2, initial_papers=1, years=2, steps_per_year=2, references=1, sigma=0.0
    )
    step = eqx.filter_jit(Publishing.step)
    state, _ = reset(world, jax.random.key(0))
    level = jnp.round(jnp.array([12.0, 6.0, 3.0]) / 15 * (LEVELS - 1)).astype(int)
    zero = jax.tree.map(jnp.zeros_like, (state.literature, state.qualities, state.window))
    draftless = jnp.full((3, 1), -1)
    state = eqx.tree_at(
        lambda s: (s.quality, s.drafts.level, s.drafts.cited, s.literature, s.qualities, s.window),
        state,
        (jnp.array([12.0, 6.0, 3.0]), level, draftless, *zero),
    )

    def go(number, author, editor):
        nonlocal state
        action = {"author": jnp.array(author), "editor": jnp.array(editor)}
        state, outcome = step(world, jax.random.key(number), state, action)
        return outcome

    # year 1: empty journals accept whatever their editors ask for; nothing there is to cite
    go(0, [1, 1, 2], [1.0, 1.0])
    assert state.literature.published == 3
    assert state.literature.journal[:3].tolist() == [0, 0, 1]
    assert (state.drafts.cited == -1).all()
    # journal 1 asks for its best, 12: only author 0 passes; author 2 writes anew, and cites
    go(1, [1, 1, 0], [1.0, 0.0])
    assert state.literature.published == 4
    assert state.drafts.rejections.tolist() == [0, 1, 0]
    assert state.rejected.tolist() == [1, 0]
    assert (np.asarray(state.drafts.cited[:, 0]) >= 0).tolist() == [True, False, True]
    assert int(state.drafts.cited[:, 0].max()) <= 2, "what came out in this step is not known yet"
    assert state.impact.tolist() == pytest.approx([np.nan] * 2, nan_ok=True)
    assert state.window.tolist() == [[3, 0], [1, 0]]
    # year 2: the two drafts that cite come out, author 1 tries the other journal, whose best is 3
    cited = [int(state.drafts.cited[author, 0]) for author in (0, 2)]
    outcome = go(2, [2, 2, 2], [1.0, 1.0])
    assert state.literature.published == 7
    citations = np.bincount(cited, minlength=7)
    np.testing.assert_array_equal(state.literature.citations[:7], citations)
    # a cited paper has an author with an h-index of 1, whoever cites it
    owners = [[0, 1, 2][paper] for paper in cited]
    assert state.citation_stats.h_index.tolist() == [int(author in owners) for author in range(3)]
    np.testing.assert_array_equal(outcome.reward["author"], state.citation_stats.h_index)
    # the year ends with nothing more: both citations are of papers of the year before
    outcome = go(3, [0, 0, 0], [0.0, 0.0])
    of_journal = np.bincount([[0, 0, 1][paper] for paper in cited], minlength=2)
    np.testing.assert_allclose(state.impact, of_journal / [3, 1])
    np.testing.assert_allclose(outcome.reward["editor"], of_journal / [3, 1])
    assert outcome.truncated["author"].all()


def test_a_step_without_papers_has_its_place_among_the_others():
    """Two authors, and editors that take only what is better than all they had."""
    world = Publishing(authors=2, journals=10, initial_papers=40, years=4, steps_per_year=5)
    states, *_ = play(world, "random", 1.0)
    published = states.literature.published
    came_out = np.diff(published)
    assert 2 < (came_out > 0).sum() < world.horizon - 2
    np.testing.assert_array_equal(at(states, -1).literature.start[3:], published)
    for time in range(1, world.horizon + 1):
        np.testing.assert_array_equal(
            states.literature.start[time][3 : 4 + time], published[: time + 1]
        )
    papers = told(world, states)
    for time in range(world.horizon):
        known = int(published[time])
        cited = states.drafts.cited[time + 1]
        assert (cited < known).all()
        for author in range(world.authors):
            if states.drafts.rejections[time + 1][author] == 0:  # written in this step
                assert len(set(cited[author].tolist())) == world.references
    assert len(papers) == published[-1]


@pytest.mark.parametrize(
    ("authors", "share"), [(2, 1.0), pytest.param(40, -1.0, marks=pytest.mark.slow)]
)
def test_runs_side_by_side_are_the_runs_one_by_one(authors, share):
    """Also where in one of them nothing comes out, and where more does than is served at once."""
    world = Publishing(authors=authors, journals=10, initial_papers=40, years=2, steps_per_year=4)
    policy = RolePolicies({"author": Minded(world.quality_max), "editor": Scrutiny(share)})

    def run(key):
        def step(at, key):
            state, seen = at
            state, outcome = world.step(branch(key, 1), state, policy(branch(key, 0), seen))
            return (state, outcome.observation), outcome.reward

        start, keys = jax.random.split(key)
        return jax.lax.scan(step, world.reset(start), jax.random.split(keys, world.horizon))

    keys = jax.random.split(jax.random.key(5), 4)
    together = jax.jit(jax.vmap(run))(keys)
    apart = jax.jit(lambda keys: jax.lax.map(run, keys))(keys)
    together, apart = jax.tree.map(np.array, (together, apart))
    for papers in (together[0][0].literature, apart[0][0].literature):
        empty = np.arange(papers.level.shape[1]) >= papers.published[:, None]
        for field in (papers.level, papers.prefix, papers.author, papers.journal):
            np.putmask(field, empty, -1)  # what stands there does not count
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-6), together, apart)
    came_out = np.diff(together[0][0].literature.start, axis=1)[:, 3:] > 0
    assert came_out.all() == (share < 0)
    assert came_out.any()


# References


def test_references_are_drawn_by_quality_and_recency(busy):
    state = at(busy, 11)
    papers = jax.tree.map(jnp.asarray, state.literature)
    drafts = 4000
    year = jnp.int32(3)
    drawn = jax.jit(draw(papers, year, SMALL.steps_per_year, 16, SMALL.initial_papers))(
        jax.random.key(0), jnp.arange(drafts)
    )
    number = int(papers.published)
    block = np.searchsorted(papers.start, np.arange(number), side="right") - 1
    age = 3 - np.where(block < 3, block - 2, 1 + (block - 3) // 4)
    weight = np.asarray(papers.level[:number]) / np.maximum(1, age) ** 3.0
    expected = weight / weight.sum() * drawn.size
    counts = np.bincount(np.asarray(drawn).ravel(), minlength=number)
    enough = expected > 5
    seen = np.append(counts[enough], counts[~enough].sum())
    asked = np.append(expected[enough], expected[~enough].sum())
    assert scipy.stats.chisquare(seen, asked).pvalue > 0.001


def test_successive_references_have_the_exact_probabilities():
    """Two of three papers with weights 1, 2 and 3: all six orders."""
    weights = jnp.array([1, 2, 3])

    def drawn(key, drafts):
        aim = jax.random.randint(key, (4, len(drafts)), 0, 6)
        return first_beyond(jnp.cumsum(weights), aim, jnp.zeros_like(aim), 3, 3)

    found = distinct(jax.random.key(3), drawn, jnp.full(6000, 2), 2)
    for first in range(3):
        for second in {0, 1, 2} - {first}:
            chance = weights[first] / 6 * weights[second] / (6 - weights[first])
            count = int(((found[:, 0] == first) & (found[:, 1] == second)).sum())
            assert abs(count - 6000 * chance) < 5 * np.sqrt(6000 * chance)


def test_where_fewer_papers_are_than_references_all_are_cited():
    world = Publishing(authors=3, journals=10, initial_papers=4, years=1, references=6)
    state, _ = reset(world, jax.random.key(0))
    citable = int(state.literature.citable)
    assert 0 < citable <= 4
    for cited in np.asarray(state.drafts.cited):
        assert (cited >= 0).sum() == citable
        assert len(set(cited[cited >= 0].tolist())) == citable


def test_initial_papers_cite_those_before_them():
    level = jnp.asarray(np.random.default_rng(0).integers(1, LEVELS, 50))
    year = jnp.asarray(np.repeat([0, 1, 2], [20, 20, 10]))
    cited = np.asarray(initial_references(jax.random.key(0), level, year, 5))
    for paper, row in enumerate(cited):
        row = row[row >= 0]
        assert len(set(row.tolist())) == len(row) == min(5, paper)
        assert (row < paper).all()


# The initial state


def test_two_phases_bring_the_impact_factors_near_to_the_real_ones():
    world = Publishing()

    def found(key, assign):
        state, _ = Publishing(init_assignment=assign).reset(key)
        papers = state.literature
        counts = (
            jnp.zeros(world.journals)
            .at[papers.journal]
            .add(jnp.arange(len(papers.journal)) < papers.start[2])
        )
        received = jnp.round(jnp.nan_to_num(state.impact) * counts).astype(int)
        return distance(received, counts.astype(int))

    keys = jax.random.split(jax.random.key(0), 4)
    two, anywhere = (
        jax.jit(jax.vmap(lambda key, assign=assign: found(key, assign)))(keys)
        for assign in ("two_phase", "random")
    )
    assert two.max() <= 0.08
    assert anywhere.min() > 0.3


def test_laws_of_ones_own_take_the_place_of_those_of_the_thesis():
    def everywhere(_key, year, _cited, journals, _aim):
        return jnp.arange(len(year)) % journals

    def alike(_chance, quality, _sigma, _quality_max):
        return quality

    world = Publishing(
        authors=4,
        journals=3,
        initial_papers=9,
        years=1,
        quality_bounds=alike,
        quality_scale=lambda x, largest, quality_max: jnp.full_like(x, 3.0),
        init_assignment=everywhere,
        if_window=lambda received, papers, undefined: papers + 0.5,
    )
    state, seen = reset(world, jax.random.key(0))
    np.testing.assert_array_equal(state.literature.journal[:9], np.arange(9) % 3)
    np.testing.assert_allclose(seen["author"][:, 0], 3.0, atol=1e-3)
    np.testing.assert_array_equal(state.impact % 1, 0.5)


def test_qualities_follow_the_power_law():
    drawn = power_law(jax.random.key(0), (20_000,), exponent=1.5, largest=5.0)
    x = 1 + 4 * np.asarray(linear(drawn, 5.0, 15.0)) / 15
    reach = (1 - x**-0.5) / (1 - 5**-0.5)  # the distribution function
    assert scipy.stats.kstest(reach, "uniform").pvalue > 0.001


@pytest.mark.parametrize(("steps", "authors"), [(10, 100), (60, 20)])
def test_at_constant_flow_the_mean_impact_factor_is_what_follows_from_recency(steps, authors):
    """And tends to n_ref x 1.125 ln((S + 1) / S) / 2 as steps become short.

    S is the sum of 1 / d^3 over the years before.  A draft of step s of a year cites a share s / k
    of this year's papers, and comes out a step later: that of the last step in the next year.
    """
    world = Publishing(authors=authors, years=20, steps_per_year=steps)
    (impact, window), *_ = play(
        world, "random", "accept_everything", look=lambda state: (state.impact, state.window)
    )
    found = [
        np.average(impact[steps * year], weights=window[steps * year - 1].sum(1))
        for year in range(12, 21)
    ]
    before, share = sum(1 / d**3 for d in range(1, 20)), np.arange(steps) / steps
    shares = 1.125 / (share[:-1] + before)
    late = (share[-1] + 1) / (share[-1] + before)
    expected = world.references * (shares.sum() + late) / steps / 2
    assert np.mean(found) == pytest.approx(expected, rel=0.02)
    limit = world.references * 1.125 * np.log((before + 1) / before) / 2
    assert limit == pytest.approx(3.41, abs=0.005)
    assert 0 < expected - limit < 3.1 / steps


# Policies


def test_random_authors_go_anywhere_and_give_up_after_ten_rejections():
    seen = jnp.zeros((3000, 2 + 5)).at[1:, 1].set(10.0).at[0, 1].set(11.0)
    chosen = np.asarray(Random()(jax.random.key(0), seen))
    assert chosen[0] == 0
    counts = np.bincount(chosen[1:], minlength=6)[1:]
    assert scipy.stats.chisquare(counts).pvalue > 0.001


def minded(quality, rejections, impact, bins=10, remainder="spread", **settings):
    seen = jnp.concatenate(
        [jnp.tile(jnp.array([quality, rejections]), (400, 1)), jnp.tile(impact, (400, 1))], 1
    )
    policy = Minded(15.0, Ranking(bins, remainder), **settings)
    return set(np.asarray(policy(jax.random.key(0), seen)).tolist())


def test_minded_authors_match_quality_to_rank():
    impact = jnp.array([3.0, -1.0, 5.0, 1.0, 4.0, 2.0])  # ranks, rising: 2 4 6 1 5 3
    three = {"bins": 3}
    assert minded(15.0, 0, impact, **three) == {3, 5}
    assert minded(14.9, 0, impact, **three) == {1, 6}
    assert minded(4.9, 0, impact, **three) == {2, 4}
    assert minded(14.9, 1, impact, **three) == {2, 4}
    assert minded(14.9, 7, impact, **three) == {2, 4}
    assert minded(15.0, 0, impact, bins=4) == {3, 5}
    assert minded(0.0, 0, impact, bins=4) == {2}
    assert minded(15.0, 0, impact, bins=4, remainder="drop") == {3}
    assert minded(14.9, 0, impact, rule="literal_clamped", **three) == {3, 5}
    assert minded(0.0, 9, impact, rule="literal_clamped", **three) == {3, 5}
    assert minded(14.9, 3, impact, max_rejections=2, **three) == {0}


def test_what_does_not_fit_is_refused(monkeypatch):
    with pytest.raises(InvalidSettings, match=r"bins = 10; .* there are journals, 6"):
        minded(1.0, 0, jnp.zeros(6))
    with pytest.raises(InvalidSettings, match="author = 'rnadom'; allowed: random, minded"):
        static(SMALL, "rnadom", "mild_scrutiny")
    with pytest.raises(TooLarge, match="could publish"):
        reset(Publishing(authors=100_000, years=10_000), jax.random.key(0))
    monkeypatch.setattr("ethogram.core.memory.available_memory", lambda: 10**7)
    with pytest.raises(TooLarge, match=r"5000 authors, 20 journals .* needs .* 10 MB are free"):
        reset(Publishing(authors=5000), jax.random.key(0))
    with pytest.raises(InvalidSettings, match="power_law_max"):
        Publishing(power_law_max=1.0)


@given(
    impact=arrays(np.float32, 6, elements=st.sampled_from([-1.0, 0.0, 1.5, 2.0])),
    tie=arrays(np.uint32, 6, elements=st.integers(0, 3)),
)
def test_counting_ranks_journals_as_sorting_does(impact, tie):
    found = ranking_of(jnp.asarray(impact), jnp.asarray(tie))
    np.testing.assert_array_equal(found, np.lexsort((tie, impact)))


@pytest.mark.parametrize("journals", [10, 80])
def test_impact_factors_that_are_no_numbers_rank_lowest(journals):
    impact = jnp.arange(journals, dtype=float).at[jnp.array([3, 7])].set(jnp.nan).at[5].set(jnp.inf)
    ranked = np.asarray(ranking_of(impact, jnp.arange(journals, dtype=jnp.uint32)))
    assert sorted(ranked) == [*range(journals)]
    assert set(ranked[:2]) == {3, 7}
    assert ranked[-1] == 5


def test_minded_authors_choose_a_journal_whatever_they_see():
    seen = jnp.full((6, 12), jnp.nan).at[1:3].set(jnp.inf).at[3:].set(-jnp.inf)
    chosen = Minded(15.0)(jax.random.key(0), seen)
    assert ((chosen >= 1) & (chosen <= 10)).all()
