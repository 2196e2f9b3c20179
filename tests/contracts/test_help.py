"""What `help` says of every registered world and learner, and of what they are made of."""

import dataclasses
import inspect
import re

import pytest

from ethogram.learners import LEARNERS
from ethogram.physics.beams3d import Material
from ethogram.worlds import WORLDS

OWNERS = {
    **{f"world {name}": WORLDS[name] for name in WORLDS},
    **{f"learner {name}": LEARNERS[name] for name in LEARNERS},
    "material": Material,
}


@pytest.mark.parametrize("owner", OWNERS.values(), ids=OWNERS)
def test_it_explains_every_setting_under_attributes(owner):
    explained = inspect.getdoc(owner).partition("\nAttributes:\n")[2]
    named = re.findall(r"^ {4}(\w+): \S", explained, re.MULTILINE)
    assert named == [field.name for field in dataclasses.fields(owner) if field.init]


@pytest.mark.parametrize("name", WORLDS)
def test_it_explains_the_actions_and_observations_of_every_role(name):
    world = WORLDS[name]
    said = inspect.getdoc(world).partition("\nAttributes:\n")[0]
    for word in ("Action", "Observation"):
        assert re.search(rf"^{word}|[.;:]\s+{word}", said, re.MULTILINE), word
    if name != "learnable_publishing":  # its role is a setting
        assert all(f"`{role}`" in said for role in world().roles)
