"""Evaluating vectors by simulation: objectives, failures, and the same numbers in any process."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from helpers.analytic import small_scenario

from tetra_drake.engines.compiled.lane_pool import LanePool
from tetra_drake.engines.simulate import simulate
from tetra_drake.engines.time_limit import check_time
from tetra_drake.evolution.draws import SeededVector
from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.evolution.executors import evaluate_all
from tetra_drake.robot.gait import ParameterSpace
from tetra_drake.scenario.settings import Disturbances


@pytest.fixture
def tiny():
    """0.3 s from a standing start, actuated at once so that gaits differ."""
    return small_scenario().with_changes(
        {"simulation.duration": "0.3 s", "simulation.steady_from": "0.1 s", "cpg.start_up": 0.0}
    )


@pytest.fixture
def vectors(tiny):
    generator = np.random.default_rng(1)
    return [ParameterSpace.of(tiny).random(generator) for _ in range(2)]


def test_an_evaluation_is_that_of_its_gait_bit_for_bit_in_any_process(tiny, vectors):
    here = [GaitEvaluation(tiny)(vector) for vector in vectors]
    there = dict(evaluate_all(GaitEvaluation(tiny), vectors, workers=1))
    for index, vector in enumerate(vectors):
        gait = ParameterSpace.of(tiny).gait(vector, name="any")
        result = simulate(scenario=tiny, gait=gait, record=True)
        assert here[index].fitness == there[index].fitness == result.fitness
        assert here[index].metrics == there[index].metrics == result.metrics.to_json()
        assert there[index].engine == "drake"
        assert there[index].wall_time > 0.0
    assert here[0].fitness != here[1].fitness
    twisting = GaitEvaluation(tiny, lambda result: -result.metrics.twist - 1.0)(vectors[0])
    assert twisting.fitness == -here[0].metrics["twist"] - 1.0
    assert twisting.metrics == here[0].metrics


def highest(result):
    """Greatest height of a node."""
    return result.trajectory["p_WN"].sel(axis="z").max()


@pytest.mark.parametrize("engine", ["!Drake", "!Compiled"])
def test_an_objective_that_reads_the_trajectory_says_so(
    tiny, vectors, engine, refused, monkeypatch
):
    scenario = tiny.with_changes({"engine": engine})
    with refused("objective", "", "needs_trajectory"):
        GaitEvaluation(scenario, highest)(vectors[0])
    monkeypatch.setattr(highest, "needs_trajectory", True, raising=False)
    evaluation = GaitEvaluation(scenario, highest)(vectors[0])
    gait = ParameterSpace.of(scenario).gait(vectors[0], name="any")
    result = simulate(scenario, gait, record=True)
    assert evaluation.fitness == highest(result) > 0.05
    assert evaluation.metrics == result.metrics.to_json()


@pytest.mark.parametrize(
    ("changes", "objective", "kind"),
    [
        ({"simulation.max_evaluations": 50}, None, "step budget: "),
        ({"cpg.gain": "4e9 N", "cpg.start_up": 0.0}, None, "diverged: "),
        ({}, lambda result: math.nan, "diverged: "),
    ],
)
def test_failures_say_why_and_have_the_worst_fitness(tiny, vectors, changes, objective, kind):
    failed = GaitEvaluation(tiny.with_changes(changes), objective)(vectors[0])
    assert failed.failure.startswith(kind)
    assert (failed.fitness, failed.metrics) == (-math.inf, {})


def test_evaluations_in_lanes_keep_their_budgets(tiny, vectors):
    compiled = tiny.with_changes({"engine": "!Compiled"})
    endless = {"simulation.duration": "1 h", "evolution.time_budget": "0.05 s"}
    with LanePool(1) as lanes:
        for changes, kind in (
            ({"simulation.max_evaluations": 50}, "step budget: "),
            ({"cpg.gain": "4e9 N", "cpg.start_up": 0.0}, "diverged: "),
            (endless, "time budget: "),
        ):
            failed = GaitEvaluation(compiled.with_changes(changes), None, lanes)(vectors[0])
            assert failed.failure.startswith(kind)
            assert failed.wall_time > 0.0


@pytest.mark.parametrize("engine", ["drake", "compiled", "mujoco"])
def test_time_budgets_hold_in_any_thread_and_end_with_their_evaluation(tiny, vectors, engine):
    if engine == "mujoco":
        pytest.importorskip("mujoco")
    changes = {"engine": f"!{engine.capitalize()}", "simulation.duration": "60.0 s"}
    late = GaitEvaluation(tiny.with_changes(changes | {"evolution.time_budget": "0.01 s"}))
    with ThreadPoolExecutor(1) as thread:
        failed = thread.submit(late, vectors[0]).result()
        assert failed.failure == "time budget: not done after 0.01 s"
        assert thread.submit(check_time).exception() is None


def test_many_gaits_in_lanes_are_those_gaits_one_by_one(tiny, vectors):
    compiled = tiny.with_changes({"engine": "!Compiled"})
    draws = Disturbances(draws=2, start=0.1)
    among = compiled.with_changes({"disturbances": draws})
    for scenario, tasks in (
        (compiled, vectors),
        (among, [SeededVector(vector, (1, 2, 3)) for vector in vectors]),
    ):
        evaluate = GaitEvaluation(scenario)
        assert evaluate.side_by_side > 1
        alone, together = [evaluate(task) for task in tasks], evaluate.many(tasks)
        for one, other in zip(alone, together, strict=True):
            assert replace(one, wall_time=0.0) == replace(other, wall_time=0.0)
            assert other.wall_time > 0.0
    assert GaitEvaluation(tiny).side_by_side == 1
