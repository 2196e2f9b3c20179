import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.learners.toys import Duet, Reach, Recital

from ethogram.core.errors import EthogramError
from ethogram.core.rollout import rollout
from ethogram.learners.evolution import AgeFitness
from ethogram.learners.fitness import PolicyFitness
from ethogram.learners.train import train

KEY = jax.random.key(0)


@eqx.filter_jit
def evaluate(fitness, key, genomes):
    return fitness(key, genomes)


@eqx.filter_jit
def play(fitness, genome, keys):
    world = fitness.world
    return jax.vmap(lambda key: rollout(world, fitness.policy(genome), key, world.horizon)[1])(keys)


def test_fitness_is_the_mean_return_of_the_policy_over_the_same_episodes_for_all():
    fitness = PolicyFitness(Duet(), episodes=3, hidden_size=2)
    genomes = fitness.search_space.sample(KEY, 2)
    found = evaluate(fitness, jax.random.key(1), genomes)
    keys = jax.random.split(jax.random.key(1), 3)
    for genome, value in zip(genomes, found.fitness, strict=True):
        played = play(fitness, genome, keys)
        returns = []
        for episode, end in enumerate(np.asarray(played.episode_end)):
            for reward in played.outcome.reward.values():
                returns += reward[episode, : end.argmax() + 1].sum(0).tolist()
        np.testing.assert_allclose(value, np.mean(returns), rtol=1e-4)
    assert not found.diverged.any()


def test_a_fitness_with_a_key_of_its_own_is_deterministic():
    chance = PolicyFitness(Reach(), hidden_size=2)
    fixed = dataclasses.replace(chance, key=KEY)
    assert (chance.deterministic, fixed.deterministic) == (False, True)
    genomes = chance.search_space.sample(KEY, 2)
    one, other = (
        [evaluate(each, jax.random.key(seed), genomes).fitness for seed in (1, 2)]
        for each in (fixed, chance)
    )
    np.testing.assert_array_equal(*one)
    assert (other[0] != other[1]).any()


def test_the_descriptor_is_where_in_its_range_an_action_is_on_average():
    fitness = PolicyFitness(Reach(), key=KEY, episodes=3, hidden_size=2)
    genomes = 3 * fitness.search_space.sample(KEY, 2)
    found = evaluate(fitness, KEY, genomes).descriptor
    for genome, descriptor in zip(genomes, found, strict=True):
        played = play(fitness, genome, jax.random.split(KEY, 3))
        ends = np.asarray(played.episode_end).argmax(1)
        action = np.asarray(played.action["hand"])[:, :, 0]
        steps = np.concatenate([each[: end + 1] for each, end in zip(action, ends, strict=True)])
        np.testing.assert_allclose(descriptor, ((steps + 0.5) / 1.5).mean(0), rtol=1e-4)
    assert np.ptp(found) > 0.05


def test_of_choices_the_descriptor_is_how_often_each_is_made():
    world = Duet(keys=2)
    fitness = PolicyFitness(world, key=KEY, episodes=8, hidden_size=2)
    genomes = 3 * fitness.search_space.sample(KEY, 4)
    found = evaluate(fitness, KEY, genomes).descriptor
    for genome, descriptor in zip(genomes, found, strict=True):
        sung = np.asarray(play(fitness, genome, jax.random.split(KEY, 8)).action["singer"])
        np.testing.assert_allclose(descriptor, [(sung == 0).mean(), (sung == 1).mean()], atol=1e-6)


@pytest.mark.slow
def test_evolved_networks_reach_the_target():
    fitness = PolicyFitness(Reach(), key=KEY, episodes=8, hidden_size=4)
    learner = AgeFitness(fitness.search_space, fitness, population_size=20, mutation_scale=0.5)
    population, metrics = train(learner, jax.random.key(1), 60)
    best = metrics["episode_return"]
    assert (np.diff(best) >= 0).all()
    assert best[-1] > 0.5 * best[0]  # the way that is lost; at best about -1
    action = learner.policy(population)(KEY, {"hand": jnp.zeros((1, 2, 2))})
    assert Reach().roles["hand"].action.contains(action["hand"]).all()


def test_actions_that_no_network_takes_are_refused_by_name():
    with pytest.raises(
        EthogramError, match=r"PolicyFitness needs actions .* of 'pianist' are Multi"
    ):
        PolicyFitness(Recital())
