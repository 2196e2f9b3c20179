"""Do herders that pool what they eat spare a pasture?  Two conditions, two claims."""

from ethogram.campaign.study import Records
from ethogram.core.findings import Claim
from ethogram.studies.experiment import Experiment
from ethogram.studies.statistics import ClaimSpec, judge

from . import learner, world

NAME, VERSION = "grazing", "1"  # the version goes up when the same settings give other numbers
TITLE, QUESTION = "A shared pasture", "Do herders that pool what they eat spare the grass?"

CONDITIONS = {"own": 0.0, "pooled": 1.0}
experiment = Experiment(
    NAME, VERSION, world.Pasture, learner.PolicyGradient, "world.pooled", CONDITIONS
)
PLANS = experiment.plans(smoke={"updates": 20, "trials": 5}, quick={"updates": 300, "trials": 10})
cases, cost, run = experiment.cases, experiment.cost, experiment.run
tables, figures = experiment.tables, experiment.figures


def claims(records: Records) -> list[Claim]:
    """Both are about what pooling changes, after 300 updates."""

    def more(number: int, statement: str, measure: str) -> ClaimSpec:
        part = experiment.difference(records, measure, "pooled", "own", "more than", 0.1)
        test = f"Mean {measure}, greedily after training: pooled - own is more than 0.1."
        needs = (experiment.need(records, updates=300),)
        return ClaimSpec(number=number, statement=statement, test=test, parts=(part,), needs=needs)

    return judge([more(1, "They leave more grass.", "grass"), more(2, "They eat more.", "return")])
