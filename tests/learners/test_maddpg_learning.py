import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.learners.toys import Duet, Listener

from ethogram.core.pytrees import from_arrays, to_arrays
from ethogram.core.spaces import Box
from ethogram.core.world import Outcome, Role, World
from ethogram.learners.maddpg import MADDPG
from ethogram.learners.train import Diverged, train

FEW, UPDATES = 300, 1200


def duet(pay=1.0):
    return MADDPG(
        Duet(pay),
        discount=0.5,
        learning_rate=3e-3,
        final_learning_rate=3e-3,
        tau=0.05,
        batch_size=64,
        learning_starts=0,
        episodes_per_update=16,
        buffer_size=2048,
        hidden_size=16,
    )


def trained(learner, seed, updates=UPDATES, after_chunk=None):
    state, key = jax.jit(learner.init)(jax.random.key(seed)), jax.random.key(100 + seed)
    return train(learner, key, updates, state=state, after_chunk=after_chunk)


@pytest.mark.parametrize("seed", [0, *(pytest.param(n, marks=pytest.mark.slow) for n in (1, 2))])
def test_two_agents_learn_to_play_together(seed):
    learner = duet()
    state, metrics = trained(learner, seed)
    policy = learner.policy(state)
    for tune in range(3):
        heard = {"singer": jnp.array([tune]), "pianist": jnp.array([tune])}
        action = policy(jax.random.key(0), heard)
        assert action["singer"] == action["pianist"] == tune
    assert (
        metrics["episode_return"]["singer"][-50:].mean() > 0.95
    )  # by chance 1/9, at best 1; 800 episodes with noise


def test_a_run_taken_up_at_a_checkpoint_ends_with_the_same_agents_bit_for_bit():
    learner, kept = duet(), {}

    def keep(done, state, metrics):
        del metrics
        arrays = to_arrays(state)
        kept[done] = {name: array.copy() for name, array in arrays.items()}

    whole, _ = trained(learner, 0, after_chunk=keep)
    stranger = jax.jit(learner.init)(jax.random.key(9))
    at = sorted(kept)[len(kept) // 2]
    half = from_arrays(stranger, kept[at])
    rest, _ = train(learner, jax.random.key(100), UPDATES, state=half, start=at)
    jax.tree.map(np.testing.assert_array_equal, rest, whole)


def test_the_same_keys_give_the_same_agents_and_others_give_others():
    learner = duet()
    one, same, other = (trained(learner, seed, updates=FEW).state.agents for seed in (0, 0, 1))
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
    updates, plays = 5000, 64  # the latter before the first of the former
    learner = MADDPG(
        world,
        learning_rate=5e-3,
        final_learning_rate=5e-4,
        annealing_updates=float(updates),
        tau=0.02,
        batch_size=256,
        learning_starts=25 * 256,
        buffer_size=100_000,
        copy_targets=True,
    )
    _, metrics = trained(learner, seed, plays + updates)
    return metrics["episode_return"]["mover"].reshape(-1)[-2000:].mean()


class Aiming(World):
    """A thrower earns minus the squared distance of two numbers from what it sees.  One step."""

    @property
    def horizon(self):
        return 1

    @property
    def roles(self):
        return {"thrower": Role(1, Box(-1.0, 1.0, (2,)), Box(-2.0, jnp.array([2.0, 4.0]), (2,)))}

    def reset(self, key):
        target = jax.random.uniform(key, (2,), minval=-1.0)
        return target, self.observe(target)

    def observe(self, state):
        return {"thrower": state[None]}

    def step(self, key, state, action):
        del key  # no wind
        missed = jnp.square(action["thrower"][0] - state).sum()
        return state, Outcome(
            observation=self.observe(state),
            reward={"thrower": -missed[None]},
            terminated={"thrower": jnp.ones(1, bool)},
            truncated={"thrower": jnp.zeros(1, bool)},
        )


def test_a_deterministic_actor_learns_where_to_aim():
    learner = MADDPG(
        Aiming(),
        learning_rate=3e-3,
        final_learning_rate=3e-3,
        batch_size=64,
        learning_starts=0,
        episodes_per_update=16,
        buffer_size=4096,
        hidden_size=32,
    )
    state, metrics = trained(learner, 0)
    aim = learner.policy(state)
    targets = jnp.array([[0.5, -0.5], [-0.8, 0.1], [0.0, 0.9]])
    hits = jnp.stack(
        [aim(jax.random.key(0), {"thrower": at[None]})["thrower"][0] for at in targets]
    )
    np.testing.assert_allclose(hits, targets, atol=0.15)
    earned = metrics["episode_return"]["thrower"]
    assert earned[:10].mean() < -1.0  # at best, 0; exploring costs about 0.1
    assert earned[-50:].mean() > -0.2
