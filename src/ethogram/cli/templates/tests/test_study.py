"""The study: its smoke plan, from the cases to the verdicts."""

from grazing import study

from ethogram.campaign.context import Context


def test_the_smoke_plan_has_a_table_a_figure_and_a_verdict_on_every_claim() -> None:
    plan = study.PLANS["smoke"]
    records = {case.name: study.run(case, Context()) for case in study.cases(plan)}
    (table,) = study.tables(records)
    assert [row[0] for row in table.rows] == ["own", "pooled"]
    assert study.figures(records)[0].svg.startswith("<svg")
    assert [claim.verdict for claim in study.claims(records)] == ["undecided"] * 2  # too short
