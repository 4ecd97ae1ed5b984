"""The loop on a cheap fitness: what it records, and that only scenario and seed decide it."""

import json
import time
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import pytest
from helpers.analytic import Bowl, Deadly, is_deadly, read_record, small_scenario

from tetra_drake.evolution.executors import process_executor
from tetra_drake.evolution.genome import genome_of
from tetra_drake.evolution.optimizers.base import Evaluation, Iteration
from tetra_drake.evolution.record import RunRecord
from tetra_drake.evolution.run import evolve
from tetra_drake.evolution.summary import summary
from tetra_drake.robot.gait import load_gait


def lines(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


class AtOnce:
    """An executor that does everything in submit()."""

    def __init__(self, workers):
        pass

    def submit(self, function, *arguments):
        future = Future()
        future.set_result(function(*arguments))
        return future

    def shutdown(self, wait=True, cancel_futures=False):
        pass


def test_every_evaluation_has_its_line(run_small):
    run = run_small(population=12, iterations=15)
    for number in range(2):
        entries = lines(run / f"trial_{number:02d}" / "evaluations.jsonl")
        assert [entry["index"] for entry in entries] == list(range(12 + 2 * 15))
        assert [entry["iteration"] for entry in entries] == [0] * 12 + [
            1 + i // 2 for i in range(30)
        ]
        assert [entry["placed"] for entry in entries[:12]] == list(range(12))
        for entry in entries:
            expected = Bowl()(np.array(entry["genome"]))
            assert entry["failure"] == expected.failure
            assert entry["fitness"] == (None if expected.failure else expected.fitness)
            assert entry["metrics"] == expected.metrics
        assert any(entry["failure"] for entry in entries)


def test_the_lines_of_the_iterations_follow_from_those_of_the_evaluations(run_small):
    trial = run_small(population=12, iterations=15) / "trial_01"
    entries = lines(trial / "evaluations.jsonl")
    population = {}
    iterations = lines(trial / "iterations.jsonl")
    assert [row["iteration"] for row in iterations] == list(range(16))
    for row in iterations:
        for entry in entries:
            if entry["iteration"] == row["iteration"] and entry["placed"] is not None:
                population[entry["placed"]] = entry
        alive = [e["fitness"] for e in population.values() if e["fitness"] is not None]
        assert row["mean_fitness"] == pytest.approx(np.mean(alive), rel=1e-12)
        assert row["best_fitness"] == max(alive)
        best = entries[row["best_evaluation"]]
        assert best["fitness"] == row["best_fitness"]
        assert best["metrics"]["distance_in"] == row["best_distance_in"]
    assert [row["stop"] for row in iterations] == [None] * 15 + ["all iterations done"]


def test_the_best_gait_is_that_of_the_best_evaluation(run_small, scenario):
    trial = run_small() / "trial_00"
    gait = load_gait(trial / "best_gait.json", scenario)
    best = lines(trial / "iterations.jsonl")[-1]["best_evaluation"]
    assert genome_of(gait).tolist() == lines(trial / "evaluations.jsonl")[best]["genome"]
    assert gait.name == f"thesis, seed 5, trial 0, evaluation {best}"


def test_neither_workers_nor_executor_nor_timing_change_the_record(run_small, tmp_path):
    reference = read_record(run_small("alone", workers=1))
    assert read_record(run_small("crowd", workers=7, evaluate=Bowl(delay=0.004))) == reference
    for name, workers, make_executor in (("pool", 2, process_executor), ("plain", 3, AtOnce)):
        with RunRecord.create(tmp_path / name, scenario=small_scenario(), seed=5) as record:
            evolve(record, evaluate=Bowl(), workers=workers, make_executor=make_executor)
        assert read_record(tmp_path / name) == reference


def test_trials_differ_and_do_not_depend_on_their_number(run_small):
    two = read_record(run_small("two", trials=2))
    three = read_record(run_small("three", trials=3))
    other = read_record(run_small("other", trials=2, seed=6))
    name = "trial_{:02d}/evaluations.jsonl"
    assert two[name.format(0)] == three[name.format(0)]
    assert two[name.format(1)] == three[name.format(1)]
    assert two[name.format(0)] != two[name.format(1)]
    assert two[name.format(0)] != other[name.format(0)]


def test_as_many_evaluations_as_workers_are_under_way(run_small):
    under_way, most = set(), []

    def evaluate(genome):
        under_way.add(id(genome))
        most.append(len(under_way))
        time.sleep(0.002)
        under_way.discard(id(genome))
        return Bowl()(genome)

    run_small(workers=3, evaluate=evaluate)
    assert max(most) == 3


def test_a_run_in_which_everything_fails_goes_to_its_end(run_small):
    def evaluate(genome):
        return Evaluation.failed("no ground")

    trial = run_small(evaluate=evaluate) / "trial_00"
    assert len(lines(trial / "evaluations.jsonl")) == 42
    assert lines(trial / "iterations.jsonl")[-1]["mean_fitness"] is None
    assert not (trial / "best_gait.json").exists()


def test_an_error_in_the_program_is_no_failed_evaluation(run_small):
    def evaluate(genome):
        raise TypeError("a bug")

    with pytest.raises(TypeError, match="a bug"):
        run_small(evaluate=evaluate)


def test_what_kills_its_process_fails_and_the_run_goes_on(tmp_path):
    scenario = small_scenario(population=8, iterations=2, trials=1)
    with RunRecord.create(tmp_path / "run", scenario=scenario, seed=2) as record:
        evolve(record, evaluate=Deadly(), workers=2)
    entries = lines(tmp_path / "run" / "trial_00" / "evaluations.jsonl")
    assert len(entries) == 12
    assert any(is_deadly(entry["genome"]) for entry in entries)
    for entry in entries:
        assert (entry["failure"] == "its process died") == is_deadly(entry["genome"])


def test_workers_are_recycled_without_losing_any(tmp_path, monkeypatch):
    monkeypatch.setattr("tetra_drake.evolution.executors.TASKS_PER_WORKER", 12)
    scenario = small_scenario(population=30, iterations=10, trials=1)
    with RunRecord.create(tmp_path / "run", scenario=scenario, seed=2) as record:
        (status,) = evolve(record, evaluate=Bowl(), workers=2)
    assert status.evaluations == 50


class RandomSearch:
    """Another optimiser: two batches of four, nobody bred."""

    evaluations_at_most = 8

    def __init__(self, scenario, generator):
        self._generator = generator
        self._told = []

    def ask(self):
        return list(self._generator.uniform(1.0, 3.0, (4, 26)))

    def tell(self, fitnesses):
        self._told.append(max(fitnesses))
        stop = "done" if len(self._told) == 2 else None
        return Iteration(mean_fitness=max(self._told), placed=(None,) * 4, stop=stop)


def test_another_optimiser_can_take_the_place(tmp_path):
    with RunRecord.create(tmp_path / "run", scenario=small_scenario(), seed=2) as record:
        statuses = evolve(
            record,
            evaluate=Bowl(),
            workers=2,
            make_executor=ThreadPoolExecutor,
            make_optimizer=RandomSearch,
        )
    assert [status.evaluations for status in statuses] == [8, 8]
    assert [status.stop for status in statuses] == ["done", "done"]


def test_the_summary_has_the_thesis_beside_it(tmp_path):
    with RunRecord.create(tmp_path / "run", scenario=small_scenario(), seed=2) as record:
        statuses = evolve(record, evaluate=Bowl(), workers=2, make_executor=ThreadPoolExecutor)
    text = summary(statuses)
    for number in ("6.6 in", "14.34 in", "32 %", "51 %", "22 s"):
        assert number in text
    best = max(status.best_distance_in for status in statuses)
    assert f"{best:.2f} in" in text
    assert summary([]).count("-") >= 5
