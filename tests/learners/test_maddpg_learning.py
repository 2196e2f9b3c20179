import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.learners.toys import Duet, Listener

from ethogram.core.pytrees import from_arrays, to_arrays
from ethogram.learners.maddpg import MADDPG, Playing
from ethogram.learners.train import Diverged, train

FEW, UPDATES = 300, 1200


def duet(pay=1.0):
    return MADDPG(
        Duet(pay),
        discount=0.5,
        rate=3e-3,
        final_rate=3e-3,
        tau=0.05,
        batch=64,
        episodes=16,
        memory=2048,
        hidden=16,
    )


def trained(learner, seed, updates=UPDATES, after_chunk=lambda *_: None):
    learned, key = learner.init(jax.random.key(seed)), jax.random.key(100 + seed)
    return train(learner, key, learned, updates, after_chunk=after_chunk)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_two_agents_learn_to_play_together(seed):
    earned = []

    def watch(done, learned, metrics):
        del done, learned  # only what is earned counts
        earned.extend(metrics["reward"]["singer"])

    learner = duet()
    policy = learner.policy(trained(learner, seed, after_chunk=watch), noise=False)
    for tune in range(3):
        heard = {"singer": jnp.array([tune]), "pianist": jnp.array([tune])}
        action = policy(jax.random.key(0), heard)
        assert action["singer"] == action["pianist"] == tune
    assert np.mean(earned[-50:]) > 0.95  # by chance 1/9, at best 1; 800 episodes with noise


def test_a_run_taken_up_at_a_checkpoint_ends_with_the_same_agents_bit_for_bit():
    learner, kept = duet(), {}

    def keep(done, learned, metrics):
        del metrics
        arrays = to_arrays(learned)
        kept[done] = {name: array.copy() for name, array in arrays.items()}

    whole = trained(learner, 0, after_chunk=keep)
    stranger = learner.init(jax.random.key(9))
    at = sorted(kept)[len(kept) // 2]
    half = from_arrays(stranger, kept[at])
    rest = train(
        learner,
        jax.random.key(100),
        half,
        UPDATES,
        after_chunk=lambda *_: None,
        start=at,
    )
    jax.tree.map(np.testing.assert_array_equal, rest, whole)


def test_the_same_keys_give_the_same_agents_and_others_give_others():
    learner = duet()
    one, same, other = (trained(learner, seed, updates=FEW).agents for seed in (0, 0, 1))
    jax.tree.map(np.testing.assert_array_equal, one, same)
    assert (one["singer"][0].actor.weights[0] != other["singer"][0].actor.weights[0]).any()


def test_a_loss_that_is_not_finite_stops_the_run_and_names_the_agent():
    with pytest.raises(Diverged, match=r"actor_loss\.pianist\[0\] is not finite at update 0"):
        trained(duet(pay=jnp.nan), 0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_speaker_and_a_listener_do_much_better_than_without_a_channel(seed):
    """Six runs of 20 000 episodes, ten seconds each.

    For orientation, hand-made movers that do not see their velocity: one that knows where to go
    earns -3.3 in 25 steps, one that stays close to all three targets -9.6.
    """
    talking, deaf = (last_return(Listener(channel), seed) for channel in (1.0, 0.0))
    assert talking > -5.0
    assert -12.0 < deaf < -9.0  # what can be learned without a word
    assert talking > deaf + 4.0


def last_return(world, seed):
    """The mean return of the last 2000 episodes, with noise."""
    rounds = 5000
    learner = MADDPG(
        world,
        rate=5e-3,
        final_rate=5e-4,
        anneal=float(rounds),
        tau=0.02,
        batch=256,
        memory=100_000,
        copy_targets=True,
    )
    returns = []

    def keep(done, learned, metrics):
        del done, learned
        returns.append(metrics["reward"]["mover"].reshape(-1))

    learned, key = learner.init(jax.random.key(seed)), jax.random.key(100 + seed)
    first = learner.first_plays
    learned = train(Playing(learner), key, learned, first, after_chunk=keep)
    end = first + rounds
    train(learner, key, learned, end, after_chunk=keep, start=first)
    return np.concatenate(returns)[-2000:].mean()
