from typing import Annotated, Literal

import equinox as eqx
import pydantic
import pytest
from pydantic import Field

from ethogram.core.errors import InvalidSettings
from ethogram.core.settings import Number, check_settings, setting, settings_of


class Meadow(eqx.Module):
    growth: Number = setting(0.3, Annotated[float, Field(ge=0)])
    herders: int = setting(3, Annotated[int, Field(ge=1)], static=True)
    season: str = setting("wet", Literal["wet", "dry"], static=True)

    def __check_init__(self):
        check_settings(self)


def test_settings_have_the_fields_defaults_and_bounds_of_their_owner():
    made = settings_of(Meadow)
    assert (made().growth, made().herders, made().season) == (0.3, 3, "wet")
    assert not hasattr(settings_of(Meadow, omit=("season",))(), "season")
    for wrong in ({"growth": -1.0}, {"herders": 2.5}, {"season": "hot"}, {"weather": 1}):
        with pytest.raises(pydantic.ValidationError):
            made(**wrong)


def test_building_the_owner_checks_the_same_bounds_and_names_all_that_is_wrong():
    with pytest.raises(InvalidSettings, match=r"Meadow: growth = -1: .*; season = 'hot': "):
        Meadow(growth=-1, season="hot")
