"""The simplest experiment; its run is that of the package which `ethogram new study` writes."""

import numpy as np
import pytest
import xarray as xr
from tests.studies.contexts import Halted, Halting

from ethogram.core.errors import InvalidSettings
from ethogram.learners.qlearning import QLearning
from ethogram.physics import native
from ethogram.studies.experiment import Experiment
from ethogram.studies.statistics import ClaimSpec, judge
from ethogram.worlds.sharing import Sharing

EXPERIMENT = Experiment("crowd", "1", Sharing, QLearning, "world.agents", {"few": 2, "many": 8})
PLANS = EXPERIMENT.plans(smoke={"updates": 3, "trials": 5})


class Lifted(Sharing):
    """A world behind whose steps a kernel stands."""

    @property
    def kernels(self):
        return {"beams3d": "auto"}


def test_a_record_names_what_did_the_work_of_a_worlds_kernels(monkeypatch):
    monkeypatch.setattr(native, "implementation", lambda kernel, _: f"{kernel} by hand")
    experiment = Experiment("lifted", "1", Lifted, QLearning, "world.agents", {"few": 2})
    (case,) = experiment.cases(experiment.plans(smoke={"updates": 3, "trials": 5})["smoke"])
    context = Halting()
    with pytest.raises(Halted):
        experiment.run(case, context)
    assert context.kernels == {"beams3d": "beams3d by hand"}


def records(**returns):
    """A record per condition, of five trials and three updates."""
    return {
        name: {
            "results": xr.Dataset(
                {
                    "training_return": (("trial", "update"), np.full((5, 3), value)),
                    "return": ("trial", value + np.arange(5.0)),
                },
                {"update": [1, 2, 3]},
            )
        }
        for name, value in returns.items()
    }


def test_a_plan_has_a_case_for_each_condition_named_after_it():
    cases = EXPERIMENT.cases(PLANS["smoke"])
    assert [case.name for case in cases] == ["few", "many"]
    assert [case.settings["world"]["agents"] for case in cases] == [2, 8]
    assert {case.settings["updates"] for case in cases} == {3}
    assert PLANS["smoke"].description == "5 trials of 3 updates in each condition."
    assert EXPERIMENT.cost(cases[0]).seconds > 0


def test_a_value_that_no_condition_has_names_its_case_by_itself():
    plan = PLANS["smoke"].override(["world.agents=2,3"])
    assert [case.name for case in EXPERIMENT.cases(plan)] == ["few", "world.agents=3"]
    with pytest.raises(InvalidSettings, match=r"world\.agents"):
        PLANS["smoke"].override(["world.agents=0"])


def test_the_table_has_a_row_per_condition_and_the_figure_a_point_per_update():
    found = records(few=1.0, many=4.0)
    (table,) = EXPERIMENT.tables(found)
    assert table.columns == ("condition", "return")
    assert [(name, cell.value) for name, cell in table.rows] == [("few", 3.0), ("many", 6.0)]
    (figure,) = EXPERIMENT.figures(found)
    assert figure.data.rows[0] == ("few", 1.0, 1.0, 1.0, 1.0)
    assert len(figure.data.rows) == 6
    assert EXPERIMENT.tables({})[0].rows == EXPERIMENT.figures({})[0].data.rows == ()


def test_a_difference_is_that_of_the_means_and_needs_both_conditions():
    found = records(few=1.0, many=4.0)
    part = EXPERIMENT.difference(found, "return", "many", "few", "more than", 0.5)
    assert sum(weight * trials.mean for weight, trials in part.terms) == 3.0
    spec = ClaimSpec(number=1, statement="More.", test="more than 0.5", parts=(part,))
    assert judge([spec])[0].effect == 3.0
    assert EXPERIMENT.need(found, 4).lack == "trained for 3 of the 4 updates"
    assert EXPERIMENT.need(found, 3).lack == ""
    alone = EXPERIMENT.difference(records(few=1.0), "return", "many", "few", "more than", 0.5)
    assert alone.missing == ["many"]
