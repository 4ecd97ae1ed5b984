"""Runs that are interrupted and resumed, over optimisers and robots."""

import json

import pytest
from helpers.analytic import Bowl, read_record, record_run, small_scenario

from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.optimizers import quality_diversity
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.optimizer_kinds import CmaEs, QualityDiversity, RandomSearch, SteadyState

OPTIMIZERS = [
    SteadyState(population=8),
    CmaEs(sample=0),
    CmaEs(sample=8, starts=1, population=4),
    RandomSearch(),
    QualityDiversity(),
]


class Counted:
    """An evaluation that is interrupted after `most` of them."""

    def __init__(self, evaluate, most=10**9):
        self.evaluate, self.most, self.asked = evaluate, most, 0

    def __call__(self, task):
        self.asked += 1
        if self.asked > self.most:
            raise InterruptedError
        return self.evaluate(task)


@pytest.fixture(autouse=True)
def a_small_map(monkeypatch):
    monkeypatch.setattr(quality_diversity, "EMITTERS", 2)
    monkeypatch.setattr(quality_diversity, "BATCH", 4)


@pytest.mark.parametrize(
    ("optimizer", "robot"),
    [*((kind, "row") for kind in OPTIMIZERS), *((kind, "pair") for kind in OPTIMIZERS[:3:2])],
)
def test_an_interrupted_run_ends_alike_and_evaluates_nothing_again(optimizer, robot, tmp_path):
    if robot == "row":
        trials, evaluations = 2, 40
        scenario, evaluate = small_scenario(), Bowl()
    else:  # simulated, by the kernels of the row
        trials, evaluations = 1, 12
        times = {"simulation.duration": "0.6 s", "simulation.steady_from": "0.3 s"}
        scenario = load_scenario("pair").with_changes({"cpg.start_up": "0.1 s", **times})
        evaluate = GaitEvaluation(scenario)
    sizes = {"evolution.evaluations": evaluations, "evolution.trials": trials}
    scenario = scenario.with_changes({"optimizer": optimizer, **sizes})
    statuses = record_run(tmp_path / "whole", scenario, evaluate=evaluate, workers=1)
    assert [status.evaluations for status in statuses] == [evaluations] * trials
    whole = read_record(tmp_path / "whole")
    # After two iterations of the first trial, within some, and in the second trial.
    ends = (tmp_path / "whole/trial_00/iterations.jsonl").read_text().splitlines()
    counts = [json.loads(line)["evaluations"] for line in (ends[0], ends[-1])]
    for count in {*counts, 1, 11, evaluations + 25} if robot == "row" else {9}:
        run, rest = tmp_path / f"{count}", Counted(evaluate)
        with pytest.raises(InterruptedError):
            record_run(run, scenario, evaluate=Counted(evaluate, count), workers=1)
        record_run(run, evaluate=rest, workers=1 if robot == "row" else 2)
        assert read_record(run) == whole
        assert rest.asked == trials * evaluations - count
    rest = Counted(evaluate)
    record_run(tmp_path / "whole", evaluate=rest)
    assert rest.asked == 0 and read_record(tmp_path / "whole") == whole
