"""The learner: what it learns where the best action is known."""

import jax

import ethogram


def test_two_agents_learn_to_share_a_place_that_pays_the_more_the_fuller_it_is() -> None:
    world = ethogram.make("sharing", agents=2, steps=4, communication="none", observe_filling=False)
    learner = ethogram.LEARNERS["grazing"](world)
    state, metrics = ethogram.train(learner, jax.random.key(0), 100)
    assert metrics is not None
    assert metrics["episode_return"]["agent"].shape == (100, 16, 2)
    returns = ethogram.evaluate(world, learner.policy(state), jax.random.key(1), episodes=1)
    assert returns["agent"].tolist() == [[3.0, 3.0]]  # 1 in each step but the first
