"""Evolution of a robot that is no row: each optimiser on a prism, interrupted and resumed."""

import itertools

import pytest
from helpers.analytic import read_record, record_run

from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.optimizers import quality_diversity
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.optimizer_kinds import (
    CmaEs,
    QualityDiversity,
    RandomSearch,
    SteadyState,
)

EVALUATIONS, SEEN = 12, 9
OPTIMIZERS = [
    SteadyState(population=8),
    CmaEs(sample=4, starts=1, population=4),
    RandomSearch(),
    QualityDiversity(),
]


class Interrupted:
    """Evaluation that is interrupted when so many gaits have been simulated."""

    def __init__(self, evaluate, most):
        self.evaluate, self.asked, self.most = evaluate, itertools.count(1), most

    def __call__(self, vector):
        if next(self.asked) > self.most:
            raise KeyboardInterrupt
        return self.evaluate(vector)


@pytest.mark.parametrize("optimizer", OPTIMIZERS, ids=lambda kind: type(kind).__name__)
def test_a_run_on_a_prism_resumes_to_the_same_digits(optimizer, tmp_path, monkeypatch):
    monkeypatch.setattr(quality_diversity, "EMITTERS", 2)
    monkeypatch.setattr(quality_diversity, "BATCH", 2)
    changes = {
        "simulation.duration": "0.6 s",
        "simulation.steady_from": "0.3 s",
        "cpg.start_up": "0.1 s",
        "optimizer": optimizer,
        "evolution.evaluations": EVALUATIONS,
    }
    scenario = load_scenario("prism").with_changes(changes)
    evaluate = GaitEvaluation(scenario)
    [status] = record_run(tmp_path / "whole", scenario, evaluate=evaluate, workers=1)
    assert (status.evaluations, status.failures) == (EVALUATIONS, 0)
    with pytest.raises(KeyboardInterrupt):
        broken = Interrupted(evaluate, SEEN)
        record_run(tmp_path / "broken", scenario, evaluate=broken, workers=1)
    record_run(tmp_path / "broken", evaluate=evaluate, workers=1)
    assert read_record(tmp_path / "broken") == read_record(tmp_path / "whole")
