"""Evaluating genomes with Drake: repeatability, failures, and a whole tiny run."""

import dataclasses
import json
import math
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from helpers.analytic import read_record, small_scenario

from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import Diverged
from tetra_drake.evolution import evaluation
from tetra_drake.evolution.evaluation import GaitEvaluation, TimeBudgetExceeded, time_limit
from tetra_drake.evolution.executors import process_executor
from tetra_drake.evolution.record import RunRecord, read_manifest
from tetra_drake.evolution.trials import run_trials
from tetra_drake.robot.gait import ParameterSpace, load_gait


def tiny_scenario():
    """0.3 s from a standing start, actuated at once so that gaits differ."""
    scenario = small_scenario(population=4, iterations=2, trials=1)
    scenario.simulation.duration, scenario.simulation.steady_from = 0.3, 0.1
    scenario.cpg.start_up = 0.0
    return scenario


@pytest.fixture
def genome():
    return ParameterSpace.of(tiny_scenario()).random(np.random.default_rng(1))


def test_failures_say_why_and_have_the_worst_fitness(genome):
    scenario = tiny_scenario()
    scenario.simulation.max_evaluations = 50
    failed = GaitEvaluation(scenario)(genome)
    assert failed.failure.startswith("step budget: ")
    assert failed.fitness == -math.inf
    assert failed.metrics == {}
    scenario = tiny_scenario()
    scenario.simulation.max_speed = 1e-6
    assert GaitEvaluation(scenario)(genome).failure.startswith("diverged: ")


def test_an_evaluation_that_takes_too_long_is_given_up(genome):
    scenario = tiny_scenario()
    scenario.simulation.duration = 15.0
    scenario.evolution.time_budget = 0.3
    started = time.monotonic()
    failed = GaitEvaluation(scenario)(genome)
    assert failed.failure == "time budget: not done after 0.3 s"
    assert time.monotonic() - started < 1.5


def test_the_time_limit_is_gone_after_its_block():
    with time_limit(0.05):
        pass
    time.sleep(0.1)
    with pytest.raises(TimeBudgetExceeded), time_limit(0.05):
        time.sleep(1.0)


def test_a_fitness_that_is_not_finite_is_a_failure(genome):
    failed = GaitEvaluation(tiny_scenario(), lambda result: math.nan)(genome)
    assert failed.failure.startswith("diverged: ")


def test_an_objective_takes_the_place_of_the_scenarios_fitness(genome):
    plain = GaitEvaluation(tiny_scenario())(genome)
    own = GaitEvaluation(tiny_scenario(), lambda result: -result.metrics.twist - 1.0)(genome)
    assert own.fitness == -plain.metrics["twist"] - 1.0
    assert own.metrics == plain.metrics


def test_the_reason_of_a_failed_simulation_is_kept(genome, monkeypatch):
    def fail(**_):
        raise Diverged(time=1.5, reason="too fast")

    monkeypatch.setattr(evaluation, "simulate", fail)
    failure = GaitEvaluation(tiny_scenario())(genome).failure
    assert failure == "diverged: simulation failed at t = 1.5000 s: too fast"


def test_a_tiny_run_from_end_to_end(tmp_path):
    scenario = tiny_scenario()
    for name, executor in (("run", process_executor), ("here", ThreadPoolExecutor)):
        with RunRecord.create(tmp_path / name, scenario=scenario, seed=1) as record:
            run_trials(
                record,
                evaluate=GaitEvaluation(scenario),
                workers=2 if name == "run" else 1,
                executor=executor,
            )
    # Bit for bit, whichever process evaluates.
    assert read_record(tmp_path / "run") == read_record(tmp_path / "here")

    trial = tmp_path / "run" / "trial_00"
    entries = [json.loads(line) for line in (trial / "evaluations.jsonl").open()]
    assert len(entries) == 8
    assert len({entry["fitness"] for entry in entries}) > 1
    best = json.loads((trial / "iterations.jsonl").read_text().splitlines()[-1])
    gait = load_gait(trial / "best_gait.json", scenario)
    result = simulate(scenario=read_manifest(tmp_path / "run").scenario, gait=gait, record=True)
    assert result.fitness == best["best_fitness"]
    assert dataclasses.asdict(result.metrics) == entries[best["best_evaluation"]]["metrics"]
