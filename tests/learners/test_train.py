import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ethogram.learners.train import Diverged, even_chunk, train


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
        train(learner, jax.random.key(0), jnp.int32(0), 10, chunk=4, after_chunk=watched)
    return str(stopped.value), watched


def test_a_loss_that_is_not_finite_stops_the_run_and_names_agent_and_update():
    message, watched = run(Breaking(critic=jnp.array([-1, 6]), actor=never()))
    assert message == ("critic_loss.mover[1] is not finite at update 6; after 4 updates all was.")
    assert (watched.done, watched.learned) == ([4], [4])  # nobody is handed the broken state


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
            chunk=1,
            after_chunk=lambda done, *_: watched.append(done),
        )
    assert watched == [1]


def test_every_update_gets_a_key_of_its_own_number_however_the_chunks_fall():
    class Listing(eqx.Module):
        def update(self, key, learned):
            return learned, {"key": jax.random.key_data(key)}

    def keys(chunk, start=0):
        watched = Watched()
        key, nothing = jax.random.key(5), jnp.int32(0)
        train(Listing(), key, nothing, 7, chunk=chunk, after_chunk=watched, start=start)
        return np.concatenate([metrics["key"] for metrics in watched.metrics])

    expected = [jax.random.key_data(jax.random.fold_in(jax.random.key(5), i)) for i in range(7)]
    np.testing.assert_array_equal(keys(chunk=7), expected)
    np.testing.assert_array_equal(keys(chunk=3), expected)
    np.testing.assert_array_equal(keys(chunk=3, start=3), expected[3:])


@given(updates=st.integers(1, 5000), most=st.integers(-1, 400))
def test_chunks_are_as_long_as_allowed_and_all_alike_if_that_costs_less_than_half(updates, most):
    size, most = even_chunk(updates, most), max(1, min(most, updates))
    assert 1 <= size <= most
    even = [length for length in range(1, most + 1) if updates % length == 0 and 2 * length > most]
    assert size == max(even, default=most)


def test_a_prime_number_of_updates_has_a_shorter_chunk_at_its_end():
    assert even_chunk(4999, 50) == 50
    assert even_chunk(5000, 70) == 50
    assert even_chunk(3, 50) == 3
