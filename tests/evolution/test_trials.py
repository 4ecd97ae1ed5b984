"""The trial loop on a cheap fitness: what it records, and that only scenario and seed decide it."""

import json

import numpy as np
import pytest
from helpers.analytic import Bowl, RandomSearch, read_record, record_run, small_scenario

from tetra_drake.evolution import evaluators
from tetra_drake.evolution.run import load_run
from tetra_drake.optimizers.base import Evaluation, Iteration, Task


def lines(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_every_evaluation_has_its_line_and_those_of_the_iterations_follow(run_small):
    trial = run_small(population=12, iterations=15) / "trial_01"
    entries, iterations = lines(trial / "evaluations.jsonl"), lines(trial / "iterations.jsonl")
    assert [entry["index"] for entry in entries] == list(range(12 + 2 * 15))
    assert [e["iteration"] for e in entries] == [0] * 12 + [1 + i // 2 for i in range(30)]
    assert [entry["placed"] for entry in entries[:12]] == list(range(12))
    for entry in entries:
        expected = Bowl()(Task(np.array(entry["genome"])))
        assert entry["failure"] == expected.failure
        assert entry["fitness"] == (None if expected.failure else expected.fitness)
        assert entry["metrics"] == expected.metrics
    assert any(entry["failure"] for entry in entries)

    population = {}
    assert [row["iteration"] for row in iterations] == list(range(16))
    for row in iterations:
        for entry in entries:
            if entry["iteration"] == row["iteration"] and entry["placed"] is not None:
                population[entry["placed"]] = entry
        alive = [e["fitness"] for e in population.values() if e["fitness"] is not None]
        assert row["mean_fitness"] == pytest.approx(np.mean(alive), rel=1e-12)
        assert row["best_fitness"] == max(alive)
        assert entries[row["best_evaluation"]]["fitness"] == row["best_fitness"]
    assert [row["stop"] for row in iterations] == [None] * 15 + ["all evaluations done"]


def test_neither_workers_nor_executor_nor_timing_change_the_record(
    run_small, tmp_path, monkeypatch
):
    reference = read_record(run_small("alone", workers=1))
    assert read_record(run_small("crowd", workers=7, evaluate=Bowl(delay=0.004))) == reference
    monkeypatch.setattr(evaluators, "TASKS_PER_WORKER", 20)
    processes = evaluators.on_executor(Bowl(), evaluators.WorkerProcesses, 2)
    record_run(tmp_path / "pool", small_scenario(), evaluator=processes)
    assert read_record(tmp_path / "pool") == reference


def test_trials_differ_and_do_not_depend_on_their_number(run_small):
    two, three = (load_run(run_small(f"{n}", trials=n)).evaluations for n in (2, 3))
    other = load_run(run_small("other", trials=1, seed=6)).evaluations
    assert two.equals(three.query("trial < 2"))
    first, second = (two.query("trial == @trial")["weight_1"].tolist() for trial in (0, 1))
    assert first not in (second, other["weight_1"].tolist())


@pytest.mark.parametrize("report", [{"mean_fitness": "wide"}, {"stop": 3}])
def test_an_optimiser_that_reports_what_cannot_be_recorded_is_named(tmp_path, refused, report):
    class Odd(RandomSearch):
        def tell(self, evaluations):
            return Iteration(report)

    with refused("optimizer", *report, "Input should be a valid"):
        record_run(tmp_path, small_scenario(trials=1), optimizer=Odd)
    assert not list(tmp_path.rglob("iterations.jsonl"))


def test_a_run_in_which_everything_fails_goes_to_its_end(run_small):
    trial = run_small(evaluate=lambda vector: Evaluation(failure="no ground")) / "trial_00"
    assert len(lines(trial / "evaluations.jsonl")) == 42
    assert lines(trial / "iterations.jsonl")[-1]["mean_fitness"] is None
    assert not (trial / "best_gait.json").exists()
