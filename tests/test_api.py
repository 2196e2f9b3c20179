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


def test_stored_records_are_read_by_study(tmp_path):
    records = ethogram.load_records(PUBLISHED, "sharing")
    assert len(records) == 24
    assert "results" in records["mixed-none-hidden"]
    with pytest.raises(UnknownName, match="'sharign'"):
        ethogram.load_records(PUBLISHED, "sharign")
    with pytest.raises(EthogramError, match="holds no results"):
        ethogram.load_records(tmp_path, "sharing")
