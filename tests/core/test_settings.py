import math
from collections.abc import Callable
from typing import Annotated, Literal

import equinox as eqx
import pydantic
import pytest
from pydantic import Field

from ethogram.core.errors import InvalidSettings, UnknownName
from ethogram.core.settings import (
    Number,
    check_settings,
    function_of,
    named,
    setting,
    settings_of,
)


def sine(day: float) -> float:
    return math.sin(day)


RAINS = {"never": lambda day: 0.0, "sine": sine}


class Meadow(eqx.Module):
    growth: Number = setting(0.3, Annotated[float, Field(ge=0)])
    herders: int = setting(3, Annotated[int, Field(ge=1)], static=True)
    season: str = setting("wet", Literal["wet", "dry"], static=True)
    rain: str | Callable[[float], float] = named("sine", RAINS)

    def __check_init__(self):
        check_settings(self)


def test_settings_have_the_fields_defaults_and_bounds_of_their_owner():
    made = settings_of(Meadow)
    assert (made().growth, made().herders, made().season) == (0.3, 3, "wet")
    assert not hasattr(settings_of(Meadow, omit=("season",))(), "season")
    for wrong in (
        {"growth": -1.0},
        {"herders": 2.5},
        {"season": "hot"},
        {"weather": 1},
        {"rain": sine},
    ):
        with pytest.raises(pydantic.ValidationError):
            made(**wrong)


def test_building_the_owner_checks_the_same_bounds_and_names_all_that_is_wrong():
    with pytest.raises(InvalidSettings, match=r"Meadow: growth = -1: .*; season = 'hot': "):
        Meadow(growth=-1, season="hot")


@pytest.mark.parametrize(
    ("value", "shown"),
    [("fast", "'fast': .*valid number"), (math.inf, "inf: .*finite"), (math.nan, "nan: .*finite")],
)
def test_what_is_no_finite_number_is_refused_by_name(value, shown):
    with pytest.raises(InvalidSettings, match=rf"Meadow: growth = {shown}"):
        Meadow(growth=value)
    with pytest.raises(pydantic.ValidationError, match="growth"):
        settings_of(Meadow)(growth=value)


def test_a_function_stands_in_for_a_name_and_plans_know_the_names_only():
    assert settings_of(Meadow)().rain == Meadow().rain == "sine"
    assert function_of(RAINS, Meadow().rain) is sine
    assert function_of(RAINS, Meadow(rain=math.cos).rain) is math.cos
    with pytest.raises(UnknownName, match=r"'sin'.*Did you mean 'sine'"):
        Meadow(rain="sin")
    with pytest.raises(InvalidSettings, match="3 is neither a function nor a name; allowed: "):
        Meadow(rain=3)
