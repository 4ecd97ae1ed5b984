"""Runs that are interrupted and resumed, over optimisers."""

import json

import pytest
from helpers.analytic import Bowl, read_record, record_run, small_scenario

from tetra_drake.evolution.entries import BEST_SCENARIO
from tetra_drake.lab.elites import quality_diversity
from tetra_drake.scenario.optimizer_kinds import CmaEs, QualityDiversity, RandomSearch, SteadyState

LEARNING = [CmaEs(sample=0), CmaEs(sample=8, starts=1, population=4)]
OPTIMIZERS = [*LEARNING, SteadyState(population=8), RandomSearch(), QualityDiversity()]


class Counted:
    """The bowl, which is interrupted after `most` of them."""

    def __init__(self, most=60):
        self.most, self.asked = most, 0

    def __call__(self, task):
        self.asked += 1
        if self.asked > self.most:
            raise InterruptedError
        return Bowl()(task)


@pytest.fixture(autouse=True)
def a_small_map(monkeypatch):
    monkeypatch.setattr(quality_diversity, "EMITTERS", 2)
    monkeypatch.setattr(quality_diversity, "BATCH", 4)


BODY = {"robot.cables.outer_stiffness": ["5 lbf/in", "50 lbf/in"]}


@pytest.mark.parametrize(
    ("optimizer", "body"), [*((kind, {}) for kind in OPTIMIZERS), (SteadyState(population=8), BODY)]
)
def test_an_interrupted_run_ends_alike_and_evaluates_nothing_again(optimizer, body, tmp_path):
    changes = {"optimizer": optimizer, "evolution.evaluations": 30, "evolve": body}
    scenario = small_scenario().with_changes(changes)
    statuses = record_run(tmp_path / "whole", scenario, workers=1)
    assert [status.evaluations for status in statuses] == [30, 30]
    whole = read_record(tmp_path / "whole")
    assert (f"trial_01/{BEST_SCENARIO}" in whole) == bool(body)
    # After two iterations of the first trial, within one, and in the second trial.
    ends = (tmp_path / "whole/trial_00/iterations.jsonl").read_text().splitlines()
    counts = [json.loads(line)["evaluations"] for line in (ends[0], ends[-1])]
    for count in {*counts, 11, 45}:
        run, rest = tmp_path / f"{count}", Counted()
        with pytest.raises(InterruptedError):
            record_run(run, scenario, evaluate=Counted(most=count), workers=1)
        record_run(run, evaluate=rest)
        assert read_record(run) == whole
        assert rest.asked == 60 - count
