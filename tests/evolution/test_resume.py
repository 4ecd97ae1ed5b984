"""Runs that are interrupted and resumed, over optimisers."""

import json
from itertools import chain, repeat
from unittest.mock import DEFAULT, Mock

import pytest
from helpers.analytic import Bowl, read_record, record_run, small_scenario

from tetra_drake.evolution.entries import BEST_SCENARIO
from tetra_drake.lab.elites import quality_diversity
from tetra_drake.scenario.optimizer_kinds import CmaEs, QualityDiversity, RandomSearch, SteadyState

LEARNING = [CmaEs(sample=0), CmaEs(sample=8, starts=1, population=4)]
OPTIMIZERS = [*LEARNING, SteadyState(population=8), RandomSearch(), QualityDiversity()]


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
        run, rest = tmp_path / f"{count}", Mock(wraps=Bowl())
        ends = chain([DEFAULT] * count, repeat(InterruptedError))
        interrupted = Mock(wraps=Bowl(), side_effect=ends)
        with pytest.raises(InterruptedError):
            record_run(run, scenario, evaluate=interrupted, workers=1)
        record_run(run, evaluate=rest, workers=1)
        assert read_record(run) == whole
        assert rest.call_count == 60 - count
