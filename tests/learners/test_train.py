import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.learners import train as training
from ethogram.learners.train import Diverged, train


class Breaking(eqx.Module):
    """A learner of two agents, whose losses break at given updates, never at -1."""

    critic: jax.Array  # when each agent's breaks
    actor: jax.Array
    reward: int = eqx.field(static=True, default=-1)

    def update(self, key, learned):
        del key  # it comes as it must
        broken = jnp.where(learned == self.reward, jnp.inf, 1.0)
        return learned + 1, {
            "actor_loss": {"mover": jnp.where(learned == self.actor, jnp.nan, 1.0)},
            "critic_loss": {"mover": jnp.where(learned == self.critic, jnp.nan, 1.0)},
            "reward": broken,
        }


class Watched:
    """Notes what it is handed after each chunk."""

    def __init__(self):
        self.done, self.learned, self.metrics = [], [], []

    def __call__(self, done, learned, metrics):
        self.done.append(done)
        self.learned.append(int(learned))
        self.metrics.append(metrics)


def never():
    return jnp.array([-1, -1])


def run(learner):
    watched = Watched()
    with pytest.raises(Diverged) as stopped:
        train(learner, jax.random.key(0), jnp.int32(0), 12, after_chunk=watched, seconds=jnp.inf)
    return str(stopped.value), watched


def test_a_loss_that_is_not_finite_stops_the_run_and_names_agent_and_update():
    message, watched = run(Breaking(critic=jnp.array([-1, 6]), actor=never()))
    assert message == ("critic_loss.mover[1] is not finite at update 6; after 1 updates all was.")
    assert (watched.done, watched.learned) == ([1], [1])  # nobody is handed the broken state


def test_of_what_breaks_the_first_in_time_is_named():
    message, _ = run(Breaking(critic=jnp.array([5, -1]), actor=jnp.array([6, 6])))
    assert message.startswith("critic_loss.mover[0] is not finite at update 5;")


def test_a_number_that_no_agent_owns_is_named_without_one():
    message, watched = run(Breaking(critic=never(), actor=never(), reward=0))
    assert message == "reward is not finite at update 0; after 0 updates all was."
    assert watched.done == []


def test_a_state_that_breaks_in_its_last_step_is_handed_to_nobody():
    class Bursting(eqx.Module):
        def update(self, key, learned):
            del key
            return {"weights": [learned["weights"][0] * 1e30]}, {"loss": learned["weights"][0]}

    watched = []
    with pytest.raises(Diverged, match=r"^weights\.0 of what is learned is not finite"):
        train(
            Bursting(),
            jax.random.key(0),
            {"weights": [jnp.float32(1)]},
            4,
            after_chunk=lambda done, *_: watched.append(done),
            seconds=0,
        )
    assert watched == [1]


def test_every_update_gets_a_key_of_its_own_number_however_the_chunks_fall():
    class Listing(eqx.Module):
        def update(self, key, learned):
            return learned, {"key": jax.random.key_data(key)}

    def keys(seconds, start=0):
        watched = Watched()
        key, nothing = jax.random.key(5), jnp.int32(0)
        train(Listing(), key, nothing, 12, after_chunk=watched, start=start, seconds=seconds)
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


class Adding(eqx.Module):
    """Adds up, in a memory that is large beside the rest."""

    def update(self, key, learned):
        del key
        total = learned["total"] + 1.0
        return {"total": total, "memory": learned["memory"].at[0].set(total)}, {"total": total}


def nothing_added():
    return {"total": jnp.zeros(()), "memory": jnp.zeros(1000)}


def test_a_chunk_has_as_many_updates_as_fit_in_its_seconds(monkeypatch):
    """On a clock by which an update takes a quarter of a second, after one to compile."""
    now = [0.0]
    run_chunk = training._run_chunk

    def timed(fixed, learned):
        now[0] += 0.25 * int(fixed[-1]) + (0 if now[0] else 60.0)
        return run_chunk(fixed, learned)

    monkeypatch.setattr(training, "_run_chunk", timed)
    monkeypatch.setattr(training.time, "monotonic", lambda: now[0])
    done = []
    for seconds, updates in [(5.0, 70), (0.1, 3)]:
        train(
            Adding(),
            jax.random.key(0),
            nothing_added(),
            updates,
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
        jnp.int32(0),
        4,
        after_chunk=lambda updates, _, metrics: done.append((updates, len(metrics["reward"]))),
        seconds=jnp.inf,
    )
    assert done == [(1, 1), (2, 1), (3, 1), (4, 1)]  # five numbers an update: room for one


def test_what_a_callback_keeps_stays_what_it_was():
    kept = []

    def keep(done, learned, metrics):
        kept.append((done, learned, learned["memory"], np.asarray(learned["total"]), metrics))

    key = jax.random.key(0)
    end = train(Adding(), key, nothing_added(), 3, after_chunk=keep, seconds=0)
    train(Adding(), key, end, 6, after_chunk=keep, start=3, seconds=0)
    assert [done for done, *_ in kept] == [1, 2, 3, 4, 5, 6]
    for done, learned, memory, total, metrics in kept:
        assert learned["total"] == learned["memory"][0] == memory[0] == total == done
        np.testing.assert_array_equal(metrics["total"], [done])


def test_what_no_callback_keeps_is_not_copied():
    places = []

    def look(done, learned, metrics):
        del done, metrics
        places.append(learned["memory"].unsafe_buffer_pointer())

    train(Adding(), jax.random.key(0), nothing_added(), 5, after_chunk=look, seconds=0)
    assert len(set(places)) == 1


def test_an_interrupt_is_heard_while_a_chunk_is_computed(monkeypatch):
    class Computing:
        def is_ready(self):
            return False

    def interrupted(seconds):
        assert seconds > 0
        raise KeyboardInterrupt

    monkeypatch.setattr(training, "_run_chunk", lambda fixed, learned: (Computing(), {}))
    monkeypatch.setattr(training.time, "sleep", interrupted)
    with pytest.raises(KeyboardInterrupt):
        train(Adding(), jax.random.key(0), nothing_added(), 5, after_chunk=lambda *_: None)
