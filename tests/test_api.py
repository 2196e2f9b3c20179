"""The front door: what `import ethogram` offers."""

import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import ethogram
from ethogram.core.errors import EthogramError, InvalidSettings, UnknownName

PUBLISHED = Path(__file__).parents[1] / "docs" / "results" / "records"


def test_every_public_name_is_there_and_no_other_is_shown():
    assert set(dir(ethogram)) == {*ethogram.__all__, "__version__"}
    for name in ethogram.__all__:
        assert getattr(ethogram, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'mkae'"):
        ethogram.mkae  # noqa: B018


def test_importing_it_loads_nothing_slow():
    program = "import sys, ethogram; print({'jax', 'xarray', 'numpy'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    assert done.stdout.decode().strip() == "set()"


def test_a_world_is_made_by_its_name_and_wrong_settings_are_named():
    world = ethogram.make("sharing", agents=4, communication="none")
    assert (type(world).__name__, world.agents, world.communication) == ("Sharing", 4, "none")
    with pytest.raises(UnknownName, match=r"'shraing'.*Did you mean 'sharing'"):
        ethogram.make("shraing")
    with pytest.raises(InvalidSettings, match=r"no setting 'agent'. Did you mean 'agents'\?"):
        ethogram.make("sharing", agent=4)
    with pytest.raises(InvalidSettings, match="agents = 0"):
        ethogram.make("sharing", agents=0)
    with pytest.raises(InvalidSettings, match=r"scenario = .*7.*; allowed: a function"):
        ethogram.make("sharing", scenario=jnp.int32(7))


def test_what_is_no_world_is_put_in_no_wrapper():
    with pytest.raises(EthogramError, match="wrap_for: 'qlearning' in Sharing"):
        ethogram.wrap_for("qlearning", ethogram.make("sharing"))


def test_registries_are_iterated_and_indexed():
    assert {"language", "sharing"} <= set(ethogram.WORLDS)
    assert ethogram.LEARNERS["qlearning"] is ethogram.QLearning
    assert "maddpg" in ethogram.LEARNERS
    assert len(ethogram.STUDIES) >= 4


def test_a_policy_is_evaluated_over_whole_episodes():
    world = ethogram.make("sharing", agents=2, steps=6, communication="none")

    def together(_key, observation):
        return {"agent": jnp.zeros_like(observation["agent"])}

    returns = ethogram.evaluate(world, together, jax.random.key(0), episodes=3)
    np.testing.assert_array_equal(returns["agent"], np.full((3, 2), 5.0))  # all but the first step


def test_no_episode_is_none_to_evaluate():
    world = ethogram.make("sharing", agents=2)
    for episodes in (-1, 0):
        with pytest.raises(EthogramError, match=rf"evaluate: episodes = {episodes}; .* 1 or more"):
            ethogram.evaluate(world, lambda key, seen: seen, jax.random.key(0), episodes)
    with pytest.raises(EthogramError, match=r"evaluate: policy = 3; allowed: a function \(key, ob"):
        ethogram.evaluate(world, 3, jax.random.key(0))
    with pytest.raises(EthogramError, match=r"evaluate: key = 3; allowed: jax\.random\.key"):
        ethogram.evaluate(world, lambda key, seen: seen, 3)


WRONG_KINDS = """
import jax, ethogram
from ethogram.core.wrappers import GivenPolicies, RolePolicies
world, key = ethogram.make("language"), jax.random.key(0)
for attempt in (
    lambda: GivenPolicies(world, {"mover": 3}),
    lambda: GivenPolicies(world, ["mover"]),
    lambda: RolePolicies({"mover": 3}),
    lambda: ethogram.rollout(world, 3, key, 1),
    lambda: ethogram.rollout(world, print, 0, 1),
    lambda: ethogram.rollout(world, print, key, 1.5),
    lambda: world.scene(3),
    lambda: ethogram.make("language", delta="far"),
):
    try:
        attempt()
    except ethogram.EthogramError as error:
        print(error)
"""


def test_what_is_of_a_wrong_kind_is_refused_with_what_is_allowed():
    """In a process of its own, in which types are not checked before we do."""
    done = subprocess.run([sys.executable, "-c", WRONG_KINDS], capture_output=True, check=True)
    said = done.stdout.decode().splitlines()
    starts = (
        "GivenPolicies: of the role 'mover': policy = 3; allowed: a function (key, obs",
        "GivenPolicies: ['mover']; allowed: policies by role, {role: policy, ...}.",
        "RolePolicies: of the role 'mover': policy = 3; allowed: a function (key, obs",
        "rollout: policy = 3; allowed: a function (key, obs",
        "rollout: key = 0; allowed: jax.random.key(seed)",
        "rollout: steps = 1.5; allowed: a whole number, 0 or more.",
        "Language.scene: 3 is no trajectory; allowed: the transitions that rollout(world, ...)",
        "Language: delta = 'far': Input should be a valid number",
    )
    for line, start in zip(said, starts, strict=True):
        assert line.startswith(start)


def test_stored_records_are_read_by_study(tmp_path):
    records = ethogram.load_records(PUBLISHED, "sharing")
    assert len(records) == 24
    assert "results" in records["mixed-none-hidden"]
    with pytest.raises(UnknownName, match="'sharign'"):
        ethogram.load_records(PUBLISHED, "sharign")
    with pytest.raises(EthogramError, match="holds no results"):
        ethogram.load_records(tmp_path, "sharing")
