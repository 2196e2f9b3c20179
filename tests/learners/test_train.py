import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.core.errors import EthogramError
from ethogram.learners import train as training
from ethogram.learners.base import Trials
from ethogram.learners.train import Diverged, train


class Toy(eqx.Module):
    """A learner that only updates; a test that does not care begins with 0."""

    def init(self, key):
        del key
        return jnp.int32(0)

    def policy(self, state, *, explore=False):
        del state, explore
        return lambda key, observation: observation


class Breaking(Toy):
    """A learner of two agents, whose losses break at given updates, never at -1."""

    critic: jax.Array  # when each agent's breaks
    actor: jax.Array
    reward: int = eqx.field(static=True, default=-1)

    def update(self, key, state):
        del key  # it comes as it must
        broken = jnp.where(state == self.reward, jnp.inf, 1.0)
        return state + 1, {
            "actor_loss": {"mover": jnp.where(state == self.actor, jnp.nan, 1.0)},
            "critic_loss": {"mover": jnp.where(state == self.critic, jnp.nan, 1.0)},
            "reward": broken,
        }


class Watched:
    """Notes what it is handed after each chunk."""

    def __init__(self):
        self.done, self.states, self.metrics = [], [], []

    def __call__(self, done, state, metrics):
        self.done.append(done)
        self.states.append(int(state))
        self.metrics.append(metrics)


def never():
    return jnp.array([-1, -1])


def run(learner):
    watched = Watched()
    with pytest.raises(Diverged) as stopped:
        train(learner, jax.random.key(0), 12, after_chunk=watched, seconds=jnp.inf)
    return str(stopped.value), watched


def test_a_loss_that_is_not_finite_stops_the_run_and_names_agent_and_update():
    message, watched = run(Breaking(critic=jnp.array([-1, 6]), actor=never()))
    assert message == ("critic_loss.mover[1] is not finite at update 6; after 1 updates all was.")
    assert (watched.done, watched.states) == ([1], [1])  # nobody is handed the broken state


def test_of_what_breaks_the_first_in_time_is_named():
    message, _ = run(Breaking(critic=jnp.array([5, -1]), actor=jnp.array([6, 6])))
    assert message.startswith("critic_loss.mover[0] is not finite at update 5;")


def test_a_number_that_no_agent_owns_is_named_without_one():
    message, watched = run(Breaking(critic=never(), actor=never(), reward=0))
    assert message == "reward is not finite at update 0; after 0 updates all was."
    assert watched.done == []


def test_a_state_that_breaks_in_its_last_step_is_handed_to_nobody():
    class Bursting(Toy):
        def update(self, key, state):
            del key
            return {"weights": [state["weights"][0] * 1e30]}, {"loss": state["weights"][0]}

    watched = []
    with pytest.raises(Diverged, match=r"^weights\.0 of the learner's state is not finite"):
        train(
            Bursting(),
            jax.random.key(0),
            4,
            state={"weights": [jnp.float32(1)]},
            after_chunk=lambda done, *_: watched.append(done),
            seconds=0,
        )
    assert watched == [1]


def test_what_is_no_learner_is_refused_by_name():
    class Growing(Toy):
        def update(self, key, state):
            del key
            return {"weights": state["weights"][None]}, {}

        def init(self, key):
            del key
            return {"weights": jnp.float32(0)}

    class Listing(Toy):
        def update(self, key, state):
            del key
            return state, [jnp.float32(0)]

    key = jax.random.key(0)
    with pytest.raises(EthogramError, match=r"Growing\.update: weights becomes float32\[1\]"):
        train(Growing(), key, 1)
    with pytest.raises(EthogramError, match=r"Listing\.update: its metrics are of type list"):
        train(Listing(), key, 1)


def test_every_update_gets_a_key_of_its_own_number_however_the_chunks_fall():
    class Listing(Toy):
        def update(self, key, state):
            return state, {"key": jax.random.key_data(key)}

    def keys(seconds, start=0):
        watched = Watched()
        train(Listing(), jax.random.key(5), 12, after_chunk=watched, start=start, seconds=seconds)
        return np.concatenate([metrics["key"] for metrics in watched.metrics]), watched.done

    expected = [jax.random.key_data(jax.random.fold_in(jax.random.key(5), i)) for i in range(12)]
    for seconds, start, done in [
        (0, 0, [*range(1, 13)]),
        (jnp.inf, 0, [1, 9, 12]),
        (jnp.inf, 3, [4, 12]),
    ]:
        found, ends = keys(seconds, start)
        np.testing.assert_array_equal(found, expected[start:])
        assert ends == done


def test_it_asks_for_nothing_but_a_learner_a_key_and_a_number_of_updates():
    learner, key = Breaking(never(), never()), jax.random.key(0)
    state, metrics = train(learner, key, 20)
    assert state == 20
    np.testing.assert_array_equal(metrics["actor_loss"]["mover"], np.ones((20, 2)))
    assert train(learner, key, 20, state=state, start=20).metrics is None
    assert train(learner, key, 2, after_chunk=lambda *_: None).metrics is None


class Half(Toy):
    """A learner that has something to report in every other update, and perhaps never again."""

    undefined_metrics = frozenset({"mean"})
    value: float = 1.0

    def update(self, key, state):
        del key
        mean = jnp.where(state % 2 == 0, jnp.nan, self.value)
        return state + 1, {"mean": mean, "other": mean if self.value == 3.0 else 1.0}


def test_a_metric_that_is_declared_may_be_undefined_but_never_infinite():
    key = jax.random.key(0)
    _, metrics = train(Half(), key, 4)
    np.testing.assert_array_equal(metrics["mean"], [np.nan, 1, np.nan, 1])
    with pytest.raises(Diverged, match="mean is not finite at update 1"):
        train(Half(jnp.inf), key, 4)
    with pytest.raises(Diverged, match="other is not finite at update 0"):
        train(Half(3.0), key, 4)


@pytest.mark.parametrize("in_turn", [False, True])
def test_trials_are_as_many_learners_each_with_its_own_key(in_turn):
    class Walking(Toy):
        def init(self, key):
            return jax.random.uniform(key)

        def update(self, key, state):
            after = state + jax.random.uniform(key)
            return after, {"place": after}

        def policy(self, state, *, explore=False):
            return lambda key, observation: {"walker": observation["walker"] + state + explore}

    keys = jax.random.split(jax.random.key(1), 3)
    trials = Trials(Walking(), in_turn)
    state, metrics = train(trials, keys, 5)
    alone = [train(Walking(), key, 5) for key in keys]
    np.testing.assert_allclose(state, [one.state for one in alone], rtol=1e-6)
    np.testing.assert_allclose(
        metrics["place"], np.stack([one.metrics["place"] for one in alone], 1), rtol=1e-6
    )
    seen = {"walker": jnp.arange(3.0)}
    action = trials.policy(state, explore=True)(keys, seen)
    np.testing.assert_allclose(action["walker"], state + jnp.arange(3) + 1)


class Adding(Toy):
    """Adds up, in a memory that is large beside the rest."""

    def update(self, key, state):
        del key
        total = state["total"] + 1.0
        return {"total": total, "memory": state["memory"].at[0].set(total)}, {"total": total}


def nothing_added():
    return {"total": jnp.zeros(()), "memory": jnp.zeros(1000)}


def test_a_chunk_has_as_many_updates_as_fit_in_its_seconds(monkeypatch):
    """On a clock by which an update takes a quarter of a second, after one to compile."""
    now = [0.0]
    run_chunk = training._run_chunk

    def timed(fixed, state):
        now[0] += 0.25 * int(fixed[-1]) + (0 if now[0] else 60.0)
        return run_chunk(fixed, state)

    monkeypatch.setattr(training, "_run_chunk", timed)
    monkeypatch.setattr(training.time, "monotonic", lambda: now[0])
    done = []
    for seconds, updates in [(5.0, 70), (0.1, 3)]:
        train(
            Adding(),
            jax.random.key(0),
            updates,
            state=nothing_added(),
            after_chunk=lambda updates, *_: done.append(updates),
            seconds=seconds,
        )
    assert done == [1, 2, 10, 30, 50, 70, 1, 2, 3]


def test_metrics_never_take_more_memory_than_a_chunk_may_have(monkeypatch):
    monkeypatch.setattr(training, "_METRICS_BYTES", 3 * 4)
    done = []
    train(
        Breaking(never(), never()),
        jax.random.key(0),
        4,
        after_chunk=lambda updates, _, metrics: done.append((updates, len(metrics["reward"]))),
        seconds=jnp.inf,
    )
    assert done == [(1, 1), (2, 1), (3, 1), (4, 1)]  # five numbers an update: room for one


def test_what_a_callback_keeps_stays_what_it_was():
    kept = []

    def keep(done, state, metrics):
        kept.append((done, state, state["memory"], np.asarray(state["total"]), metrics))

    key = jax.random.key(0)
    end, _ = train(Adding(), key, 3, state=nothing_added(), after_chunk=keep, seconds=0)
    train(Adding(), key, 6, state=end, start=3, after_chunk=keep, seconds=0)
    assert [done for done, *_ in kept] == [1, 2, 3, 4, 5, 6]
    for done, state, memory, total, metrics in kept:
        assert state["total"] == state["memory"][0] == memory[0] == total == done
        np.testing.assert_array_equal(metrics["total"], [done])


def test_what_no_callback_keeps_is_not_copied():
    places = []

    def look(done, state, metrics):
        del done, metrics
        places.append(state["memory"].unsafe_buffer_pointer())

    train(Adding(), jax.random.key(0), 5, state=nothing_added(), after_chunk=look, seconds=0)
    assert len(set(places)) == 1


def test_an_interrupt_is_heard_while_a_chunk_is_computed(monkeypatch):
    class Computing:
        def is_ready(self):
            return False

    def interrupted(seconds):
        assert seconds > 0
        raise KeyboardInterrupt

    monkeypatch.setattr(training, "_run_chunk", lambda fixed, state: (Computing(), {}))
    monkeypatch.setattr(training.time, "sleep", interrupted)
    with pytest.raises(KeyboardInterrupt):
        train(Adding(), jax.random.key(0), 5, state=nothing_added())
