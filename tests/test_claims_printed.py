"""What `ethogram claims` prints of a claim, as text and as JSON."""

import json
import math
from dataclasses import asdict

import numpy as np

from ethogram.cli.printing import claim_lines, finite
from ethogram.core.findings import Revision
from ethogram.studies.statistics import ClaimSpec, Part, Support, Trials, judge

CHANGE = Revision(
    date="2026-01-02", change="The margin is 2.", reason="It was 1.98.", known="All results."
)


def judged(values, support=Support()):  # noqa: B008
    part = Part(
        label="J(optional) - J(always)",
        terms=((1.0, Trials("a condition", np.array(values, float), support)),),
        side="less than",
        margin=-1.98,
        unit="return",
    )
    spec = ClaimSpec(
        number=4,
        statement="Optional is worse.",
        source="p. 1",
        test="J is lower by more than 1.98.",
        parts=(part,),
        stated="2026-01-01",
        history=(CHANGE,),
        depends_on=("J in validation (confirmed)",),
    )
    return judge([spec])[0]


def test_a_claim_is_printed_with_its_comparison_side_margin_and_history():
    lines = [line.strip() for line in claim_lines(judged(np.linspace(-0.02, 0.02, 20))).split("\n")]
    assert lines[0] == "4. refuted    Optional is worse."
    assert lines[1].startswith("J(optional) - J(always): ")
    assert "] return, claimed less than -1.98, p < 1e-15" in lines[1]
    assert lines[2:] == [
        "J is lower by more than 1.98.",
        "another verdict under: J in validation (confirmed)",
        "stated 2026-01-01, its test changed 2026-01-02 (--json says how and why)",
    ]


def test_json_has_side_margin_comparison_and_history_and_no_p_of_zero():
    claim = judged([-2.5] * 8, Support(low=-9.0, high=9.0, exact=True))
    assert claim.p_value > 0
    plain = json.loads(json.dumps(finite(asdict(claim)), allow_nan=False))
    assert (plain["side"], plain["margin"]) == ("less than", -1.98)
    assert plain["compared"] == "J(optional) - J(always)"
    assert plain["p_value"] > 0
    assert plain["history"] == [asdict(CHANGE)]


def test_an_interval_without_an_end_is_null_in_json():
    claim = judged([3.0, 4.0, 5.0, 11.0, 11.0], Support(low=2.0, high=11.0, capped=True))
    assert claim.high == math.inf
    assert json.loads(json.dumps(finite(asdict(claim)), allow_nan=False))["high"] is None
